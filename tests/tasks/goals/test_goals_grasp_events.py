"""What the grippers try, from snapshots written by hand."""

from __future__ import annotations

from collections.abc import Iterable

from snapshots_by_hand import AWAY, TICK, kinds, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.grasp_events import BESIDE, TOUCHING, GraspMonitor
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Contact

CUBE = {"half": [0.02, 0.02, 0.02], "color": [1, 0, 0]}
AT: dict[str, Vec3] = {"a": (0.0, 0.0, 0.76), "b": (0.2, 0.0, 0.76)}
SCENE = Scene(
    "Fake", 1, 1, "aloha-agilex", "clean",
    tuple(SceneObject(name, "block", Pose(at), CUBE) for name, at in AT.items()), {},
)  # fmt: skip
ROLES = {"a": ObjectRole((0,)), "b": ObjectRole()}


class Play:
    """GraspMonitor over time: grippers, where the left one is, and what it touches."""

    def __init__(self, roles: dict[str, ObjectRole] = ROLES) -> None:
        self.touched: tuple[str, ...] = ()
        self.asked = 0
        self.hands = GraspMonitor(roles, SCENE, self._contacts)
        self.time = 0.0

    def _contacts(self) -> tuple[Contact, ...]:
        self.asked += 1
        return tuple(Contact("left_gripper", name, (0, 0, 0)) for name in self.touched)

    def go(
        self, seconds: float, at: Vec3, gripper: float, touched: Iterable[str] = ()
    ) -> list[Event]:
        self.touched = tuple(touched)
        found: list[Event] = []
        for _ in range(round(seconds / TICK)):
            self.time += TICK
            found += self.hands.update(snap(self.time, AT, (gripper, 1.0), (at, AWAY[1])))
        return found


def closings(events: Iterable[Event]) -> list[tuple[str, int, str]]:
    return [(e.object, e.index, e.note) for e in events if e.kind == "closed"]


def test_a_touch_while_closing_names_the_touched_object() -> None:
    play = Play()
    play.go(1, AT["a"], 1.0)
    assert closings(play.go(1, AT["a"], 0.0, ["a"])) == [("a", 0, TOUCHING)]


def test_an_object_that_is_not_asked_for_has_no_subtask() -> None:
    assert closings(Play().go(1, AT["b"], 0.0, ["b"])) == [("b", -1, TOUCHING)]


def test_closing_beside_an_object_names_the_nearest() -> None:
    assert closings(Play().go(1, (0.08, 0.0, 0.76), 0.0)) == [("a", 0, BESIDE)]


def test_closing_far_from_everything_is_no_try() -> None:
    assert not closings(Play().go(1, (0.0, 0.0, 1.2), 0.0))


def test_a_gripper_that_stays_closed_closes_once() -> None:
    assert len(closings(Play().go(5, AT["a"], 0.0, ["a"]))) == 1


def test_closing_again_takes_opening_first() -> None:
    play = Play()
    first = play.go(1, AT["a"], 0.0) + play.go(1, AT["a"], 0.25) + play.go(1, AT["a"], 0.0)
    assert len(closings(first)) == 1
    assert len(closings(play.go(0.5, AT["a"], 0.9) + play.go(1, AT["a"], 0.0))) == 1


def test_narrowing_an_open_gripper_is_no_closing() -> None:
    assert not closings(Play().go(2, AT["a"], 0.5, ["a"]))


def test_closing_near_what_is_pressed_is_no_grasp() -> None:
    assert not closings(Play({"a": ObjectRole((0, 1), pressed=True)}).go(2, AT["a"], 0.0, ["a"]))


def test_contacts_are_asked_for_only_while_closing() -> None:
    play = Play()
    play.go(3, AT["a"], 1.0)
    assert play.asked == 0
    play.go(5, AT["a"], 0.0)
    assert 0 < play.asked < 10


def test_the_end_of_the_trial_keeps_a_touch_but_no_miss() -> None:
    touching, missing = Play(), Play()
    touching.go(0.2, AT["a"], 0.0, ["a"])
    missing.go(0.2, AT["a"], 0.0)
    assert closings(touching.hands.finish(0.2)) == [("a", 0, TOUCHING)]
    assert missing.hands.finish(0.2) == ()


def test_an_approach_counts_once_until_the_gripper_left() -> None:
    play = Play()
    there, away = (0.0, 0.0, 0.8), (0.0, 0.0, 1.1)
    assert kinds(play.go(1, there, 1.0)) == ["approached"]
    assert kinds(play.go(1, there, 1.0)) == []
    assert kinds(play.go(1, away, 1.0) + play.go(1, there, 1.0)) == ["approached"]


def test_an_object_that_does_not_exist_yet_is_not_approached() -> None:
    hands = GraspMonitor({"a": ObjectRole((0,))}, SCENE, lambda: ())
    assert hands.update(snap(1.0, {}, (0.0, 0.0), (AT["a"], AWAY[1]))) == ()
