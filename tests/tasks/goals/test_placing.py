"""Objects brought into regions, a container or a guarded strip, and arranged in rows and towers."""

from __future__ import annotations

import math

import pytest
from snapshots_by_hand import held, kinds, play, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import outcome
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.conditions import Container, Region
from robospa.tasks.goals.placing import Destination, bring, bring_alone, collect, nest, row, stack
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP

Places = dict[str, Vec3]
DONE, UNDONE = "subtask_done", "subtask_undone"

# Regions

RIGHT, LEFT = Region(x=(0.1, math.inf)), Region(x=(-math.inf, -0.1))
START: Places = {"a": (0.0, 0.05, 0.755), "b": (0.03, -0.1, 0.755)}
APART: Places = {"a": (0.17, 0.05, 0.755), "b": (-0.17, -0.1, 0.755)}


def sides(released: bool = False) -> Checklist:
    parts = [Destination("a", (RIGHT,), (LEFT,)), Destination("b", (LEFT,), (RIGHT,))]
    return bring(parts, TABLE_TOP, released)


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([START], []),
        ([{**START, "b": APART["b"]}, APART], [DONE, DONE, "success"]),
        ([{**START, "a": (0.1, 0.0, 0.755)}], [DONE]),  # the edge belongs to it
        ([{**START, "a": APART["a"]}, START], [DONE, UNDONE]),
        ([{**START, "a": (-0.2, 0.0, 0.755)}, APART], [DONE, DONE, "success"]),  # astray first
        ([{**APART, "a": (0.7, 0.0, 0.3)}], ["dropped", DONE]),  # off the table
    ],
)
def test_each_in_its_region(steps: list[Places], found: list[str]) -> None:
    assert kinds(play(sides(), START, *steps)) == found


def test_the_other_side_and_a_fall_are_noted() -> None:
    tracker = sides()
    play(tracker, START, {**START, "a": (-0.2, 0.0, 0.755)}, {**APART, "a": (0.7, 0.0, 0.3)})
    found = tracker.diagnostics()
    assert (found["astray"], found["fallen"], found["idle_progress"]) == (1, 1, 0.0)


def test_a_carried_object_counts_only_after_release() -> None:
    flying = {**START, "a": (0.2, 0.05, 0.85)}
    carried = snap(0, flying, (0.1, 1.0), held(flying["a"]))
    assert DONE not in kinds(play(sides(), START, carried))
    assert kinds(play(sides(), START, carried, snap(0, APART, grasp=held(APART["a"]))))[-1] == (
        "success"
    )


@pytest.mark.parametrize(("released", "ends"), [(False, True), (True, False)])
def test_success_waits_for_open_grippers_where_asked(released: bool, ends: bool) -> None:
    closed = snap(0, APART, (0.3, 1.0))
    assert ("success" in kinds(play(sides(released), START, closed))) is ends


THERE: Vec3 = (0.0, -0.15, 0.758)


@pytest.mark.parametrize(
    ("where", "gripper", "found"),
    [
        (THERE, (0.1, 1), []),
        (THERE, (1, 1), [DONE, "success"]),
        ((0.06, -0.15, 0.758), (1, 1), []),
        ((0, -0.07, 0.758), (1, 1), []),
        ((0, -0.15, 0.85), (1, 1), []),
    ],
)
def test_a_single_block_is_let_go_in_the_near_middle(
    where: Vec3, gripper: tuple[float, float], found: list[str]
) -> None:
    tracker = bring_alone("a", Region((-0.05, 0.05), (-1.0, -0.08)))
    events = play(tracker, {"a": (0.2, 0.0, 0.758)}, snap(0, {"a": where}, gripper))
    assert [k for k in kinds(events) if k != "dropped"] == found


# A container

BIN = Container(Pose((-0.45, 0.0, 0.0)), (0.15, 0.15), 0.6)
TABLE: Places = {"p": (0.0, 0.1, 0.74), "q": (0.2, 0.1, 0.74)}
IN: Vec3 = (-0.45, 0.02, 0.05)
INSIDE, PUSHED = dict(TABLE, p=IN), dict(TABLE, p=(-0.40, 0.0, 0.05))


