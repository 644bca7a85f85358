"""Demonstrations of every kind: which a seed is of, where each is refused, what it leads to."""

from collections import Counter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from robot_at_home import at_home
from world_scenes import block

from robospa.action_space import ActionSpace
from robospa.harness.demonstrations import changed_plans as plans
from robospa.harness.demonstrations import noise
from robospa.harness.demonstrations.demonstration import (
    DemonstrationWorld,
    ShownEpisode,
    demonstrate,
    generator_of,
    kind_of,
    replay,
    show,
)
from robospa.harness.demonstrations.recorder import (
    KEYFRAMES,
    STRIDE,
    STRIDES,
    FrameRecorder,
    frame_steps,
)
from robospa.harness.replay import replay as play
from robospa.harness.robots import embodiment
from robospa.harness.sim import motion
from robospa.harness.sim.sapien_world import POLL_STEPS, SapienWorld
from robospa.harness.skills.pick import reachable_grasps
from robospa.harness.skills.workspace import Workspace, moved_back
from robospa.harness.world import StepResult
from robospa.protocol.policy import PolicySpec
from robospa.results.failures.labels import label as failure_type
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene, task, tasks
from robospa.tasks.plan import Pick, Place, Press
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact
from robospa.trial import TrialKey

SEED = 930_000


def key(name: str, level: int = 2, seed: int = SEED) -> TrialKey:
    return TrialKey(name, level, seed, split="train")


def test_a_stream_is_its_key_s_own() -> None:
    def first(of: TrialKey, purpose: str = "noise") -> float:
        return float(generator_of(of, purpose).uniform())

    plain = key("Pick_Blocks_Size")
    assert first(plain) == first(plain)
    others = [first(key("Pick_Blocks_Size", seed=SEED + 1)), first(key("Pick_Blocks_Size", 3))]
    assert len({first(plain), first(plain, "midstate"), *others}) == 4


