"""Checklists: counting, letting go, latching, returning, bins, cycles, and the noted order."""

from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, play, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import outcome
from robospa.tasks.goals import counters, memory
from robospa.tasks.goals.checklist import (
    CHAIN,
    Checklist,
    ClickInOrder,
    PressCounts,
    by_turns,
)
from robospa.tasks.goals.conditions import Container, Inside, Region, Rests, level_with, on_spot
from robospa.tasks.goals.counters import PressCounter
from robospa.tasks.goals.placing import collect, gather, nest, row, stack
from robospa.tasks.snapshot import Snapshot

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


def click() -> list[Snapshot]:
    """A touch of the can and 0.1 s after it."""
    touch = snap(0, START, (0.0, 1.0), touched=[("can", TIP)])
    return [touch, *[snap(0, START, (0.0, 1.0))] * 6]


def test_all_clicks_first_succeeds_too_but_is_noted() -> None:
    tracker = goal()
    put = dict(START, bread=IN_BASKET)
    events = play(tracker, START, *click(), *click(), put, put)
    assert "success" in kinds(events)
    assert [e.index for e in events if e.kind == "wrong_order"] == [2]
    assert tracker.diagnostics()["order_obeyed"] is False


CUP: dict[str, Vec3] = {"cup": (0.2, 0.0, 0.74), "mat": (0.0, 0.0, 0.74)}
ON_MAT: Vec3 = (0.01, 0.0, 0.745)
NEAR = on_spot(0.035, -0.01, 0.01, Pose(), Pose((0.0, 0.0, 0.005)))


def cup(at: Vec3) -> dict[str, Vec3]:
    return dict(CUP, cup=at)


@pytest.mark.parametrize(("latched", "done"), [(True, 1), (False, 0)])
def test_a_latched_placement_stays_and_another_does_not(latched: bool, done: int) -> None:
    rests = Rests("cup", NEAR, targets=("mat",), latched=latched)
    tracker = Checklist([rests, counters.PressCounter("mat", Pose())])
    assert outcome(play(tracker, CUP, cup(ON_MAT), cup((0.3, 0.0, 0.74))), 2).done == done


def test_what_flies_past_the_bin_does_not_count_until_it_is_slow() -> None:
    box = Container(Pose((0.0, 0.0, 0.0)), (0.2, 0.2), 0.6)
    flight = [{"ball": (0.0, 0.0, z), "bin": (0.0, 0.0, 0.0)} for z in (0.8, 0.5, 0.3, 0.3)]
    events = play(Checklist([Inside("ball", box, targets=("bin",))]), *flight)
    (done,) = [e for e in events if e.kind == "subtask_done"]
    assert done.time == 3 * TICK


# Presses

AT: dict[str, Vec3] = {"s": (0.1, 0.0, 0.74)}
FRAME = Pose((0.0, 0.02, 0.05))
PRESSED: Vec3 = (0.1, 0.02, 0.79)


def presses(times: int) -> Checklist:
    return Checklist([counters.PressCounter("s", FRAME)] * times, figures=counters.FIGURES)


def touches(pattern: str) -> list[Snapshot]:
    """One snapshot a character, of which "x" touches."""
    return [snap(0, AT, touched=[("s", PRESSED)] * (mark == "x")) for mark in pattern]


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


@pytest.mark.parametrize("gap", [1, 2, 3])
def test_chatter_shorter_than_the_rearm_time_counts_once(gap: int) -> None:
    tracker = presses(2)
    assert kinds(play(tracker, *touches("." + ("x" + "." * gap) * 6))) == ["subtask_done"]
    figures = {"presses": 1, "touched": 1, "raw_presses": 6}
    assert tracker.diagnostics() == {"idle_progress": 0.0, **figures}


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


def fan(times: int) -> Checklist:
    counter = counters.CycleCounter(
        "f", counters.raised("f", 0.05), counters.back_home("f", 0.04, 0.05)
    )
    return Checklist([counter] * times, radius=counter.radius, figures=("lifts", "released"))


