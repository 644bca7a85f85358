"""Mistakes in what a policy answers, each as something to undo.

`robospa.harness.convention_check.check` undoes them one by one and in pairs and looks which brings
the answers nearest to a recorded demonstration. Order, signs and origin are fitted to the answers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np

from robospa.geometry import Array
from robospa.harness.convention_check.samples import Sample
from robospa.rotations import product, quaternion_to_matrix

TCP_AHEAD = 0.12
"""The tool centre point is this far [m] along the x axis of the end-effector frame."""
PI_SIGNS = (1, 2)
"""The joints of an arm whose sign openpi's `adapt_to_pi` changes."""


@dataclass(frozen=True)
class ActionFault:
    """One mistake in what a policy answers. `phrase` completes "it looks as if ..."; only one part
    of a `family` can be true at a time. `undo` gives None where it makes no sense."""

    name: str
    phrase: str
    family: str
    undo: Callable[[Sample], Sample | None]


def _given(change: Callable[[Sample], Array], space: str = "") -> Callable[[Sample], Sample | None]:
    def undo(case: Sample) -> Sample | None:
        if space and case.space != space:
            return None
        return replace(case, given=change(case))

    return undo


def _columns(order: Callable[[int], Sequence[int]], space: str = "") -> Any:
    """Column i of ours is column order(half)[i] of the answer."""
    return _given(lambda case: case.given[:, list(order(case.half))], space)


def _grippers(change: Callable[[Array], Array]) -> Any:
    def changed(case: Sample) -> Array:
        given = case.given.copy()
        given[:, case.grippers] = change(given[:, case.grippers])
        return given

    return _given(changed)


def _joints(change: Callable[[Sample, Array], Array]) -> Any:
    def changed(case: Sample) -> Array:
        given = case.given.copy()
        given[:, case.joints] = change(case, given[:, case.joints])
        return given

    return _given(changed, "joint")


def _later(shift: int, stride: int = 1) -> Callable[[Sample], Sample | None]:
    """Compare action k with frame t + shift + (k + 1) * stride."""

    def undo(case: Sample) -> Sample | None:
        if case.track is None:
            return None
        rows = case.t + shift + (np.arange(len(case.given)) + 1) * stride
        rows = rows[rows < len(case.track)]
        if len(rows) < 2:
            return None
        return replace(case, given=case.given[: len(rows)], wanted=case.track[rows])

    return undo


def _slower(case: Sample) -> Sample | None:
    """Two actions for every recorded frame."""
    given = case.given[1::2]
    return replace(case, given=given, wanted=case.wanted[: len(given)]) if len(given) > 1 else None


def _measured(case: Sample) -> Sample | None:
    if case.measured is None:
        return None
    rows = case.t + 1 + np.arange(len(case.given))
    return replace(case, wanted=case.measured[rows])


def _moved(case: Sample, along: float) -> Array:
    """Positions shifted by `along` [m] on the x axis of each rotation."""
    given = case.given.copy()
    for arm in (0, 8):
        q = given[:, arm + 3 : arm + 7]
        real = np.linalg.norm(q, axis=1, keepdims=True) > 1e-9
        turn = quaternion_to_matrix(np.where(real, q, [1.0, 0.0, 0.0, 0.0]))
        given[:, arm : arm + 3] += along * turn[:, :, 0]
    return given


def _pose_delta(case: Sample, each: bool) -> Array:
    """Differences of position added to the pose at the start; rotations turned on from it."""
    given = case.given.copy()
    for arm in (0, 8):
        steps, now = given[:, arm : arm + 3], case.now[arm : arm + 7]
        given[:, arm : arm + 3] = now[:3] + (np.cumsum(steps, axis=0) if each else steps)
        turned = now[3:7]
        for row in given[:, arm + 3 : arm + 7]:
            row[:] = product(turned, row)
            turned = row.copy() if each else turned
    return given


ORDER, HAND, TIME = "order", "grippers", "time"