@pytest.mark.parametrize("shares", [(0.3, 0.1, 0.2), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("first", [SEED, 1_000_000, 1_234_567])
def test_shares_are_met_by_any_run_of_seeds(first: int, shares: tuple[float, ...]) -> None:
    keys = [key("Put_Bottles_Dustbin", seed=seed) for seed in range(first, first + 50)]
    counts = Counter(kind_of(of, shares).partition(":")[0] for of in keys)  # type: ignore[arg-type]
    for kind, share in zip(("noise", "mistake", "midstate"), shares, strict=True):
        assert counts[kind] == pytest.approx(50 * share, abs=2 * (share > 0))


def test_mistakes_are_those_that_a_scene_gives_occasion_for() -> None:
    found = plans.occasions(build_scene("Put_Bottles_Dustbin", 2, SEED))
    assert "drops" in found and "hasty" not in found and "neighbour" not in found


def test_what_is_remembered_has_no_midstates() -> None:
    with pytest.raises(ValueError, match="remembered from its beginning"):
        plans.middle_plan(
            build_scene("Remember_Color_Cover", 2, SEED), generator_of(key("x"), "midstate")
        )
    assert kind_of(key("Remember_Color_Cover"), (0.0, 0.0, 1.0)) == "expert"


@pytest.mark.parametrize(
    ("name", "cuts"),
    [
        ("Pick_Blocks_Size", [0]),
        ("Put_Bottles_Dustbin", [0, 2, 4, 6]),
        ("Place_Phone_Press_Stapler", [0, 1]),
        ("Press_Stapler_Repeat", [0]),
    ],
)
def test_an_episode_begins_with_empty_hands_and_all_that_is_done_in_view(
    name: str, cuts: list[int]
) -> None:
    assert plans.beginnings(task(name).plan(build_scene(name, 3, SEED))) == cuts


def test_nothing_is_displaced_that_is_named_by_where_it_lies() -> None:
    events = {
        name: {
            type(call)
            for seed in range(8)
            for call in plans.middle_plan(build_scene(name, 2, SEED), np.random.default_rng(seed))
        }
        for name in ("Pick_Blocks_Distance", "Pick_Blocks_Size")
    }
    assert plans.Displace not in events["Pick_Blocks_Distance"]
    assert {plans.Displace, plans.Wander} <= events["Pick_Blocks_Size"]


def test_a_mistake_is_marked_before_the_step_that_differs() -> None:
    scene = build_scene("Click_Can_Place_Items", 2, SEED)
    plan = task(scene.task).plan(scene)
    first = plan[0]
    assert isinstance(first, Press)
    assert plans.marked(scene, (first, first)) == (first, plans.GoWrong(), first)
    assert plans.marked(scene, plan) == (*plan, plans.GoWrong())
    scene = build_scene("Put_Bottles_Dustbin", 2, SEED)
    pick, *_ = plan = task(scene.task).plan(scene)
    assert isinstance(pick, Pick)
    assert plans.marked(scene, (pick, Place(pick.object)))[0] == plans.GoWrong()


def planned(kind: str, name: str, level: int) -> tuple[Scene, tuple[object, ...]]:
    scene = build_scene(name, level, SEED)
    return scene, plans.wrong_plan(kind, scene)


def test_the_neighbour_is_not_the_target() -> None:
    scene, plan = planned("neighbour", "Pick_Blocks_Size", 5)
    (call,) = plan
    assert isinstance(call, Pick)
    assert call.object != scene.facts["target"]


def test_a_swap_builds_the_tower_in_another_order() -> None:
    scene, plan = planned("swaps", "Stack_Blocks_Color_Order", 3)
    first, second, third = scene.facts["order"]
    assert [c.object for c in plan if isinstance(c, Place)] == [first, third, second]


def test_a_forgotten_cue_changes_the_order_of_the_covers() -> None:
    scene, plan = planned("forgets", "Remember_Color_Cover", 3)
    covers = scene.facts["covers"]
    assert [c.object for c in plan if isinstance(c, Pick)] == [*covers[1:], covers[0]]


def test_a_repetition_presses_again_and_goes_no_further() -> None:
    _, plan = planned("repeats", "Click_Can_Place_Items", 2)
    assert [type(call) for call in plan] == [Press, Press, Press]


def test_who_stops_early_does_the_first_part() -> None:
    scene, plan = planned("stops", "Put_Bottles_Dustbin", 5)
    assert plans.split_steps(plan) == plans.split_steps(task(scene.task).plan(scene))[:2]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "name", "level"),
    [
        ("swaps", "Pick_Blocks_Size", 5),
        ("drops", "Press_Stapler_Repeat", 3),
        ("forgets", "Remember_Color_Cover", 1),
        ("repeats", "Press_Stapler_Repeat", 5),
        ("hasty", "Put_Bottles_Dustbin", 2),
    ],
)
def test_a_mistake_without_an_occasion_is_refused(kind: str, name: str, level: int) -> None:
    with pytest.raises(ValueError, match=r"no occasion|nothing to drop"):
        planned(kind, name, level)


def test_a_plan_of_one_call_with_a_tool_has_no_first_part() -> None:
    assert planned("nothing", "Hit_Blocks_Hammer_Order", 3)[1] == ()
    with pytest.raises(ValueError, match="no occasion for 'stops'"):
        planned("stops", "Hit_Blocks_Hammer_Order", 3)


def shown(
    kind: str, name: str
) -> tuple[ShownEpisode, FrameRecorder, np.ndarray, np.ndarray, TrialRecord]:
    """A demonstration, its frames with labels and actions, and its replay."""
    recorder, world = FrameRecorder(), DemonstrationWorld(render=False)
    made = show(world, key(name), recorder, kind)
    world.close()
    times = np.array([frame.time for frame in recorder.frames])
    record = replay(
        SapienWorld(render=False), key(name), recorder.commanded, made.prefix_action, kind
    )
    return made, recorder, *made.annotate(recorder.commanded, times), record


@pytest.mark.sim
def test_noise_is_recovered_from_and_repeats_to_the_bit() -> None:
    made, recorder, label, action, record = shown("noise", "Pick_Blocks_Size")
    assert np.array_equal(recorder.commanded, shown("noise", "Pick_Blocks_Size")[1].commanded)
    assert {noise.EXPERT, noise.NOISE, noise.RECOVERY} == set(label.tolist())
    next_command = np.concatenate([recorder.commanded[1:], recorder.commanded[-1:]])
    differs = np.abs(action - next_command).max(axis=1) > 1e-4
    assert (differs == (label == noise.NOISE)).all()
    plain = shown("expert", "Pick_Blocks_Size")[1]
    assert not np.array_equal(plain.commanded, recorder.commanded)
    assert np.allclose(plain.commanded[-1], recorder.commanded[-1], atol=0.05)
    assert made.demonstration.success and record.success


