"""Checklists: letting go, latching, returning, bins, several counters, and the noted order."""

from __future__ import annotations

from dataclasses import replace

from snapshots_by_hand import TICK, held, kinds, run, snap

from robospa.geometry import Pose, Vec3
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.checklist import Checklist
from robospa.tasks.goals.parts import Container, Inside, Rests, on_spot
from robospa.tasks.goals.repeat import PressCounter
from robospa.tasks.goals.stamping import StampCounter
from robospa.tasks.snapshot import Snapshot

START: dict[str, Vec3] = {"cup": (0.2, 0.0, 0.74), "mat": (0.0, 0.0, 0.74)}
ON_MAT: Vec3 = (0.01, 0.0, 0.745)
NEAR = on_spot(0.035, -0.01, 0.01, Pose(), Pose((0.0, 0.0, 0.005)))


def play(goal: Checklist, snapshots: list[Snapshot]) -> list[Event]:
    timed = [replace(s, time=i * TICK) for i, s in enumerate(snapshots)]
    return run(goal, timed)


def at(cup: Vec3, gripper: float = 1.0, grasp: Vec3 | None = None) -> Snapshot:
    arms = {} if grasp is None else {"grasp": held(grasp)}
    return snap(0, dict(START, cup=cup), (gripper, 1.0), **arms)


def test_a_placement_counts_once_it_is_let_go() -> None:
    holding = at(ON_MAT, 0.1, ON_MAT)
    assert "success" not in kinds(
        play(Checklist([Rests("cup", ("mat",), NEAR)]), [at(START["cup"]), holding])
    )
    assert "success" in kinds(
        play(Checklist([Rests("cup", ("mat",), NEAR)]), [at(START["cup"]), holding, at(ON_MAT)])
    )


def test_a_latched_placement_stays_and_another_does_not() -> None:
    for latched, done in ((True, 1), (False, 0)):
        cup = Rests("cup", ("mat",), NEAR, latched=latched)
        events = play(
            Checklist([cup, PressCounter("mat", Pose())]),
            [at(START["cup"]), at(ON_MAT), at((0.3, 0.0, 0.74))],
        )
        assert outcome(events, 2).done == done


def test_coming_back_counts_only_after_having_been_away() -> None:
    def home(pose: Pose, start: Pose) -> bool:
        return abs(pose.position[0] - start.position[0]) < 0.04

    def goal() -> Checklist:
        away = Rests("cup", ("mat",), NEAR, latched=True)
        return Checklist([away, Rests("cup", (), home, after=0)])

    assert outcome(play(goal(), [at(START["cup"])] * 3), 2).done == 0
    assert "success" in kinds(play(goal(), [at(START["cup"]), at(ON_MAT), at(START["cup"])]))


def test_success_may_ask_for_open_grippers() -> None:
    goal = Checklist([Rests("cup", ("mat",), NEAR)], released=True)
    closed = snap(0, dict(START, cup=ON_MAT), (1.0, 0.0))
    assert "success" not in kinds(play(goal, [at(START["cup"]), closed]))


def test_two_of_one_turn_may_be_done_in_any_order() -> None:
    scene: dict[str, Vec3] = {"a": (0.2, 0.0, 0.74), "b": (0.3, 0.0, 0.74), "mat": (0.0, 0.0, 0.74)}
    after = [
        snap(0, scene),
        snap(0, dict(scene, b=ON_MAT)),
        snap(0, dict(scene, a=ON_MAT, b=ON_MAT)),
    ]
    parts = [Rests(name, ("mat",), NEAR) for name in ("a", "b")]
    assert "wrong_order" in kinds(play(Checklist(parts), after))
    assert "wrong_order" not in kinds(play(Checklist(parts, turns=[0, 0]), after))


def test_what_flies_past_the_bin_does_not_count_until_it_is_slow() -> None:
    box = Container(Pose((0.0, 0.0, 0.0)), (0.2, 0.2), 0.6)
    places: list[Vec3] = [(0.0, 0.0, 0.8), (0.0, 0.0, 0.5), (0.0, 0.0, 0.3), (0.0, 0.0, 0.3)]
    snapshots = [snap(0, {"ball": p, "bin": (0.0, 0.0, 0.0)}) for p in places]
    events = play(Checklist([Inside("ball", "bin", box)]), snapshots)
    (done,) = [e for e in events if e.kind == "subtask_done"]
    assert done.time == 3 * TICK


def test_a_click_with_an_open_gripper_does_not_count_if_it_must_be_closed() -> None:
    top: Vec3 = (0.0, 0.0, 0.75)
    for gripper, count in ((0.0, 1), (0.5, 0)):
        counter = PressCounter("mat", Pose((0.0, 0.0, 0.01)), arm=0)
        press = snap(0, START, (gripper, 1.0), touched=[("mat", top)])
        play(Checklist([counter]), [snap(0, START), press])
        assert counter.count == count


def stamps(*heights: float) -> StampCounter:
    counter = StampCounter("seal", "pad")
    snapshots = [
        snap(i * TICK, {"seal": (0.1 if z > 0.1 else 0.0, 0.0, 0.74 + z), "pad": (0.0, 0.0, 0.74)})
        for i, z in enumerate(heights)
    ]
    counter.start(snapshots[0])
    for snapshot in snapshots[1:]:
        counter.update(snapshot)
    return counter


def test_stamps_count_when_they_come_down_and_need_two_centimetres_between() -> None:
    assert stamps(0.2, 0.03, 0.001, 0.001, 0.03, 0.001).count == 2


def test_a_bounce_at_one_centimetre_is_one_stamp_and_two_official_ones() -> None:
    counter = stamps(0.2, 0.009, 0.011, 0.009)
    assert (counter.count, counter.raw_count) == (1, 2)


def test_standing_on_the_pad_from_the_start_is_no_stamp() -> None:
    assert stamps(0.0, 0.0, 0.0).count == 0


def test_a_stamp_too_many_is_repeated_and_carried_things_are_not_pressed() -> None:
    goal = Checklist([StampCounter("cup", "mat")])
    assert not goal.roles["cup"].pressed and not goal.needs_contacts
    up, down = (0.0, 0.0, 0.78), (0.0, 0.0, 0.74)
    events = play(goal, [at(up), at(down), at(up), at(down)])
    assert kinds(events).count("repeated") == 1


def test_a_tool_belongs_to_the_subtask_it_is_used_for() -> None:
    goal = Checklist([Rests("cup", ("mat",), NEAR)], tools={"spoon": 0})
    assert goal.roles["spoon"].subtasks == (0,) and goal.roles["mat"].subtasks == ()