def fall(x: float, *heights: float) -> list[Places]:
    return [dict(TABLE, p=(x, 0.0, z)) for z in heights]


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([INSIDE, INSIDE, dict(INSIDE, q=IN), dict(INSIDE, q=IN)], [DONE, DONE, "success"]),
        (fall(-0.45, 0.59, 0.54, 0.48, 0.41), []),  # through the opening
        (fall(-0.25, 0.9, 0.5, 0.3, 0.02, 0.02, 0.02), ["dropped"]),  # beside the bin, once
        (fall(-0.45, 0.61, 0.61, 0.61), []),  # on the rim
        ([INSIDE, INSIDE, TABLE], [DONE, UNDONE]),
        ([INSIDE, INSIDE, PUSHED], [DONE]),
    ],
)
def test_objects_at_rest_in_the_bin(steps: list[Places], found: list[str]) -> None:
    tracker = collect(["p", "q"], BIN, lost_below=0.64)
    events = play(tracker, TABLE, *steps)
    assert kinds(events) == found
    assert tracker.diagnostics()["lost"] == found.count("dropped")


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


def lined(a: float, b: float, c: float, /, **other: Vec3) -> Places:
    """A row at these x [m], with other places of some."""
    return {n: (x, -0.17, 0.76) for n, x in (("a", a), ("b", b), ("c", c))} | other


SLOPE = {"a": (-0.1, -0.2, 0.76), "b": (0.0, -0.171, 0.76), "c": (0.1, -0.142, 0.76)}


@pytest.mark.parametrize(
    ("scene", "done"),
    [
        (MIXED, 1),  # the first is free
        (lined(-0.1, 0.0, 0.1), 3),
        (SLOPE, 3),
        (lined(0.1, 0.0, -0.1), 1),
        (lined(-0.1, 0.1, 0.0), 2),
        (lined(0.0, 0.0, 0.1), 2),
        (lined(-0.1, 0.0, 0.1, b=(0.0, -0.135, 0.76)), 1),  # too far apart in depth
        (lined(-0.01, 0.0, 0.1, b=(0.0, -0.17, 0.79)), 1),  # on top of each other
    ],
)
def test_what_is_a_row(scene: Places, done: int) -> None:
    events = play(row("abc", True), MIXED, scene)
    assert outcome(events, 3).done == done
    assert ("success" in kinds(events)) is (done == 3)


def test_pairs_in_place_by_chance_count_and_are_told_apart() -> None:
    for a, idle, chance in ((MIXED["a"], 1 / 3, 0), ((-0.1, -0.04, 0.76), 2 / 3, 1)):
        tracker = row("abc", True)
        play(tracker, {**MIXED, "a": a}, {**MIXED, "a": a})
        found = tracker.diagnostics()
        assert found["idle_progress"] == pytest.approx(idle) and found["chance_pairs"] == chance


def test_a_pair_counts_only_after_release_and_is_lost_when_a_block_leaves() -> None:
    placed = lined(-0.1, 0.0, 0.1)
    holding = snap(0, placed, (0.1, 1.0), held(placed["c"]))
    closed = snap(0, placed, (0.5, 1.0))
    assert outcome(play(row("abc", True), MIXED, holding), 3).done == 2
    assert "success" not in kinds(play(row("abc", True), MIXED, holding, closed))
    assert kinds(play(row("abc", True), MIXED, holding, closed, placed))[-1] == "success"
    two = {**placed, "c": MIXED["c"]}
    result = outcome(play(row("abc", True), MIXED, two, {**two, "b": MIXED["b"]}), 3)
    assert (result.done, result.best) == (1, 2)


def test_every_part_has_its_pairs() -> None:
    roles = row("abc", True).roles
    assert [roles[name].subtasks for name in "abc"] == [(1,), (1, 2), (2,)]


# Towers

H = 0.036
GROUND: Places = {"a": (0.0, -0.13, 0.758), "b": (0.2, 0.0, 0.758), "c": (-0.2, 0.0, 0.758)}


def tower(*names: str, shift: Vec3 = (0.0, 0.0, 0.0)) -> Places:
    """`GROUND` with `names` above each other, the last one out of place by `shift`."""
    result = dict(GROUND)
    for i, name in enumerate(names):
        result[name] = (0.0, -0.13, 0.758 + i * H)
    x, y, z = result[names[-1]]
    result[names[-1]] = (x + shift[0], y + shift[1], z + shift[2])
    return result


def stacked(order: str = "abc") -> Checklist:
    return stack(order, [H] * len(order))


OFF = [(0.026, 0, 0), (0, 0.026, 0), (0, 0, 0.021), (0, 0, -0.021)]
WITHIN = [(0.024, 0, 0), (0, -0.024, 0), (0, 0, 0.019)]