@pytest.mark.sim
def test_a_mistake_fails_as_it_should_and_says_where() -> None:
    made, recorder, label, _, record = shown("mistake:stops", "Stack_Blocks_Color_Order")
    begins = int(np.flatnonzero(label == noise.MISTAKE)[0])
    assert 0 < begins < len(label) and (label[begins:] == noise.MISTAKE).all()
    assert not made.demonstration.success
    assert np.array_equal(recorder.commanded[-1], recorder.commanded[-5])
    failure = failure_type(record)
    assert record.end == "step_limit" and record.steps == len(label)
    assert failure is not None and failure.kind == "no_attempt"


@pytest.mark.sim
@pytest.mark.parametrize("name", ["beside", "drops", "hovers"])
def test_skills_that_go_wrong_touch_the_right_thing_or_nothing(name: str) -> None:
    made, _, label, _, record = shown(f"mistake:{name}", "Pick_Blocks_Size")
    failure = failure_type(record)
    assert not record.success and not made.demonstration.failures and noise.MISTAKE in label
    expected = "no_contact_grasp" if name == "beside" else "target_execution"
    assert failure is not None and failure.kind == expected


@pytest.mark.sim
def test_a_midstate_begins_later_and_elsewhere_and_is_replayed_from_the_start() -> None:
    made, recorder, label, _, record = shown("midstate", "Pick_Blocks_Size")
    first = recorder.frames[0]
    assert first.time > 0.5 and len(made.prefix_action) > 3
    assert np.array_equal(made.prefix_action[-1], first.commanded)
    home = np.concatenate([[*arm.home, 1.0] for arm in embodiment("aloha-agilex").arms])
    assert np.abs(first.commanded - home).max() > 0.2
    assert set(label.tolist()) == {noise.EXPERT}
    assert made.demonstration.success and record.success


SHARE = 0.85
"""Of the step limit that a demonstration may take."""


@pytest.mark.sim
@pytest.mark.parametrize(
    ("name", "level"),
    [("Pick_Breads_Multi_View", 2), ("Lift_Pot_Repeat", 1), ("Press_Stapler_Repeat", 3)],
)
def test_a_replayed_demonstration_succeeds_within_the_step_limit(name: str, level: int) -> None:
    key = TrialKey(name, level, 950_001)
    recorder = FrameRecorder(frame_steps(key.task))
    made = demonstrate(SapienWorld(render=False, limits=motion.DEMONSTRATION_LIMITS), key, recorder)
    assert made.success and not made.failures
    actions = recorder.commanded[1:]
    limit = task(key.task).levels[key.level].steps
    done = play(SapienWorld(render=False), key, actions, "joint")
    assert done.success and done.end == "success"
    assert done.steps < len(actions) <= SHARE * limit  # it goes on where the replay has succeeded
    assert np.array_equal(actions[-1], actions[-2])  # and comes to rest


# ---------------- frames of a recording: at a motion's start, every stride after it, and at its end


class Clock:
    """A world in which every command is the number of physics steps until then, or one for all."""

    def __init__(self, rests: bool = False) -> None:
        self.step = 0
        self.rests = rests

    def observe(self, spec: PolicySpec) -> dict[str, Any]:
        value = -1.0 if spec.state == "measured" else 0.0 if self.rests else float(self.step)
        state = np.full(14, value, np.float32)
        return {"state": state, "ee": np.zeros((2, 8), np.float32)}

    def snapshot(self) -> SimpleNamespace:
        return SimpleNamespace(time=self.step / motion.RATE)

    def still(self) -> int:
        return self.step


def recorded(lengths: list[int], stride: int = 15, rests: bool = False) -> FrameRecorder:
    """The frames of actions that take so many physics steps."""
    recorder, world = FrameRecorder(stride), Clock(rests)
    recorder.started(world)  # type: ignore[arg-type]
    for length in lengths:
        for _ in range(length):
            world.step += 1
            if world.step % POLL_STEPS == 0:
                recorder.polled(world, world.step / motion.RATE)  # type: ignore[arg-type]
        recorder.executed(world, np.zeros(14, np.float32), StepResult(length, False))  # type: ignore[arg-type]
    assert [frame.still for frame in recorder.frames] == [frame.step for frame in recorder.frames]
    commanded, measured, _, objects = recorder.columns()
    assert measured.max() == -1 and objects.shape == (len(recorder), 0)
    assert np.array_equal(commanded, recorder.commanded)
    return recorder


