"""A policy's answer beside what came next in a demonstration, and the mistakes that it may show.

Each mistake is something to undo: `robospa.harness.convention_check.check` undoes them one by one
and in pairs and looks which brings the answers nearest to a recorded demonstration. Order, signs
and origin are fitted to the answers.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from robospa.action_space import ARMS, ActionSpace, ArmColumns
from robospa.geometry import Array, angle_between, product, quaternion_to_matrix, rotate

SCALES = {"joints": 0.1, "gripper": 0.2, "position": 0.03, "rotation": 0.2}
"""The mean error [rad, 1, m, rad] of an answer that is about as good as it should be."""
UNITS = {"joints": "rad", "gripper": "", "position": "m", "rotation": "rad"}
WORST = 20.0
"""Errors count up to this many times their scale, so that none hides the others."""


@dataclass(frozen=True)
class AnswerSample:
    """One answer: `given` (K, D) beside what came next in the record, `recorded` (K, D).

    `now` (D,) is the command at that frame, `track` (T, D) the whole record of which `now` is row
    `t`; `measured` the same as the robot measured it, if known. All in `space`, of the kind joint
    or ee.
    """

    space: ActionSpace
    given: Array
    recorded: Array
    now: Array
    track: Array | None = None
    t: int = 0
    measured: Array | None = None


def groups(space: ActionSpace) -> list[str]:
    """The groups of columns that errors are reported for, in order."""
    parts = ("joints", "gripper") if space.kind == "joint" else ("position", "rotation", "gripper")
    return [f"{arm} {part}" for arm in ARMS for part in parts]


def errors(case: AnswerSample) -> Array:
    """Mean error of each of `groups`: [rad] over joints, [m], [rad] of turning, gripper 0..1."""
    found = []
    a, b = case.given, case.recorded
    for arm in case.space.arms:
        if case.space.kind == "joint":
            found.append(np.abs(a[:, arm.body] - b[:, arm.body]).mean())
        else:
            place, turn = arm.position, arm.quaternion
            found.append(np.linalg.norm(a[:, place] - b[:, place], axis=1).mean())
            found.append(_angle(a[:, turn], b[:, turn]).mean())
        found.append(np.abs(a[:, arm.gripper] - b[:, arm.gripper]).mean())
    return np.array(found)


def score(case: AnswerSample) -> float:
    """All errors in one number: about 1 for an answer as good as it should be."""
    scales = np.array([SCALES[name.split()[1]] for name in groups(case.space)])
    return float(np.minimum(errors(case) / scales, WORST).mean())


def _angle(a: Array, b: Array) -> Array:
    """Angles [rad] between rotations of any length; pi for what is none."""
    lengths = np.linalg.norm(a, axis=1, keepdims=True) * np.linalg.norm(b, axis=1, keepdims=True)
    real = lengths > 1e-9
    # both lengths at once: the vector part of a product scales with them
    angle = angle_between(a / np.where(real, lengths, 1.0), b)
    return np.where(real[:, 0], angle, np.pi)


TCP_AHEAD = 0.12
"""The tool centre point is this far [m] along the x axis of the end-effector frame."""
PI_SIGNS = (1, 2)
"""The joints of an arm whose sign openpi's `adapt_to_pi` changes."""


Undo = Callable[[AnswerSample], "AnswerSample | None"]


@dataclass(frozen=True)
class ActionFault:
    """One mistake in what a policy answers. `phrase` completes "it looks as if ..."; only one part
    of a `family` can be true at a time. `undo` gives None where it makes no sense."""

    name: str
    phrase: str
    family: str
    undo: Undo


def _given(change: Callable[[AnswerSample], Array], kind: str = "") -> Undo:
    def undo(case: AnswerSample) -> AnswerSample | None:
        if kind and case.space.kind != kind:
            return None
        return replace(case, given=change(case))

    return undo


Columns = list[int]


