"""What the failure analysis is told: grasp attempts, lifts and drops, clutter that was moved."""

from collections.abc import Iterable, Mapping

import pytest
from drawn_scenes import each_task
from snapshots_by_hand import AWAY, TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.descriptions import describe_objects
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.goals.lifting import Lift, LiftTracker, PickTracker
from robospa.tasks.goals.monitors import BESIDE, TOUCHING, ClutterMonitor, GraspMonitor
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Contact, Snapshot

CUBE = {"half": [0.02, 0.02, 0.02], "color": [1, 0, 0]}
AT: dict[str, Vec3] = {"a": (0.0, 0.0, 0.76), "b": (0.2, 0.0, 0.76)}
SCENE = Scene(
    "Fake", 1, 1, "aloha-agilex", "clean",
    tuple(SceneObject(name, "block", Pose(at), CUBE) for name, at in AT.items()), {},
)  # fmt: skip
ROLES = {"a": ObjectRole((0,)), "b": ObjectRole()}


class Grippers:
    """GraspMonitor over time: grippers, where the left one is, and what it touches."""

    def __init__(self, roles: dict[str, ObjectRole] = ROLES) -> None:
        self.touched: tuple[str, ...] = ()
        self.asked = 0
        self.monitor = GraspMonitor(roles, SCENE, self._contacts)
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
            found += self.monitor.update(snap(self.time, AT, (gripper, 1.0), (at, AWAY[1])))
        return found


def closings(events: Iterable[Event]) -> list[tuple[str, int, str]]:
    return [(e.object, e.index, e.note) for e in events if e.kind == "closed"]


@pytest.mark.parametrize(
    ("seconds", "at", "gripper", "touched", "found"),
    [
        (1, AT["a"], 0.0, "a", [("a", 0, TOUCHING)]),
        (1, AT["b"], 0.0, "b", [("b", -1, TOUCHING)]),  # not asked for: no subtask
        (1, (0.08, 0.0, 0.76), 0.0, "", [("a", 0, BESIDE)]),  # the nearest
        (1, (0.0, 0.0, 1.2), 0.0, "", []),  # far from everything
        (5, AT["a"], 0.0, "a", [("a", 0, TOUCHING)]),  # stays closed: closes once
        (2, AT["a"], 0.5, "a", []),  # narrowing is no closing
    ],
)
def test_where_a_gripper_closes(
    seconds: float, at: Vec3, gripper: float, touched: str, found: list[tuple[str, int, str]]
) -> None:
    assert closings(Grippers().go(seconds, at, gripper, touched)) == found


def test_closing_near_what_is_pressed_is_no_grasp() -> None:
    pressed = Grippers({"a": ObjectRole((0, 1), pressed=True)})
    assert not closings(pressed.go(2, AT["a"], 0.0, ["a"]))


def test_contacts_are_asked_for_only_while_closing() -> None:
    grippers = Grippers()
    grippers.go(3, AT["a"], 1.0)
    assert grippers.asked == 0
    grippers.go(5, AT["a"], 0.0)
    assert 0 < grippers.asked < 10


def test_the_end_of_the_trial_keeps_a_touch_but_no_miss() -> None:
    touching, missing = Grippers(), Grippers()
    touching.go(0.2, AT["a"], 0.0, ["a"])
    missing.go(0.2, AT["a"], 0.0)
    assert closings(touching.monitor.finish(0.2)) == [("a", 0, TOUCHING)]
    assert missing.monitor.finish(0.2) == ()


def test_an_approach_counts_once_until_the_gripper_left() -> None:
    grippers = Grippers()
    there, away = (0.0, 0.0, 0.8), (0.0, 0.0, 1.1)
    assert kinds(grippers.go(1, there, 1.0)) == ["approached"]
    assert kinds(grippers.go(1, there, 1.0)) == []
    assert kinds(grippers.go(1, away, 1.0) + grippers.go(1, there, 1.0)) == ["approached"]


def test_an_object_that_does_not_exist_yet_is_not_approached() -> None:
    monitor = GraspMonitor({"a": ObjectRole((0,))}, SCENE, lambda: ())
    assert monitor.update(snap(1.0, {}, (0.0, 0.0), (AT["a"], AWAY[1]))) == ()


# Lifts and drops: steps are (object height, gripper opening, grasp height above it or None)

Step = tuple[float, float, float | None]
LIFT: list[Step] = [(0.74 + 0.01 * i, 0.2, 0.02) for i in range(11)]
FALL = (0.002, 0.008, 0.018, 0.035, 0.06, 0.1, 0.1)
DOWN: list[Step] = [(0.84 - 0.01 * i, 0.2, 0.02) for i in range(1, 11)]


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        (LIFT, ["grasped"]),
        ([(0.74 + 0.01 * i, 1.0, None) for i in range(10)], []),  # no gripper
        ([(z, 0.9, above) for z, _, above in LIFT], []),  # an open one holds nothing
        (LIFT + [(0.84 - 0.02 * i, 0.2, 0.02) for i in range(1, 5)], ["grasped"]),  # lowered fast
        (LIFT + [(0.84 - d, 0.2, 0.02 + d) for d in FALL], ["grasped", "dropped"]),  # slips out
        (LIFT + [(0.84 - d, 1.0, 0.02 + d) for d in FALL], ["grasped", "dropped"]),  # let go high
        (LIFT + DOWN + [(0.74, 1.0, None)] * 15 + LIFT, ["grasped", "grasped"]),
    ],
)
def test_lifts_and_drops(steps: list[Step], found: list[str]) -> None:
    tracker = LiftTracker(["o"])
    tracker.start(snap(0, {"o": (0.0, 0.0, 0.74)}))
    events: list[Event] = []
    for i, (z, opening, above) in enumerate(steps, 1):
        grasp = AWAY if above is None else held((0.0, 0.0, z + above))
        events += tracker.update(snap(i * TICK, {"o": (0, 0, z)}, (opening, 1), grasp))
    assert kinds(events) == found


