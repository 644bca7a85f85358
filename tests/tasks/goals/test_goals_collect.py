"""Collecting in a container: flights, rests, rims and lost objects."""

from __future__ import annotations

from snapshots_by_hand import TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Container
from robospa.tasks.goals.placing import collect

BIN = Container(Pose((-0.45, 0.0, 0.0)), (0.15, 0.15), 0.6)
TABLE = {"p": (0.0, 0.1, 0.74), "q": (0.2, 0.1, 0.74)}
IN: Vec3 = (-0.45, 0.02, 0.05)


def play(*scenes: dict[str, Vec3]) -> tuple[Checklist, list[Event]]:
    goal = collect(["p", "q"], BIN, lost_below=0.64)
    scenes = (TABLE, *scenes)
    return goal, run(goal, [snap(i * TICK, scene) for i, scene in enumerate(scenes)])


def test_objects_at_rest_in_the_bin_succeed_in_any_order() -> None:
    first, both = dict(TABLE, q=IN), dict(p=(-0.4, 0.0, 0.3), q=IN)
    _, events = play(first, first, both, both)
    assert [(e.kind, e.index) for e in events] == [
        ("subtask_done", 1),
        ("subtask_done", 0),
        ("success", -1),
    ]


def test_falling_through_the_opening_does_not_count_yet() -> None:
    fall = [dict(TABLE, p=(-0.45, 0.0, z)) for z in (0.59, 0.54, 0.48, 0.41)]
    _, events = play(*fall)
    assert events == []


def test_falling_beside_the_bin_never_counts_and_is_reported_once() -> None:
    fall = [dict(TABLE, p=(-0.25, 0.0, z)) for z in (0.9, 0.5, 0.3, 0.02, 0.02, 0.02)]
    goal, events = play(*fall)
    assert [(e.kind, e.object, e.note) for e in events] == [("dropped", "p", "out of reach")]
    assert goal.diagnostics()["lost"] == 1


def test_resting_on_the_rim_does_not_count() -> None:
    above = dict(TABLE, p=(-0.45, 0.0, 0.61))
    assert play(above, above, above)[1] == []


def test_leaving_the_bin_undoes_the_subtask() -> None:
    inside = dict(TABLE, p=IN)
    _, events = play(inside, inside, TABLE)
    assert kinds(events) == ["subtask_done", "subtask_undone"]
    assert outcome(events, 2).best == 1


def test_being_jostled_in_the_bin_changes_nothing() -> None:
    inside, pushed = dict(TABLE, p=IN), dict(TABLE, p=(-0.40, 0.0, 0.05))
    assert kinds(play(inside, inside, pushed)[1]) == ["subtask_done"]


def carried(p: Vec3, opening: float, time: float):  # type: ignore[no-untyped-def]
    return snap(time, dict(TABLE, p=p), (opening, 1), held((p[0], p[1], 0.95)))


def test_a_bottle_let_go_over_the_bin_is_not_a_drop() -> None:
    goal = collect(["p", "q"], BIN, lost_below=0.64)
    snapshots = [carried((0.0, 0.1, 0.74), 0.1, 0.0), carried((0.0, 0.1, 0.85), 0.1, TICK)]
    snapshots += [carried((-0.45, 0.0, 0.85), 0.1, 2 * TICK)]
    snapshots += [carried((-0.45, 0.0, z), 1.0, (3 + i) * TICK) for i, z in enumerate((0.8, 0.7))]
    assert kinds(run(goal, snapshots)) == ["grasped"]


def test_the_same_over_the_table_is() -> None:
    goal = collect(["p", "q"], BIN, lost_below=0.64)
    snapshots = [carried((0.0, 0.1, 0.74), 0.1, 0.0), carried((0.0, 0.1, 0.85), 0.1, TICK)]
    snapshots += [carried((0.0, 0.1, 0.81), 0.1, 2 * TICK)]
    assert kinds(run(goal, snapshots)) == ["grasped", "dropped"]
    assert goal.diagnostics()["drops"] == 1


def test_walls_turn_with_the_container() -> None:
    turned = Container(Pose((0.0, 0.0, 0.0), (0.7071068, 0.0, 0.0, 0.7071068)), (0.1, 0.3), 0.5)
    assert turned.inside((0.25, 0.0, 0.1))
    assert not turned.inside((0.0, 0.25, 0.1))