def _columns(order: Callable[[Columns, Columns], Columns], kind: str = "") -> Undo:
    """Column i of ours is column order(left, right)[i] of the answer; `left` and `right` are our
    columns of the arms, the gripper last."""

    def changed(case: AnswerSample) -> Array:
        rows = list(range(case.space.width))
        left, right = (rows[arm.all] for arm in case.space.arms)
        return case.given[:, order(left, right)]

    return _given(changed, kind)


def _arms(
    columns: Callable[[ArmColumns], Columns | int | slice],
    change: Callable[[Array, Array], Array],
    kind: str = "",
) -> Undo:
    """`change(given, now)` is done to these columns of each arm, of which `now` is the command."""

    def changed(case: AnswerSample) -> Array:
        given = case.given.copy()
        for arm in case.space.arms:
            own = columns(arm)
            given[:, own] = change(given[:, own], case.now[own])
        return given

    return _given(changed, kind)


def _joints(change: Callable[[Array, Array], Array]) -> Undo:
    return _arms(lambda arm: arm.body, change, "joint")


def _grippers(shut: float, wide: float) -> Undo:
    """Of grippers that are closed at `shut` and open at `wide`."""
    return _arms(lambda arm: arm.gripper, lambda given, now: (given - shut) / (wide - shut))


def _quaternions(order: Columns) -> Undo:
    """Number i of our quaternions, w x y z, is number order[i] of theirs."""
    return _arms(lambda arm: arm.quaternion, lambda given, now: given[:, order], "ee")


def _later(shift: int, stride: int = 1) -> Undo:
    """Compare action k with frame t + shift + (k + 1) * stride."""

    def undo(case: AnswerSample) -> AnswerSample | None:
        if case.track is None:
            return None
        rows = case.t + shift + (np.arange(len(case.given)) + 1) * stride
        rows = rows[rows < len(case.track)]
        if len(rows) < 2:
            return None
        return replace(case, given=case.given[: len(rows)], recorded=case.track[rows])

    return undo


def _interleaved(case: AnswerSample) -> AnswerSample | None:
    """Columns that alternate between two arms of equally many joints."""
    left, right = case.space.joints
    if case.space.kind == "joint" and left != right:
        return None
    order = [*range(0, case.space.width, 2), *range(1, case.space.width, 2)]
    return replace(case, given=case.given[:, order])


def _slower(case: AnswerSample) -> AnswerSample | None:
    """Two actions for every recorded frame."""
    given = case.given[1::2]
    return (
        replace(case, given=given, recorded=case.recorded[: len(given)]) if len(given) > 1 else None
    )


def _measured(case: AnswerSample) -> AnswerSample | None:
    if case.measured is None:
        return None
    rows = case.t + 1 + np.arange(len(case.given))
    return replace(case, recorded=case.measured[rows])


def _moved(case: AnswerSample, along: float) -> Array:
    """Positions shifted by `along` [m] on the x axis of each rotation."""
    given = case.given.copy()
    for arm in case.space.arms:
        q = given[:, arm.quaternion]
        real = np.linalg.norm(q, axis=1, keepdims=True) > 1e-9
        turn = quaternion_to_matrix(np.where(real, q, [1.0, 0.0, 0.0, 0.0]))
        given[:, arm.position] += along * turn[:, :, 0]
    return given


def from_pose(
    chunk: Array, now: Array, space: ActionSpace, *, each: bool, turned: bool, local: bool
) -> Array:
    """The poses (K, 16) that differences (K, 16) to the pose `now` (16,) lead to, or with `each` to
    the action before. Positions count along the axes of the world, with `local` along those of the
    hand; rotations are turned on, or without `turned` taken as they are."""
    poses = chunk.copy()
    for arm in space.arms:
        place, turn = now[arm.position], now[arm.quaternion]
        for row in poses:
            w, x, y, z = turn.tolist() if local else (1.0, 0.0, 0.0, 0.0)
            row[arm.position] = place + rotate((w, x, y, z), row[arm.position])
            if turned:
                row[arm.quaternion] = product(turn, row[arm.quaternion])
            if each:
                length = max(float(np.linalg.norm(row[arm.quaternion])), 1e-9)
                place, turn = row[arm.position].copy(), row[arm.quaternion] / length
    return poses