# Clutter

CLUTTER = tuple(SceneObject(f"clutter_{i}", "apple", Pose()) for i in range(2))
LYING: dict[str, Vec3] = {"clutter_0": (0.1, 0.2, 0.74), "clutter_1": (0.3, 0.1, 0.74)}


def test_a_thing_that_was_moved_is_an_event_once_and_seen_ten_times_a_second() -> None:
    monitor = ClutterMonitor(CLUTTER, snap(0.0, LYING))
    pushed = LYING | {"clutter_1": (0.306, 0.1, 0.74)}
    assert monitor.update(snap(0.02, LYING | {"clutter_1": (0.304, 0.1, 0.74)})) == ()
    assert monitor.update(snap(0.04, pushed)) == ()
    (event,) = monitor.update(snap(0.12, pushed))
    assert (event.time, event.kind, event.object) == (0.12, "clutter_moved", "clutter_1")
    assert monitor.update(snap(0.22, pushed)) == ()
    assert monitor.diagnostics() == {"clutter": 2, "clutter_moved": ["clutter_1"]}


@each_task
def test_no_goal_knows_of_clutter(name: str) -> None:
    scenes = (build_scene(name, 1, seed, mode="randomized:clutter") for seed in range(3, 9))
    scene = next(scene for scene in scenes if scene.clutter)  # one in fifty has none
    assert not set(task(name).goal(scene).roles) & {item.name for item in scene.clutter}


def test_clutter_is_called_so() -> None:
    scene = build_scene("Pick_Blocks_Size", 3, 3, mode="randomized:clutter")
    found = describe_objects(scene)
    assert all(found[item.name].endswith(" (clutter)") for item in scene.clutter)
    plain = describe_objects(build_scene("Pick_Blocks_Size", 3, 3))
    assert {o.name: found[o.name] for o in scene.objects} == plain


NAMES = ("object_0", "object_1", "object_2")
LOW: Mapping[str, Vec3] = {n: (0.2 * i - 0.2, 0.0, 0.76) for i, n in enumerate(NAMES)}
PICKED = ["grasped", "subtask_done", "success"]
HIGH = Lift(above=0.82)


def raised(name: str = "object_0", time: float = 0.02) -> Snapshot:
    """`name` lifted by 0.1 m, between the left arm's fingers."""
    x, y, z = LOW[name]
    point = (x, y, z + 0.1)
    return snap(time, {**LOW, name: point}, (0.0, 1.0), held(point))


def tracker() -> PickTracker:
    return PickTracker("object_0", NAMES, HIGH)


def test_nothing_after_success_and_a_second_start_forgets_the_first() -> None:
    track = tracker()
    events = run(track, [snap(0, LOW), raised()])
    assert kinds(events) == PICKED and events[1].index == 0
    assert track.update(raised("object_1", time=0.04)) == ()
    assert kinds(run(track, [snap(0, LOW), raised()])) == PICKED


def test_a_wrong_object_is_reported_once_a_lift_and_spoils_nothing() -> None:
    snapshots = [snap(0, LOW), raised("object_1"), raised("object_1", time=0.04)]
    snapshots += [snap(0.06, LOW), raised("object_1", time=0.08)]
    events = run(tracker(), snapshots)
    assert [e.object for e in events if e.kind == "wrong_object"] == ["object_1"] * 2
    assert "success" not in kinds(events)
    assert kinds(run(tracker(), [*snapshots, raised(time=0.1)]))[-1] == "success"


@pytest.mark.parametrize(
    ("target", "lift", "word"),
    [("object_9", HIGH, "object_9"), ("object_0", Lift(closed=True), "height test")],
)
def test_nonsense_is_refused(target: str, lift: Lift, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        PickTracker(target, NAMES, lift)


def test_a_tall_target_is_carried_by_its_middle() -> None:
    """A gripper 0.16 m over the origin carries what is 0.155 m tall, and no flat thing."""
    x, y, z = LOW["object_0"]
    up = {**LOW, "object_0": (x, y, z + 0.1)}
    lifted = snap(0.02, up, (0.0, 1.0), held((x, y, z + 0.26)))
    tall = PickTracker("object_0", NAMES, HIGH, {"object_0": (0.0, 0.0, 0.0775)})
    assert kinds(run(tall, [snap(0, LOW), lifted])) == PICKED
    assert kinds(run(tracker(), [snap(0, LOW), lifted])) == []