@pytest.mark.parametrize(
    ("steps", "done", "best"),
    [
        ([GROUND], 1, 1),
        ([tower("a", "b"), tower("a", "b", "c")], 3, 3),
        ([tower("a", "c"), tower("a", "c", "b")], 1, 1),
        ([tower("a", "b"), GROUND], 1, 2),  # a collapse takes it away
        *(([tower("a", "b", shift=shift)], 1, 1) for shift in OFF),
        *(([tower("a", "b", shift=shift)], 2, 2) for shift in WITHIN),
    ],
)
def test_what_is_a_tower(steps: list[Places], done: int, best: int) -> None:
    tracker = stacked()
    result = outcome(play(tracker, GROUND, *steps), 3)
    assert (result.success, result.done, result.best) == (done == 3, done, best)
    found = tracker.diagnostics()
    assert (found["idle_progress"], found["out_of_order"]) == (pytest.approx(1 / 3), 0)


def test_a_held_block_counts_only_after_release() -> None:
    scene = tower("a", "b")
    grip = held(scene["b"])
    steps = [snap(0, scene, (0.3, 1), grip), snap(0, scene, (0.9, 1), grip)]
    assert kinds(play(stacked("ab"), GROUND, steps[0])) == [DONE, "grasped"]
    assert kinds(play(stacked("ab"), GROUND, *steps))[-2:] == [DONE, "success"]


def test_bringing_the_next_block_does_not_undo_the_one_below() -> None:
    two = tower("a", "b")
    near = snap(0, two, (0, 1), held((0.0, -0.13, 0.758 + 1.5 * H)))
    assert UNDONE not in kinds(play(stacked(), GROUND, two, near))


def test_a_block_stacked_before_the_one_below_is_noted() -> None:
    # c hangs in the right place (say, on something foreign) while b is still missing
    floating = dict(GROUND, b=(0.024, -0.13, 0.758), c=(0.0, -0.13, 0.758 + 2 * H))
    tracker = stacked()
    events = play(tracker, GROUND, floating)
    assert [e.kind for e in events if e.object == "c"] == ["wrong_order", DONE]
    assert tracker.diagnostics()["out_of_order"] == 1


# Vessels

BOWLS: Places = {
    "p": (0.1, -0.12, 0.74),
    "a": (0.2, 0.1, 0.74),
    "b": (-0.2, 0.1, 0.74),
    "c": (-0.2, -0.03, 0.74),
}


def nested(*names: str, shift: Vec3 = (0.0, 0.0, 0.0), **other: Vec3) -> Places:
    """`BOWLS` with `names` nested on the plate, the last one out of place by `shift`."""
    found = dict(BOWLS)
    for i, name in enumerate(names):
        found[name] = (0.1, -0.12, 0.745 + 0.02 * i)
    if names:
        x, y, z = found[names[-1]]
        found[names[-1]] = (x + shift[0], y + shift[1], z + shift[2])
    return found | other


BESIDE_PLATE = [(0.051, 0, 0), (0, -0.051, 0)]
BESIDE_BOWL = [(0.041, 0, 0), (0, 0.041, 0), (0, 0, 0.061), (0, 0, -0.016)]


@pytest.mark.parametrize(
    ("steps", "done", "best"),
    [
        ([BOWLS], 0, 0),
        *(([nested(*o[: i + 1]) for i in range(3)], 3, 3) for o in ("abc", "cab", "bca")),
        *(([nested("a", shift=shift)], 0, 0) for shift in BESIDE_PLATE),
        *(([nested("a", "b", shift=shift)], 1, 1) for shift in BESIDE_BOWL),
        ([nested(a=(0.06, -0.12, 0.745), b=(0.14, -0.12, 0.745))], 1, 1),  # side by side
        ([nested("a", "b"), BOWLS], 0, 2),
    ],
)
def test_what_is_a_stack_of_bowls(steps: list[Places], done: int, best: int) -> None:
    result = outcome(play(nest("abc", "p"), BOWLS, *steps), 3)
    assert (result.success, result.done, result.best) == (done == 3, done, best)


def test_bowls_count_after_release_and_success_waits_for_open_grippers() -> None:
    holding = snap(0, nested("a"), (0.1, 1), held((0.15, -0.12, 0.78)))
    assert outcome(play(nest("abc", "p"), BOWLS, holding), 3).done == 0
    assert outcome(play(nest("abc", "p"), BOWLS, holding, nested("a")), 3).done == 1
    for make, start, scene in (
        (lambda: nest("abc", "p"), BOWLS, nested("a", "b", "c")),
        (stacked, GROUND, tower("a", "b", "c")),
    ):
        closed = snap(0, scene, (1.0, 0.5))
        assert "success" not in kinds(play(make(), start, closed))
        assert kinds(play(make(), start, closed, scene))[-1] == "success"