PARTS: tuple[ActionFault, ...] = (
    ActionFault(
        "arms swapped",
        "its actions name the right arm first",
        "arms",
        _columns(lambda h: [*range(h, 2 * h), *range(h)]),
    ),
    ActionFault(
        "grippers last",
        "its actions have both grippers at the end",
        ORDER,
        _columns(
            lambda h: [*range(h - 1), 2 * h - 2, *range(h - 1, 2 * h - 2), 2 * h - 1], "joint"
        ),
    ),
    ActionFault(
        "grippers first",
        "its actions have each gripper before its arm",
        ORDER,
        _columns(lambda h: [*range(1, h), 0, *range(h + 1, 2 * h), h], "joint"),
    ),
    ActionFault(
        "arms interleaved",
        "its actions alternate between left and right",
        ORDER,
        _columns(lambda h: [*range(0, 2 * h, 2), *range(1, 2 * h, 2)]),
    ),
    ActionFault(
        "joints reversed",
        "its joints run from the hand to the shoulder",
        ORDER,
        _columns(
            lambda h: [*range(h - 2, -1, -1), h - 1, *range(2 * h - 2, h - 1, -1), 2 * h - 1],
            "joint",
        ),
    ),
    ActionFault(
        "degrees",
        "its joints are in degrees, not radians",
        "units",
        _joints(lambda case, joints: np.radians(joints)),
    ),
    ActionFault(
        "millimetres",
        "its positions are in millimetres, not metres",
        "units",
        _given(lambda case: case.given / np.where(np.arange(16) % 8 < 3, 1000.0, 1.0), "ee"),
    ),
    ActionFault(
        "quaternion x y z w",
        "its quaternions are x y z w, not w x y z",
        "quaternion",
        _given(
            lambda case: case.given[:, [0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 14, 11, 12, 13, 15]], "ee"
        ),
    ),
    ActionFault(
        "quaternion slip",
        "its quaternions come from w x y z read as x y z w, as in X-VLA's official data",
        "quaternion",
        _given(
            lambda case: case.given[:, [0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 12, 13, 14, 11, 15]], "ee"
        ),
    ),
    ActionFault(
        "gripper inverted",
        "1 is a closed gripper in its actions, not an open one",
        HAND,
        _grippers(lambda g: 1 - g),
    ),
    ActionFault(
        "gripper 0..0.1",
        "its grippers go from 0 to 0.1 (an opening in metres), not to 1",
        HAND,
        _grippers(lambda g: g / 0.1),
    ),
    ActionFault(
        "gripper 0..0.045",
        "its grippers go from 0 to 0.045 (a finger's way in metres), not to 1",
        HAND,
        _grippers(lambda g: g / 0.045),
    ),
    ActionFault(
        "gripper 0..100",
        "its grippers are in percent",
        HAND,
        _grippers(lambda g: g / 100),
    ),
    ActionFault(
        "gripper 0..255",
        "its grippers go from 0 to 255, not to 1",
        HAND,
        _grippers(lambda g: g / 255),
    ),
    ActionFault(
        "gripper -1..1",
        "its grippers go from -1 (closed) to 1, not from 0",
        HAND,
        _grippers(lambda g: (g + 1) / 2),
    ),
    ActionFault(
        "gripper 1..-1",
        "its grippers go from -1 (open) to 1 (closed), not from 1 (open) to 0",
        HAND,
        _grippers(lambda g: (1 - g) / 2),
    ),
    ActionFault(
        "delta from the start",
        "its actions are differences to the state at the query, not absolute targets",
        "delta",
        _joints(lambda case, joints: case.now[case.joints] + joints),
    ),
    ActionFault(
        "delta from the last",
        "each of its actions is a difference to the one before, not an absolute target",
        "delta",
        _joints(lambda case, joints: case.now[case.joints] + np.cumsum(joints, axis=0)),
    ),
    ActionFault(
        "pose delta from the start",
        "its poses are differences to the pose at the query, not absolute",
        "delta",
        _given(lambda case: _pose_delta(case, False), "ee"),
    ),
    ActionFault(
        "pose delta from the last",
        "each of its poses is a difference to the one before, not absolute",
        "delta",
        _given(lambda case: _pose_delta(case, True), "ee"),
    ),
    ActionFault(
        "tool centre",
        "its poses are those of the tool centre point, 0.12 m ahead of the frame in use here",
        "frame",
        _given(lambda case: _moved(case, -TCP_AHEAD), "ee"),
    ),
    ActionFault(
        "a frame late", "its first action is the present command, not the next", TIME, _later(-1)
    ),
    ActionFault("a frame early", "its first action is one frame too far ahead", TIME, _later(1)),
    ActionFault("three early", "its first action is three frames too far ahead", TIME, _later(3)),
    ActionFault(
        "twice as fast", "each of its actions spans two recorded frames", TIME, _later(0, 2)
    ),
    ActionFault(
        "three times as fast", "each of its actions spans three recorded frames", TIME, _later(0, 3)
    ),
    ActionFault("half as fast", "it gives two actions for every recorded frame", TIME, _slower),
    ActionFault(
        "measured joints",
        "it predicts what the robot will measure, not what it is commanded",
        "measured",
        _measured,
    ),
)