@pytest.mark.parametrize(
    ("lengths", "stride", "frames"),
    [
        ([40], 15, [0, 15, 30, 40]),
        ([40], 20, [0, 20, 40]),
        ([12, 8, 24], 15, [0, 12, 20, 35, 44]),
        ([35], 15, [0, 15, 35]),  # a frame just before an action's end is replaced by that
        ([3, 3, 50], 15, [0, 3, 6, 25, 40, 56]),
        ([40, 12, 3, 500], KEYFRAMES, [0, 40, 52, 55, 555]),
    ],
)
def test_a_frame_every_stride_and_one_at_every_action_s_end(
    lengths: list[int], stride: int, frames: list[int]
) -> None:
    assert [int(row) for row in recorded(lengths, stride).commanded[:, 0]] == frames


def test_a_recording_may_begin_in_the_midst_of_a_trial() -> None:
    recorder, world = FrameRecorder(), Clock()
    world.step = 60
    recorder.started(world)  # type: ignore[arg-type]
    world.step = 68
    recorder.executed(world, np.zeros(14, np.float32), StepResult(8, False))  # type: ignore[arg-type]
    assert [frame.step for frame in recorder.frames] == [60, 68]


def test_a_rest_is_one_frame_however_long_the_action() -> None:
    assert len(recorded([motion.HOLD_STEPS, motion.HOLD_STEPS], rests=True)) == 1 + 2


def test_strides_are_those_of_polls_and_no_wait_gets_shorter() -> None:
    assert set(STRIDES) <= set(tasks())
    for stride in (STRIDE, *STRIDES.values()):
        assert STRIDE <= stride <= motion.HOLD_STEPS and stride % POLL_STEPS == 0
    assert frame_steps("Press_Stapler_Memory") == 20 and frame_steps("Pick_Blocks_Size") == STRIDE


# ----------- noise: pushes that are smooth, bounded and gone at their end, where there is clearance


PROGRESS = motion.profile(1.5, motion.DEMONSTRATION_LIMITS)[0]
"""Of a motion of 1.5 rad: 433 physics steps."""


def test_a_smooth_step_goes_from_nothing_to_all() -> None:
    assert noise.smooth_step(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])).tolist() == [0, 0, 0.5, 1, 1]


@pytest.mark.parametrize("strong", [0.05, 100.0])
def test_a_push_is_bounded_and_gone_at_the_end(strong: float) -> None:
    made = noise.push(PROGRESS, np.array([1.0, -0.5, 0.0]) * strong, 0.2, 0.5)
    assert (made.offset[0] == 0).all() and (made.offset[-1] == 0).all()
    assert np.abs(made.shift).max() <= noise.TURN + 1e-9
    added = np.abs(np.diff(made.offset, n=2, axis=0)).max() * motion.RATE**2
    assert added <= noise.ACCELERATION + 1e-6
    assert added == pytest.approx(noise.ACCELERATION) or strong < 1
    assert (made.offset[:, 2] == 0).all()
    after = made.shift[round(0.5 * len(PROGRESS)) :]
    assert (after == after[-1]).all()


def test_after_a_push_the_way_is_a_straight_line_to_the_goal() -> None:
    line = PROGRESS[:, None] * np.array([1.5, 1.0])
    way = line + noise.push(PROGRESS, np.array([0.05, -0.1]), 0.1, 0.4).offset
    rest = way[round(0.4 * len(way)) :]
    ahead = rest[-1] - rest
    assert np.allclose(ahead[:, 0] * ahead[0, 1], ahead[:, 1] * ahead[0, 0])


