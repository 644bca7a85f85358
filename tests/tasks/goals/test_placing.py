"""Placing, clicking and remembering: what the cases of `test_outcomes` do not tell apart."""

from __future__ import annotations

from dataclasses import replace

import pytest
from snapshots_by_hand import AWAY, TICK, held, kinds, play, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals import memory
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.clicks import ClickInOrder, PressCounts
from robospa.tasks.goals.conditions import Container, Region
from robospa.tasks.goals.counters import PressCounter
from robospa.tasks.goals.placing import collect, gather, nest, row, stack
from robospa.tasks.snapshot import Snapshot

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


# ---- clicking in order, pressing by count, using a tool: what counts, what does not, what is noted


PLACES: dict[str, Vec3] = {"a": (-0.2, 0.0, 0.74), "b": (-0.1, 0.0, 0.74), "c": (0.0, 0.1, 0.74)}
TOP = Pose((0.0, 0.0, 0.04))


def counter(name: str, closed: bool = True) -> PressCounter:
    return PressCounter(name, TOP, arm=0 if closed else None)


def touching(names: str, opening: float = 0.0, instants: int = 3) -> list[Snapshot]:
    """A touch of each named object in turn, each followed by 0.2 s without one."""
    made = [snap(0, PLACES)]
    for name in names:
        x, y, z = PLACES[name]
        contact = [(name, (x, y, z + 0.04))]
        made += [snap(0, PLACES, (opening, 1.0), AWAY, contact)] * instants
        made += [snap(0, PLACES, (opening, 1.0))] * 10
    return made


def test_diagnostics_count_what_went_wrong() -> None:
    tracker = ClickInOrder([counter("a"), counter("b")], [counter("c")])
    play(tracker, *touching("bcaa"))
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["wrong_clicks"], found["repeated_clicks"]) == (1, 1, 1)
    assert (found["presses"], found["idle_progress"]) == (4, 0.0)


# Counts


def press(times: tuple[int, ...], touched: str) -> tuple[PressCounts, list[Event]]:
    tracker = PressCounts([counter(n, closed=False) for n in "ab"], times)
    return tracker, play(tracker, *touching(touched, opening=1.0))


@pytest.mark.parametrize(
    ("touched", "done", "out_of_order", "excess"),
    [("aab", 2, 0, 0), ("baa", 2, 1, 0), ("aba", 2, 1, 0), ("ab", 1, 1, 0), ("aaaba", 1, 1, 2)],
)
def test_exact_counts_in_any_order(touched: str, done: int, out_of_order: int, excess: int) -> None:
    tracker, events = press((2, 1), touched)
    result = outcome(events, 2)
    assert (result.success, result.failed, result.done) == (done == 2, False, done)
    found = tracker.diagnostics()
    assert (found["out_of_order"], found["excess_presses"]) == (out_of_order, excess)


# -------- memory goals: stillness before the cue is hidden; gathering, turning, uncovering after it


STRIP = Region((-0.26, 0.26), (-1.0, -0.11))
SHOWN: dict[str, Vec3] = {"a": (-0.1, 0.0, 0.755), "b": (0.1, 0.0, 0.755), "x": (0.0, 0.05, 0.755)}
WALL: dict[str, Vec3] = {"wall": (0.0, 0.12, 0.945)}
NEAR: dict[str, Vec3] = {"a": (-0.1, -0.18, 0.755), "b": (0.1, -0.18, 0.755)}
DONE, UNDONE = "subtask_done", "subtask_undone"


def gathered(
    *after: Snapshot, before: tuple[Snapshot, ...] = ()
) -> tuple[memory.AfterCue, list[Event]]:
    """Two blocks to bring and one to leave; `after` the wall has come."""
    goal = memory.AfterCue(gather(["a", "b"], ["x"], STRIP), ["wall"])
    return goal, play(goal, SHOWN, *before, {**SHOWN, **WALL}, *after)


def there(*names: str, z: float = 0.755, gripper: float = 1.0, **elsewhere: Vec3) -> Snapshot:
    """The named blocks in the strip, the left arm around the last one if it is not open."""
    moved = {n: (NEAR[n][0], NEAR[n][1], z) for n in names}
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
    goal, events = gathered(*steps)
    assert kinds(events) == ["cue_hidden", *found]
    assert goal.diagnostics()["cue_hidden_at"] == TICK