def fitted(cases: Sequence[Sample]) -> list[ActionFault]:
    """Parts that depend on all `cases`: order and signs of an arm's joints, origin of positions."""
    if cases[0].space == "ee":
        return [_offset(cases)]
    size = cases[0].half - 1
    found = []
    given = np.concatenate([c.given for c in cases]).reshape(-1, 2, size + 1)[:, :, :-1]
    wanted = np.concatenate([c.wanted for c in cases]).reshape(-1, 2, size + 1)[:, :, :-1]
    now = np.concatenate([np.tile(c.now, (len(c.given), 1)) for c in cases])
    now = now.reshape(-1, 2, size + 1)[:, :, :-1]
    cost = np.abs(given[..., None, :] - wanted[..., :, None]).mean(axis=(0, 1))
    cost += 0.002 * (1 - np.eye(size))
    rows = list(range(size))
    best = min(permutations(rows), key=lambda p: float(cost[rows, p].sum()))
    if list(best) != rows:
        told = " ".join(str(i + 1) for i in best)
        order = [*best, size, *(i + size + 1 for i in best), 2 * size + 1]
        found.append(
            ActionFault(
                "joint order",
                f"the joints of an arm are in another order (ours are its {told})",
                ORDER,
                _columns(lambda h: order, "joint"),
            )
        )
    for about, name in ((0 * now, "joint signs"), (now, "signs of motion")):
        mirrored = 2 * about - given
        better = np.abs(mirrored - wanted).mean(axis=(0, 1)) + 0.01
        flips = np.flatnonzero(better < np.abs(given - wanted).mean(axis=(0, 1)))
        if len(flips):
            found.append(_signs(name, tuple(int(i) for i in flips), size))
    return found


def _signs(name: str, flips: tuple[int, ...], size: int) -> ActionFault:
    told = " and ".join(str(i + 1) for i in flips)
    pi = " (as if openpi's adapt_to_pi were on)" if flips == PI_SIGNS else ""
    columns = [i + arm * (size + 1) for arm in (0, 1) for i in flips]

    def changed(case: Sample) -> Array:
        given = case.given.copy()
        about = case.now[columns] if name == "signs of motion" else 0.0
        given[:, columns] = 2 * about - given[:, columns]
        return given

    kind = "the motion of" if name == "signs of motion" else ""
    phrase = " ".join(f"{kind} joint {told} of each arm has the wrong sign{pi}".split())
    return ActionFault(name, phrase, "signs", _given(changed, "joint"))


def _offset(cases: Sequence[Sample]) -> ActionFault:
    gap = np.concatenate([c.given - c.wanted for c in cases])
    middle = np.median(gap, axis=0)
    shift = np.where(np.arange(16) % 8 < 3, middle, 0.0)
    told = ", ".join(f"{v:+.2f}" for v in shift[:3])
    right = ", ".join(f"{v:+.2f}" for v in shift[8:11])
    return ActionFault(
        "another origin",
        f"its positions are off by ({told}) m left and ({right}) m right: another origin",
        "frame",
        _given(lambda case: case.given - shift, "ee"),
    )
