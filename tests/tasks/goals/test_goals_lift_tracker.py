"""Who carried what, and what fell: the events behind the failure analysis."""

from __future__ import annotations

from collections.abc import Iterable

from snapshots_by_hand import AWAY, TICK, held, kinds, snap

from robospa.geometry import Vec3
from robospa.tasks.events import Event
from robospa.tasks.goals.lift_tracker import LiftTracker

Step = tuple[float, float, float | None]
REST: Vec3 = (0.0, 0.0, 0.74)


def play(steps: Iterable[Step]) -> list[Event]:
    """Steps are (object height, gripper opening, grasp height above the object or None)."""
    handling = LiftTracker(["o"])
    handling.start(snap(0, {"o": REST}))
    events: list[Event] = []
    for i, (z, opening, above) in enumerate(steps, 1):
        grasp = AWAY if above is None else held((0.0, 0.0, z + above))
        events += handling.update(snap(i * TICK, {"o": (0, 0, z)}, (opening, 1), grasp))
    return events


def lift(to: float = 0.84) -> list[Step]:
    return [(0.74 + (to - 0.74) * i / 10, 0.2, 0.02) for i in range(11)]


def test_lifting_is_reported_once() -> None:
    assert kinds(play(lift())) == ["grasped"]


def test_rising_without_a_gripper_is_not_a_grasp() -> None:
    assert play([(0.74 + 0.01 * i, 1.0, None) for i in range(10)]) == []


def test_an_open_gripper_holds_nothing() -> None:
    assert play([(z, 0.9, above) for z, _, above in lift()]) == []


def test_lowering_fast_in_the_gripper_is_not_a_drop() -> None:
    down: list[Step] = [(0.84 - 0.02 * i, 0.2, 0.02) for i in range(1, 5)]
    assert kinds(play(lift() + down)) == ["grasped"]


def test_slipping_out_and_falling_is() -> None:
    fall: list[Step] = [
        (0.84 - d, 0.2, 0.02 + d) for d in (0.002, 0.008, 0.018, 0.035, 0.06, 0.1, 0.1)
    ]
    assert kinds(play(lift() + fall)) == ["grasped", "dropped"]


def test_letting_go_high_above_the_table_is_a_drop() -> None:
    fall: list[Step] = [
        (0.84 - d, 1.0, 0.02 + d) for d in (0.002, 0.008, 0.018, 0.035, 0.06, 0.1, 0.1)
    ]
    assert kinds(play(lift() + fall)) == ["grasped", "dropped"]


def test_setting_down_and_lifting_again_is_a_second_grasp() -> None:
    down: list[Step] = [(0.84 - 0.01 * i, 0.2, 0.02) for i in range(1, 11)]
    rest: list[Step] = [(0.74, 1.0, None)] * 15
    assert kinds(play(lift() + down + rest + lift())) == ["grasped", "grasped"]