def _differences(*, each: bool = False, turned: bool = True, local: bool = False) -> Undo:
    how = {"each": each, "turned": turned, "local": local}
    return _given(lambda case: from_pose(case.given, case.now, case.space, **how), "ee")


GRIPPERS = {
    "inverted": (1.0, 0.0),
    "0..0.1": (0.0, 0.1),
    "0..0.045": (0.0, 0.045),
    "0..100": (0.0, 100.0),
    "0..255": (0.0, 255.0),
    "-1..1": (-1.0, 1.0),
    "1..-1": (1.0, -1.0),
}
"""What stands for a closed and for an open gripper where that is not 0 and 1."""


PHRASES = {
    "arms swapped": "its actions name the right arm first",
    "grippers last": "its actions have both grippers at the end",
    "grippers first": "its actions have each gripper before its arm",
    "arms interleaved": "its actions alternate between left and right",
    "joints reversed": "its joints run from the hand to the shoulder",
    "degrees": "its joints are in degrees, not radians",
    "millimetres": "its positions are in millimetres, not metres",
    "quaternion x y z w": "its quaternions are x y z w, not w x y z",
    "quaternion slip": "its quaternions are w x y z read as x y z w, as in X-VLA's data",
    **{
        f"gripper {name}": f"{shut:g} is a closed gripper and {wide:g} an open one in its actions"
        for name, (shut, wide) in GRIPPERS.items()
    },
    "delta from the start": "its actions are differences to the state at the query, not absolute",
    "delta from the last": "each of its actions is a difference to the one before, not absolute",
    "pose delta from the start": "its poses are differences to that at the query, not absolute",
    "pose delta from the last": "each of its poses is a difference to the one before, not absolute",
    "position delta from the start": "its positions alone are differences to those at the query",
    "position delta from the last": "its positions alone are differences to those before",
    "pose in the hand's frame": "its poses are those in the frame of the hand at the query",
    "steps in the hand's frame": "each of its poses is that in the frame of the one before",
    "tool centre": "its poses are those of the tool centre, 0.12 m ahead of the frame in use here",
    "a frame late": "its first action is the present command, not the next",
    "a frame early": "its first action is one frame too far ahead",
    "three early": "its first action is three frames too far ahead",
    "twice as fast": "each of its actions spans two recorded frames",
    "three times as fast": "each of its actions spans three recorded frames",
    "half as fast": "it gives two actions for every recorded frame",
    "measured joints": "it predicts what the robot will measure, not what it is commanded",
}
ORDER = "order"
UNDO: dict[str, dict[str, Undo]] = {
    "arms": {
        "arms swapped": _columns(
            lambda a, b: [*(c + len(b) for c in a), *(c - len(a) for c in b)],
        ),
    },
    ORDER: {
        "grippers last": _columns(
            lambda a, b: [*a[:-1], b[-2], *(c - 1 for c in b[:-1]), b[-1]], "joint"
        ),
        "grippers first": _columns(lambda a, b: [*a[1:], a[0], *b[1:], b[0]], "joint"),
        "arms interleaved": _interleaved,
        "joints reversed": _columns(lambda a, b: [*a[-2::-1], a[-1], *b[-2::-1], b[-1]], "joint"),
    },
    "units": {
        "degrees": _joints(lambda q, now: np.radians(q)),
        "millimetres": _arms(lambda arm: arm.position, lambda given, now: given / 1000.0, "ee"),
    },
    "quaternion": {
        "quaternion x y z w": _quaternions([3, 0, 1, 2]),
        "quaternion slip": _quaternions([1, 2, 3, 0]),
    },
    "grippers": {f"gripper {name}": _grippers(*ends) for name, ends in GRIPPERS.items()},
    "delta": {
        "delta from the start": _joints(lambda q, now: now + q),
        "delta from the last": _joints(lambda q, now: now + np.cumsum(q, axis=0)),
        "pose delta from the start": _differences(),
        "pose delta from the last": _differences(each=True),
        "position delta from the start": _differences(turned=False),
        "position delta from the last": _differences(each=True, turned=False),
        "pose in the hand's frame": _differences(local=True),
        "steps in the hand's frame": _differences(each=True, local=True),
    },
    "frame": {"tool centre": _given(lambda case: _moved(case, -TCP_AHEAD), "ee")},
    "time": {
        "a frame late": _later(-1),
        "a frame early": _later(1),
        "three early": _later(3),
        "twice as fast": _later(0, 2),
        "three times as fast": _later(0, 3),
        "half as fast": _slower,
    },
    "measured": {"measured joints": _measured},
}
"""By family: how each mistake is undone."""
PARTS = tuple(
    ActionFault(name, PHRASES[name], family, undo)
    for family, members in UNDO.items()
    for name, undo in members.items()
)