def at(rise: float) -> dict[str, Vec3]:
    return {"f": (HOME[0], HOME[1], HOME[2] + rise)}


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


# ----------- placing, clicking and remembering: what the cases of `test_outcomes` do not tell apart


Places = dict[str, Vec3]


# A container

BIN = Container(Pose((-0.45, 0.0, 0.0)), (0.15, 0.15), 0.6)
TABLE: Places = {"p": (0.0, 0.1, 0.74), "q": (0.2, 0.1, 0.74)}


def carried(p: Vec3, opening: float) -> Snapshot:
    return snap(0, dict(TABLE, p=p), (opening, 1), held((p[0], p[1], 0.95)))


def test_a_bottle_let_go_over_the_bin_is_not_a_drop_and_over_the_table_it_is() -> None:
    up = [carried((0.0, 0.1, 0.74), 0.1), carried((0.0, 0.1, 0.85), 0.1)]
    over = [carried((-0.45, 0.0, 0.85), 0.1), *(carried((-0.45, 0.0, z), 1.0) for z in (0.8, 0.7))]
    assert kinds(play(collect(["p", "q"], BIN, 0.64), *up, *over)) == ["grasped"]
    tracker = collect(["p", "q"], BIN, 0.64)
    assert kinds(play(tracker, *up, carried((0.0, 0.1, 0.81), 0.1))) == ["grasped", "dropped"]
    assert tracker.diagnostics()["drops"] == 1


def test_walls_turn_with_the_container() -> None:
    turned = Container(Pose((0.0, 0.0, 0.0), (0.7071068, 0.0, 0.0, 0.7071068)), (0.1, 0.3), 0.5)
    assert turned.inside((0.25, 0.0, 0.1)) and not turned.inside((0.0, 0.25, 0.1))


# Rows

MIXED: Places = {"a": (0.2, 0.0, 0.76), "b": (0.0, -0.05, 0.76), "c": (-0.2, 0.04, 0.76)}


def test_pairs_in_place_by_chance_count_and_are_told_apart() -> None:
    for a, idle, chance in ((MIXED["a"], 1 / 3, 0), ((-0.1, -0.04, 0.76), 2 / 3, 1)):
        tracker = row("abc", True)
        play(tracker, {**MIXED, "a": a}, {**MIXED, "a": a})
        found = tracker.diagnostics()
        assert found["idle_progress"] == pytest.approx(idle) and found["chance_pairs"] == chance


def test_every_part_has_its_pairs() -> None:
    roles = row("abc", True).roles
    assert [roles[name].subtasks for name in "abc"] == [(1,), (1, 2), (2,)]


# Towers and vessels

H = 0.036
GROUND: Places = {"a": (0.0, -0.13, 0.758), "b": (0.2, 0.0, 0.758), "c": (-0.2, 0.0, 0.758)}
TOWER: Places = {name: (0.0, -0.13, 0.758 + i * H) for i, name in enumerate("abc")}
BOWLS: Places = {
    "p": (0.1, -0.12, 0.74),
    "a": (0.2, 0.1, 0.74),
    "b": (-0.2, 0.1, 0.74),
    "c": (-0.2, -0.03, 0.74),
}


def nested(*names: str) -> Places:
    """`BOWLS` with `names` nested on the plate."""
    return BOWLS | {name: (0.1, -0.12, 0.745 + 0.02 * i) for i, name in enumerate(names)}


def test_bowls_count_after_release_and_success_waits_for_open_grippers() -> None:
    holding = snap(0, nested("a"), (0.1, 1), held((0.15, -0.12, 0.78)))
    assert outcome(play(nest("abc", "p"), BOWLS, holding), 3).done == 0
    assert outcome(play(nest("abc", "p"), BOWLS, holding, nested("a")), 3).done == 1
    for make, start, scene in (
        (lambda: nest("abc", "p"), BOWLS, nested("a", "b", "c")),
        (lambda: stack("abc", [H] * 3), GROUND, TOWER),
    ):
        closed = snap(0, scene, (1.0, 0.5))
        assert "success" not in kinds(play(make(), start, closed))
        assert kinds(play(make(), start, closed, scene))[-1] == "success"


