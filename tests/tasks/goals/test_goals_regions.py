"""Objects brought into regions: any order, let go of, still on the table."""

from __future__ import annotations

import math

import pytest
from snapshots_by_hand import TICK, held, kinds, run, snap

from robospa.geometry import Vec3
from robospa.tasks.events import outcome
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Region
from robospa.tasks.goals.placing import Destination, bring
from robospa.workcell import TABLE_TOP

RIGHT, LEFT = Region(x=(0.1, math.inf)), Region(x=(-math.inf, -0.1))
START: dict[str, Vec3] = {"a": (0.0, 0.05, 0.755), "b": (0.03, -0.1, 0.755)}
APART: dict[str, Vec3] = {"a": (0.17, 0.05, 0.755), "b": (-0.17, -0.1, 0.755)}


def goal(opened: bool = False) -> Checklist:
    parts = [Destination("a", (RIGHT,), (LEFT,)), Destination("b", (LEFT,), (RIGHT,))]
    return bring(parts, TABLE_TOP, opened)


def play(*scenes: dict[str, Vec3]):  # type: ignore[no-untyped-def]
    made = goal()
    return made, run(made, [snap(i * TICK, s) for i, s in enumerate((START, *scenes))])


def test_doing_nothing_earns_nothing() -> None:
    made, events = play(START)
    assert events == [] and made.diagnostics()["idle_progress"] == 0.0


def test_both_in_their_regions_succeed_in_any_order() -> None:
    assert kinds(play({**START, "b": APART["b"]}, APART)[1]) == ["subtask_done"] * 2 + ["success"]


def test_the_edge_of_a_region_belongs_to_it() -> None:
    scene = {**START, "a": (0.1, 0.0, 0.755)}
    assert outcome(play(scene)[1], 2).done == 1


def test_leaving_a_region_takes_the_subtask_away() -> None:
    result = outcome(play({**START, "a": APART["a"]}, START)[1], 2)
    assert (result.done, result.best) == (0, 1)


def test_the_other_side_is_noted_and_no_failure() -> None:
    made, events = play({**START, "a": (-0.2, 0.0, 0.755)}, APART)
    assert kinds(events)[-1] == "success"
    assert made.diagnostics()["astray"] == 1


def test_what_fell_off_the_table_does_not_count() -> None:
    made, events = play({**APART, "a": (0.7, 0.0, 0.3)})
    assert outcome(events, 2).done == 1
    assert [(e.object, e.index) for e in events if e.kind == "dropped"] == [("a", 0)]
    assert made.diagnostics()["fallen"] == 1


def test_a_carried_object_counts_only_after_release() -> None:
    flying = {**START, "a": (0.2, 0.05, 0.85)}
    snapshots = [
        snap(0, START),
        snap(TICK, flying, (0.1, 1.0), held(flying["a"])),
        snap(2 * TICK, APART, (1.0, 1.0), held(APART["a"])),
    ]
    assert outcome(run(goal(), snapshots[:2]), 2).done == 0
    assert kinds(run(goal(), snapshots))[-1] == "success"


@pytest.mark.parametrize(("opened", "ends"), [(False, True), (True, False)])
def test_success_waits_for_open_grippers_where_asked(opened: bool, ends: bool) -> None:
    snapshots = [snap(0, START), snap(TICK, APART, (0.3, 1.0))]
    assert ("success" in kinds(run(goal(opened), snapshots))) is ends