def fitted(cases: Sequence[AnswerSample]) -> list[ActionFault]:
    """Parts that depend on all `cases`: order and signs of an arm's joints, origin of positions."""
    space = cases[0].space
    if space.kind == "ee":
        return [_offset(cases)]
    size, other = space.joints
    if size != other:  # what the arms have in common is not fitted to arms that differ
        return []
    found = []

    def by_arm(rows: Sequence[Array]) -> Array:
        return np.concatenate(rows).reshape(-1, 2, size + 1)[:, :, :-1]

    given, recorded = by_arm([c.given for c in cases]), by_arm([c.recorded for c in cases])
    now = by_arm([np.tile(c.now, (len(c.given), 1)) for c in cases])
    cost = np.abs(given[..., None, :] - recorded[..., :, None]).mean(axis=(0, 1))
    cost += 0.002 * (1 - np.eye(size))
    rows = list(range(size))
    best = min(permutations(rows), key=lambda p: float(cost[rows, p].sum()))
    if list(best) != rows:
        listed = " ".join(str(i + 1) for i in best)
        order = [*best, size]
        found.append(
            ActionFault(
                "joint order",
                f"the joints of an arm are in another order (ours are its {listed})",
                ORDER,
                _columns(lambda a, b: [a[i] for i in order] + [b[i] for i in order], "joint"),
            )
        )
    for about, name in ((0 * now, "joint signs"), (now, "signs of motion")):
        mirrored = 2 * about - given
        better = np.abs(mirrored - recorded).mean(axis=(0, 1)) + 0.01
        flips = np.flatnonzero(better < np.abs(given - recorded).mean(axis=(0, 1)))
        if len(flips):
            found.append(_signs(name, tuple(int(i) for i in flips), size))
    return found


def _signs(name: str, flips: tuple[int, ...], size: int) -> ActionFault:
    listed = " and ".join(str(i + 1) for i in flips)
    pi = " (as if openpi's adapt_to_pi were on)" if flips == PI_SIGNS else ""
    columns = [i + arm * (size + 1) for arm in (0, 1) for i in flips]

    def changed(case: AnswerSample) -> Array:
        given = case.given.copy()
        about = case.now[columns] if name == "signs of motion" else 0.0
        given[:, columns] = 2 * about - given[:, columns]
        return given

    kind = "the motion of" if name == "signs of motion" else ""
    phrase = " ".join(f"{kind} joint {listed} of each arm has the wrong sign{pi}".split())
    return ActionFault(name, phrase, "signs", _given(changed, "joint"))


def _offset(cases: Sequence[AnswerSample]) -> ActionFault:
    gap = np.concatenate([c.given - c.recorded for c in cases])
    middle = np.median(gap, axis=0)
    shift = np.zeros_like(middle)
    for arm in cases[0].space.arms:
        shift[arm.position] = middle[arm.position]
    listed, right = (
        ", ".join(f"{v:+.2f}" for v in shift[arm.position]) for arm in cases[0].space.arms
    )
    return ActionFault(
        "another origin",
        f"its positions are off by ({listed}) m left and ({right}) m right: another origin",
        "frame",
        _given(lambda case: case.given - shift, "ee"),
    )