# ---- clicking in order, pressing by count, using a tool: what counts, what does not, what is noted


PLACES: dict[str, Vec3] = {"a": (-0.2, 0.0, 0.74), "b": (-0.1, 0.0, 0.74), "c": (0.0, 0.1, 0.74)}
TOP = Pose((0.0, 0.0, 0.04))


def touching(names: str, opening: float = 0.0) -> list[Snapshot]:
    """A touch of each named object in turn, each followed by 0.2 s without one."""
    made = [snap(0, PLACES)]
    for name in names:
        x, y, z = PLACES[name]
        contact = [(name, (x, y, z + 0.04))]
        made += [snap(0, PLACES, (opening, 1.0), AWAY, contact)] * 3
        made += [snap(0, PLACES, (opening, 1.0))] * 10
    return made


def test_diagnostics_count_what_went_wrong() -> None:
    tracker = ClickInOrder([PressCounter(n, TOP, arm=0) for n in "ab"])
    play(tracker, *touching("baa"))
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["repeated_clicks"], found["presses"]) == (1, 1, 3)


# Counts


@pytest.mark.parametrize(
    ("touched", "done", "out_of_order", "excess"),
    [("aab", 2, 0, 0), ("baa", 2, 1, 0), ("aba", 2, 1, 0), ("ab", 1, 1, 0), ("aaaba", 1, 1, 2)],
)
def test_exact_counts_in_any_order(touched: str, done: int, out_of_order: int, excess: int) -> None:
    tracker = PressCounts([PressCounter(n, TOP) for n in "ab"], (2, 1))
    result = outcome(play(tracker, *touching(touched, opening=1.0)), 2)
    assert (result.success, result.failed, result.done) == (done == 2, False, done)
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["excess_presses"]) == (out_of_order, excess)


# -------- memory goals: stillness before the cue is hidden; gathering, turning, uncovering after it


STRIP = Region((-0.26, 0.26), (-1.0, -0.11))
SHOWN: dict[str, Vec3] = {"a": (-0.1, 0.0, 0.755), "b": (0.1, 0.0, 0.755), "x": (0.0, 0.05, 0.755)}
WALL: dict[str, Vec3] = {"wall": (0.0, 0.12, 0.945)}
NEAR_PLACING: dict[str, Vec3] = {"a": (-0.1, -0.18, 0.755), "b": (0.1, -0.18, 0.755)}
DONE, UNDONE = "subtask_done", "subtask_undone"


def there(*names: str, z: float = 0.755, gripper: float = 1.0, **elsewhere: Vec3) -> Snapshot:
    """The named blocks in the strip, the left arm around the last one if it is not open."""
    moved = {n: (NEAR_PLACING[n][0], NEAR_PLACING[n][1], z) for n in names}
    grasp = held(moved[names[-1]]) if names and gripper < 1 else AWAY
    return snap(0, {**SHOWN, **WALL, **moved, **elsewhere}, (gripper, 1.0), grasp)


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([there("a"), there("a", "b")], [DONE, DONE, "success"]),
        ([there("a", gripper=0.1)], []),
        ([there("a", z=0.80)], []),
        ([replace(there("a", "b"), gripper=(0.1, 1.0))], [DONE, DONE]),
        ([there("a"), there()], [DONE, UNDONE]),
        ([there("a"), there("a", x=(0.0, -0.12, 0.9)), there("a", "b")], [DONE, "failed"]),
    ],
)
def test_shown_blocks_in_the_strip(steps: list[Snapshot], found: list[str]) -> None:
    """Two blocks to bring and one to leave, after the wall has come."""
    goal = memory.AfterCue(gather(["a", "b"], ["x"], STRIP), ["wall"])
    assert kinds(play(goal, SHOWN, {**SHOWN, **WALL}, *steps)) == ["cue_hidden", *found]
    assert goal.diagnostics()["cue_hidden_at"] == TICK
