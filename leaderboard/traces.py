"""The action file of a variant: the arrays of its trials, arranged so that they compress.

    8 bytes   magic
    uint32    trials, then the columns of an action (of a pose action those of both parts)
    uint32    actions of each trial
    4 planes  the differences from action to action, most significant bytes first

All little-endian. Executed actions are quantised (`action_space`), so the same float32 bits come
back. Of each number the difference to the action before is kept, small ones of either sign as small
numbers; column by column through all trials, first all first bytes, then all second ones and so on.

Behind each action of a pose policy stands the joint action that was executed. A later version may
compute that otherwise from the pose; so it is what is replayed, and gives the physics steps.
"""

import struct
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import LARGEST, STEPS_PER_UNIT, is_quantized
from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import action_steps
from robospa.leaderboard.bundle import BundleError

MAGIC = b"rspa-a2\n"
HEAD = struct.Struct("<8sII")
WIDEST = 36
"""Columns of a trace, at most: two poses, and two arms of nine joints, all with their grippers."""
ONE, TOP = np.uint32(1), np.uint32(31)

Trace = NDArray[np.float32]
Words = NDArray[np.uint32]


def encode(traces: Sequence[Trace]) -> bytes:
    """The file of `traces`, each (actions, D) with one D for all.

    A trace without actions may have any D. ValueError if they differ in D or leave the grid.
    """
    widths = {t.shape[1] for t in traces if len(t)}
    if len(widths) > 1:
        raise ValueError(f"actions of one variant have {sorted(widths)} columns")
    width = widths.pop() if widths else 0
    head = HEAD.pack(MAGIC, len(traces), width)
    lengths = np.array([len(t) for t in traces], "<u4").tobytes()
    words = [_differences(t) for t in traces if len(t)]
    columns = np.concatenate(words).T if words else np.zeros((0, 0), "<u4")
    planes = columns.astype(">u4", order="C").reshape(-1).view(np.uint8).reshape(-1, 4).T
    return head + lengths + np.ascontiguousarray(planes).tobytes()


def most_bytes(steps: Sequence[int]) -> int:
    """The most bytes that the file of trials with so many `steps` each may have."""
    return HEAD.size + 4 * len(steps) + 4 * WIDEST * sum(steps)


def decode(data: bytes, what: str) -> list[Trace]:
    """The traces in a file; BundleError, naming `what`, if it is none or holds more or less."""
    if len(data) < HEAD.size:
        raise BundleError(f"{what} is no action file: it is too short")
    magic, trials, width = HEAD.unpack_from(data)
    if magic != MAGIC:
        raise BundleError(f"{what} is no action file of this version: its first bytes are others")
    if width > WIDEST or HEAD.size + 4 * trials > len(data):
        raise BundleError(
            f"{what} announces {trials} trials of {width} columns, more than it can hold"
        )
    lengths = np.frombuffer(data, "<u4", trials, HEAD.size).astype(np.int64)
    start = HEAD.size + 4 * trials
    if not width:
        if lengths.any() or len(data) > start:
            raise BundleError(f"{what} announces actions without columns")
        return [np.zeros((0, 0), np.float32)] * trials
    count = int(lengths.sum()) * width
    if start + 4 * count != len(data):
        raise BundleError(
            f"{what} announces {int(lengths.sum())} actions of {width} columns and has "
            f"{len(data)} bytes, not {start + 4 * count}"
        )
    planes = np.frombuffer(data, np.uint8, 4 * count, start).reshape(4, count)
    table = _joined(planes).reshape(width, -1)
    table = (table >> ONE) ^ -(table & ONE)
    ends = [0, *np.cumsum(lengths).tolist()]
    for first, last in pairwise(ends):
        if count and last > first:
            own = table[:, first:last]
            np.cumsum(own, axis=1, dtype=np.uint32, out=own)
    steps = np.ascontiguousarray(table.T).view(np.int32)
    if (
        count
        and not -LARGEST * STEPS_PER_UNIT <= steps.min() <= steps.max() <= LARGEST * STEPS_PER_UNIT
    ):
        raise BundleError(f"{what} has an action with a number beyond {LARGEST}")
    floats = steps.astype(np.float32)
    floats /= np.float32(STEPS_PER_UNIT)
    return [floats[a:b] for a, b in pairwise(ends)]


def _joined(planes: NDArray[np.uint8]) -> Words:
    """The words whose first, second, third and last bytes are in the four `planes`."""
    words = np.empty((planes.shape[1], 4), np.uint8)
    for place, plane in enumerate(planes):
        words[:, 3 - place] = plane
    return words.view("<u4")


def _differences(trace: Trace) -> Words:
    """Zigzag differences of the whole numbers of grid steps in `trace` (T, D)."""
    if not is_quantized(trace):
        raise ValueError(f"an action is finer than 1/{STEPS_PER_UNIT} or beyond {LARGEST}")
    steps = (trace * np.float32(STEPS_PER_UNIT)).astype(np.int32).view(np.uint32)
    steps[1:] -= steps[:-1].copy()
    return (steps << ONE) ^ -(steps >> TOP)


def with_joints(actions: Trace, joints: Trace | None) -> Trace:
    """A trace (T, D + D') of actions (T, D) and the joint actions (T, D') executed, if any."""
    return actions if joints is None else np.hstack([actions, joints])


def split_trace(trace: Trace, robot: str, space: str) -> tuple[Trace, Trace]:
    """The actions of a trace as they were sent, and the joint actions that were executed;
    BundleError if it has other columns."""
    kinds = dict.fromkeys((space, "joint"))
    sent, *more = (embodiment(robot).action_space(kind).width for kind in kinds)
    if len(trace) and trace.shape[1] != (width := sent + sum(more)):
        raise BundleError(f"{space} actions of {robot} have {width} numbers, not {trace.shape[1]}")
    return trace[:, :sent], trace[:, sent:] if more else trace


def durations(robot: str, joints: Trace) -> NDArray[np.int64]:
    """The physics steps of each joint action, float32 (T, D)."""
    body = embodiment(robot)
    values = joints.astype(np.float64)
    change = np.empty((len(joints), 2))
    for a, (part, arm) in enumerate(zip(body.action_space("joint").arms, body.arms, strict=True)):
        lower, upper = ([getattr(j, side) for j in arm.joints] for side in ("lower", "upper"))
        goals = np.clip(values[:, part.body.start : part.body.stop], lower, upper)
        change[:, a] = np.abs(np.diff(goals, axis=0, prepend=[arm.home])).max(axis=1)
    return action_steps(change)
