"""Checklists: counting, letting go, latching, returning, bins, cycles, and the noted order."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, play, snap

from robospa.geometry import Pose, Vec3, axis_rotation
from robospa.tasks.events import outcome
from robospa.tasks.goals import counters
from robospa.tasks.goals.checklist import CHAIN, Checklist, by_turns
from robospa.tasks.goals.conditions import Container, Inside, Opened, Rests, level_with, on_spot
from robospa.tasks.snapshot import Contact, Snapshot

START: dict[str, Vec3] = {
    "can": (-0.1, -0.1, 0.74),
    "basket": (0.1, -0.2, 0.74),
    "bread": (0.2, 0.0, 0.74),
}
TIP: Vec3 = (-0.1, -0.1, 0.84)
IN_BASKET: Vec3 = (0.11, -0.19, 0.75)


# Clicks and placements


def goal() -> Checklist:
    """Click, bread into the basket, click."""
    bread = Rests("bread", level_with(0.05, 0.73, 0.80), targets=("basket",))
    counter = counters.PressCounter("can", Pose((0.0, 0.0, 0.1)), (0.03, 0.03, 0.04))
    early = by_turns(range(3))
    return Checklist([counter, bread, counter], released=True, early=early, figures=CHAIN)


def click(bread: Vec3 = START["bread"], gripper: float = 0.0) -> list[Snapshot]:
    """A touch of the can and 0.1 s after it."""
    scene = dict(START, bread=bread)
    touch = snap(0, scene, (gripper, 1.0), touched=[("can", TIP)])
    return [touch, *[snap(0, scene, (gripper, 1.0))] * 6]


def put(bread: Vec3 = IN_BASKET) -> list[Snapshot]:
    return [snap(0, dict(START, bread=bread))] * 2


def test_click_place_click_succeeds_in_the_asked_order() -> None:
    tracker = goal()
    events = play(tracker, START, *click(), *put(), *click(IN_BASKET), *put())
    assert [e.index for e in events if e.kind == "subtask_done"] == [0, 1, 2]
    assert "success" in kinds(events)
    assert tracker.diagnostics()["order_obeyed"] is True


def test_all_clicks_first_succeeds_too_but_is_noted() -> None:
    tracker = goal()
    events = play(tracker, START, *click(), *click(), *put())
    assert "success" in kinds(events)
    assert [e.index for e in events if e.kind == "wrong_order"] == [2]
    assert tracker.diagnostics()["order_obeyed"] is False


def test_success_waits_for_open_grippers_where_asked() -> None:
    steps = (START, *click(), *put(), *click(IN_BASKET))
    assert "success" not in kinds(play(goal(), *steps))
    assert kinds(play(goal(), *steps, *put()))[-1] == "success"


HELD_OVER = snap(0, dict(START, bread=(0.1, -0.2, 0.78)), (0.1, 1.0), held((0.1, -0.2, 0.80)))
OPEN_AROUND = snap(0, dict(START, bread=IN_BASKET), (1.0, 1.0), (AWAY[0], IN_BASKET))


@pytest.mark.parametrize(
    ("steps", "done", "best"),
    [
        ([HELD_OVER] * 3, 0, 0),
        (put((0.1, -0.2, 0.82)), 0, 0),  # above the rim
        (put() + put(START["bread"]), 0, 1),  # taken out again
        (click() + put() + put(START["bread"]), 1, 2),  # clicks stay done
        (click() * 3, 2, 2),  # one too many
        ([OPEN_AROUND], 1, 1),
    ],
)
def test_what_counts_and_what_stays(steps: list[Snapshot], done: int, best: int) -> None:
    result = outcome(play(goal(), START, *steps), 3)
    assert (result.done, result.best) == (done, best)


def test_a_count_too_many_is_reported() -> None:
    assert kinds(play(goal(), START, *click(), *click(), *click())).count("repeated") == 1


CUP: dict[str, Vec3] = {"cup": (0.2, 0.0, 0.74), "mat": (0.0, 0.0, 0.74)}
ON_MAT: Vec3 = (0.01, 0.0, 0.745)
NEAR = on_spot(0.035, -0.01, 0.01, Pose(), Pose((0.0, 0.0, 0.005)))


def cup(at: Vec3) -> dict[str, Vec3]:
    return dict(CUP, cup=at)


def test_a_placement_counts_once_it_is_let_go() -> None:
    holding = snap(0, cup(ON_MAT), (0.1, 1.0), held(ON_MAT))
    for after, success in (([], False), ([cup(ON_MAT)], True)):
        rests = Rests("cup", NEAR, targets=("mat",))
        assert ("success" in kinds(play(Checklist([rests]), CUP, holding, *after))) is success


@pytest.mark.parametrize(("latched", "done"), [(True, 1), (False, 0)])
def test_a_latched_placement_stays_and_another_does_not(latched: bool, done: int) -> None:
    rests = Rests("cup", NEAR, targets=("mat",), latched=latched)
    tracker = Checklist([rests, counters.PressCounter("mat", Pose())])
    assert outcome(play(tracker, CUP, cup(ON_MAT), cup((0.3, 0.0, 0.74))), 2).done == done


def test_coming_back_counts_only_after_having_been_away() -> None:
    def home(pose: Pose, start: Pose) -> bool:
        return abs(pose.position[0] - start.position[0]) < 0.04

    for steps, success in (((CUP, CUP, CUP), False), ((CUP, cup(ON_MAT), CUP), True)):
        away = Rests("cup", NEAR, targets=("mat",), latched=True)
        tracker = Checklist([away, Rests("cup", home, after=0)])
        assert ("success" in kinds(play(tracker, *steps))) is success


def test_two_of_one_turn_may_be_done_in_any_order() -> None:
    scene: dict[str, Vec3] = {"a": (0.2, 0.0, 0.74), "b": (0.3, 0.0, 0.74), "mat": (0.0, 0.0, 0.74)}
    steps = (scene, dict(scene, b=ON_MAT), dict(scene, a=ON_MAT, b=ON_MAT))
    for turns, noted in (([0, 1], True), ([0, 0], False)):
        rest = [Rests(name, NEAR, targets=("mat",)) for name in ("a", "b")]
        events = play(Checklist(rest, early=by_turns(turns)), *steps)
        assert ("wrong_order" in kinds(events)) is noted


def test_what_flies_past_the_bin_does_not_count_until_it_is_slow() -> None:
    box = Container(Pose((0.0, 0.0, 0.0)), (0.2, 0.2), 0.6)
    flight = [{"ball": (0.0, 0.0, z), "bin": (0.0, 0.0, 0.0)} for z in (0.8, 0.5, 0.3, 0.3)]
    events = play(Checklist([Inside("ball", box, targets=("bin",))]), *flight)
    (done,) = [e for e in events if e.kind == "subtask_done"]
    assert done.time == 3 * TICK


def test_a_tool_belongs_to_the_subtask_it_is_used_for() -> None:
    tracker = Checklist([Rests("cup", NEAR, targets=("mat",))], tools={"spoon": 0})
    assert tracker.roles["spoon"].subtasks == (0,) and tracker.roles["mat"].subtasks == ()


def test_a_door_counts_from_its_angle_on_and_not_when_it_closes_again() -> None:
    door = Opened("oven", 0.9)
    at = [replace(snap(0, {}), hinges={"oven": a}) for a in (0.0, 0.89, 0.9, 1.2, 0.5)]
    assert [door.holds(s, False) for s in at] == [False, False, True, True, False]


# Presses

AT: dict[str, Vec3] = {"s": (0.1, 0.0, 0.74)}
FRAME = Pose((0.0, 0.02, 0.05))
PRESSED: Vec3 = (0.1, 0.02, 0.79)


def presses(times: int) -> Checklist:
    return Checklist([counters.PressCounter("s", FRAME)] * times, figures=counters.FIGURES)


def touches(pattern: str, point: Vec3 = PRESSED) -> list[Snapshot]:
    """One snapshot a character: "x" touches, "n" comes near, anything else does neither."""
    contacts = {
        "x": (Contact("left_gripper", "s", point),),
        "n": (Contact("left_gripper", "s", point, touching=False),),
    }
    return [replace(snap(0, AT), contacts=contacts.get(mark, ())) for mark in pattern]


@pytest.mark.parametrize(
    ("pattern", "times", "found"),
    [
        ("..x", 1, ["subtask_done", "success"]),
        (".x....x", 2, ["subtask_done", "subtask_done", "success"]),  # 0.1 s rearms
        ("." + "x" * 100, 2, ["subtask_done"]),
        ("xxx", 1, []),  # touched from the start
    ],
)
def test_a_press_counts_when_the_touch_begins(pattern: str, times: int, found: list[str]) -> None:
    assert kinds(play(presses(times), *touches(pattern))) == found


def test_separate_presses_are_separate_subtasks() -> None:
    events = play(presses(3), *touches("." + "xx......" * 3))
    assert [e.index for e in events if e.kind == "subtask_done"] == [0, 1, 2]


@pytest.mark.parametrize("gap", [1, 2, 3])
def test_chatter_shorter_than_the_rearm_time_counts_once(gap: int) -> None:
    tracker = presses(2)
    assert kinds(play(tracker, *touches("." + ("x" + "." * gap) * 6))) == ["subtask_done"]
    figures = {"presses": 1, "touched": 1, "raw_presses": 6}
    assert tracker.diagnostics() == {"idle_progress": 0.0, **figures}


@pytest.mark.parametrize(
    ("hand", "count"),
    [("oooocccc", 1), ("cccooooooccc", 1), ("cooooocooooocoooooc", 1), ("oooooooo", 0)],
)
def test_a_gripper_that_opens_on_the_object_has_not_left_it(hand: str, count: int) -> None:
    counter = counters.PressCounter("s", FRAME, arm=0)
    counter.start(snap(0, AT, (0.0, 1.0)))
    for i, mark in enumerate(hand, 1):
        gripper = (0.0 if mark == "c" else 1.0, 1.0)
        counter.update(snap(i * TICK, AT, gripper, touched=[("s", PRESSED)]))
    assert counter.count == count


@pytest.mark.parametrize("offset", [(0.031, 0, 0), (0, -0.031, 0), (0, 0, 0.031)])
def test_a_touch_outside_the_box_is_not_a_press(offset: Vec3) -> None:
    point = (PRESSED[0] + offset[0], PRESSED[1] + offset[1], PRESSED[2] + offset[2])
    assert play(presses(1), *touches("..x", point)) == []


@pytest.mark.parametrize("body", ["left_arm", "table", "object_3"])
def test_only_grippers_press(body: str) -> None:
    other = replace(snap(0, AT), contacts=(Contact(body, "s", PRESSED),))
    assert play(presses(1), AT, other) == []


def test_a_reported_contact_presses_and_only_one_with_an_impulse_touches() -> None:
    tracker = presses(2)
    assert kinds(play(tracker, *touches(".n......x")))[-1] == "success"
    found = tracker.diagnostics()
    assert (found["presses"], found["touched"]) == (2, 1)


# Stamps


def stamps(*heights: float) -> counters.StampCounter:
    counter = counters.StampCounter("seal", "pad")
    snapshots = [
        snap(i * TICK, {"seal": (0.1 if z > 0.1 else 0.0, 0.0, 0.74 + z), "pad": (0.0, 0.0, 0.74)})
        for i, z in enumerate(heights)
    ]
    counter.start(snapshots[0])
    for snapshot in snapshots[1:]:
        counter.update(snapshot)
    return counter


@pytest.mark.parametrize(
    ("heights", "count", "raw"),
    [
        ((0.2, 0.03, 0.001, 0.001, 0.03, 0.001), 2, 2),
        ((0.2, 0.009, 0.011, 0.009), 1, 2),  # a bounce counts twice officially
        ((0.0, 0.0, 0.0), 0, 0),
    ],
)
def test_stamps_come_down_and_need_two_centimetres_between(
    heights: tuple[float, ...], count: int, raw: int
) -> None:
    counter = stamps(*heights)
    assert (counter.count, counter.raw_count) == (count, raw)


def test_a_stamp_too_many_is_repeated_and_carried_things_are_not_pressed() -> None:
    tracker = Checklist([counters.StampCounter("cup", "mat")])
    assert not tracker.roles["cup"].pressed and not tracker.needs_contacts
    up, down = cup((0.0, 0.0, 0.78)), cup((0.0, 0.0, 0.74))
    assert kinds(play(tracker, up, down, up, down)).count("repeated") == 1


# Lifting and putting back

HOME: Vec3 = (0.0, -0.1, 0.74)
HANDLES: tuple[Vec3, Vec3] = ((-0.1, 0.0, 0.05), (0.1, 0.0, 0.05))


def fan(times: int) -> Checklist:
    counter = counters.CycleCounter(
        "f", counters.raised("f", 0.05), counters.back_home("f", 0.04, 0.05)
    )
    return Checklist([counter] * times, radius=counter.radius, figures=("lifts", "released"))


def at(rise: float, aside: float = 0.0) -> dict[str, Vec3]:
    return {"f": (HOME[0] + aside, HOME[1], HOME[2] + rise)}


@pytest.mark.parametrize(
    ("times", "rises", "found"),
    [
        (1, (0.06, 0.02), ["subtask_done", "success"]),
        (3, (0.06, 0.0) * 3, ["subtask_done"] * 3 + ["success"]),
        (2, (0.06, 0.045, 0.06, 0.045, 0.0), ["subtask_done"]),  # trembling is one lift
        *((1, rises, []) for rises in ((0.06,), (0.0,), (0.045, 0.0), (0.06, 0.045))),
    ],
)
def test_a_cycle_counts_when_the_object_is_back(
    times: int, rises: tuple[float, ...], found: list[str]
) -> None:
    assert kinds(play(fan(times), at(0.0), *map(at, rises))) == found


def test_a_place_beside_home_is_not_home() -> None:
    assert play(fan(1), at(0.0), at(0.06), at(0.0, aside=0.05)) == []


@pytest.mark.parametrize(("angle", "home"), [(0.09, True), (0.11, False), (2 * math.pi, True)])
def test_home_asks_for_the_first_turn(angle: float, home: bool) -> None:
    turned = Pose(HOME, axis_rotation((0, 0, 1), angle))
    snapshot = replace(snap(0.0, {}), poses={"f": turned})
    assert counters.back_home("f", 0.04, 0.05)(snapshot, Pose(HOME)) is home


def hanging(rise: float, slip: float = 0.0, lean: float = 0.0) -> Snapshot:
    """A pot with a gripper at either handle, the right one `slip` [m] off, leaning by `lean`."""
    pose = Pose((HOME[0], HOME[1], HOME[2] + rise), axis_rotation((1, 0, 0), lean))
    (lx, ly, lz), (rx, ry, rz) = (pose.apply(h) for h in HANDLES)
    grasped = snap(0.0, {}, (0.1, 0.1), ((lx, ly, lz), (rx + slip, ry, rz)))
    return replace(grasped, poses={"p": pose})


@pytest.mark.parametrize(
    ("snapshot", "up", "down"),
    [
        (hanging(0.09), True, False),
        (hanging(0.07), False, False),
        (hanging(0.09, slip=0.029), True, False),
        (hanging(0.09, slip=0.031), False, False),
        (hanging(0.09, lean=0.7), False, False),
        (hanging(0.0), False, True),
        (hanging(0.069), False, True),
        (hanging(0.071), False, False),
        (hanging(0.0, lean=0.7), False, False),
        (snap(0.0, {"p": (0.081, HOME[1], HOME[2])}), False, False),
    ],
)
def test_a_pot_hangs_upright_on_both_handles_and_comes_down_upright(
    snapshot: Snapshot, up: bool, down: bool
) -> None:
    assert counters.held_up("p", 0.82, HANDLES)(snapshot, Pose(HOME)) is up
    assert counters.put_down("p", (-0.03, 0.07), 0.08)(snapshot, Pose(HOME)) is down


def test_lowering_without_letting_go_counts_and_is_told_apart() -> None:
    tracker = fan(2)
    holding = [
        snap(0, at(rise), (0.1, 1.0), held((HOME[0], HOME[1], HOME[2] + rise + 0.1)))
        for rise in (0.0, 0.06, 0.0, 0.06, 0.0)
    ]
    assert "success" in kinds(play(tracker, *holding))
    assert (tracker.diagnostics()["lifts"], tracker.diagnostics()["released"]) == (2, 0)
    tracker = fan(2)
    play(tracker, *map(at, (0.0, 0.06, 0.0, 0.0, 0.06, 0.0)))
    assert tracker.diagnostics()["released"] == 1