def test_labels_and_actions_of_a_pushed_motion() -> None:
    space, count = ActionSpace("joint"), len(PROGRESS)
    log, made = noise.PushLog(6), noise.push(PROGRESS, np.full(6, 0.05), 0.2, 0.5)
    log.append(50, {})
    log.append(count, {1: made})
    log.append(50, {})
    steps = [0, 50, *range(65, 50 + count, 15), 50 + count, 100 + count]
    commanded = np.zeros((len(steps), space.width), np.float32)
    right = space.arms[1].body
    for t, step in enumerate(steps):
        if 50 < step <= 50 + count:
            commanded[t, right] = PROGRESS[step - 51] + made.offset[step - 51]
        elif step > 50:
            commanded[t, right] = 1.0
    label, action = log.annotate(space, commanded, steps)
    following = np.concatenate([commanded[1:], commanded[-1:]])
    pushed = np.flatnonzero(label == noise.NOISE)
    assert (np.diff(pushed) == 1).all() and len(pushed) > 3
    assert set(label[: pushed[0]]) == {noise.EXPERT}
    assert (label[-2:] == noise.EXPERT).all() and label[pushed[-1] + 1] == noise.RECOVERY
    own = label != noise.NOISE
    assert np.allclose(action[own], following[own], atol=1e-4)
    assert (np.abs(action - following)[pushed].max(axis=1) > 1e-4).all()
    assert (action[:, space.arms[0].body] == 0).all()
    for t in pushed:  # by hand: straight on from where the arm is, as far as the motion gets
        now, then = PROGRESS[steps[t] - 51], PROGRESS[steps[t + 1] - 51]
        here = commanded[t, right]
        assert np.allclose(
            action[t, right], here + (1 - here) * (then - now) / (1 - now), atol=1e-6
        )


def workspace() -> Workspace:
    return at_home("aloha-agilex", block("b", -0.15, -0.1))


def way_to_the_block(ws: Workspace, share: float = 1.0) -> motion.Trajectory:
    """The left arm's motion from home to 8 cm before it would grasp, or a first part of it."""
    grasp = reachable_grasps(ws, "b", (0,))[0]
    goal = ws.solve(0, moved_back(grasp.pose, grasp.approach, 0.08), grasp.joints)
    assert goal is not None
    start, opened = np.array(ws.joints), np.ones(2)
    there = np.array([start[0] + share * (goal - start[0]), start[1]])
    return motion.rest_to_rest(start, there, opened, opened, opened, motion.DEMONSTRATION_LIMITS)


def disturbed(path: motion.Trajectory, *touched: str, seed: int = 0) -> motion.Trajectory:
    """With both arms at home, the left gripper touching what is named."""
    ws = workspace()
    contacts = tuple(Contact("left_gripper", name, (0.0, 0.0, 0.0)) for name in touched)
    world: Any = SimpleNamespace(snapshot=lambda: ws.snapshot, contacts=lambda: contacts)
    return noise.Noise(world, ws, np.random.default_rng(seed)).disturb(path)


@pytest.mark.parametrize("seed", range(4))
def test_a_disturbed_way_has_the_same_ends_and_keeps_to_its_bounds(seed: int) -> None:
    ws, path = workspace(), way_to_the_block(workspace())
    way = disturbed(path, seed=seed)
    assert len(way) == len(path)
    assert np.array_equal(way.joints[:, [0, -1]], path.joints[:, [0, -1]])
    assert (way.velocities[:, -1] == path.velocities[:, -1]).all()
    assert np.array_equal(way.joints[1], path.joints[1])
    tip = ws.hand(0).tip
    off, _ = noise.deviation(ws.chains[0], tip, path.joints[0], way.joints[0])
    assert 0.003 <= off <= noise.STRENGTH * 1.05
    pushed, straight = (noise.depths(ws, 0, at.joints[0, ::20]).max() for at in (way, path))
    assert pushed <= straight + 0.002


def test_a_short_motion_and_a_gripper_that_touches_something_unknown_are_left_alone() -> None:
    path, short = (way_to_the_block(workspace(), share) for share in (1.0, 0.02))
    assert disturbed(path, "b") is path and disturbed(short) is short


def test_room_ends_at_the_block_and_at_the_table() -> None:
    ws = workspace()
    grasp = reachable_grasps(ws, "b", (0,))[0]
    assert noise.depths(ws, 0, ws.joints[0][None])[0] == 0.0
    assert noise.depths(ws, 0, grasp.joints[None])[0] > 0.005
    assert noise.gaps(ws, ws.joints[0][None], ws.joints[1][None])[0] > 0.2
