"""Demonstrations of every kind: which a seed is of, where each is refused, what it leads to."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from robospa.harness.demonstrations.changed_plans import (
    Displace,
    GoWrong,
    Wander,
    beginnings,
    marked,
    middle_plan,
    occasions,
    split_steps,
    wrong_plan,
)
from robospa.harness.demonstrations.demonstration import (
    DemonstrationWorld,
    ShownEpisode,
    demonstrate,
    generator_of,
    kind_of,
    replay,
    show,
)
from robospa.harness.demonstrations.noise import EXPERT, MISTAKE, NOISE, RECOVERY
from robospa.harness.demonstrations.recorder import FrameRecorder, frame_steps
from robospa.harness.replay import replay as play
from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.results.failures.labels import label as failure_type
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.plan import Pick, Place, Press
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

SEED = 930_000
MIXED = (0.3, 0.1, 0.2)


def key(name: str, level: int = 2, seed: int = SEED) -> TrialKey:
    return TrialKey(name, level, seed, split="train")


def test_a_stream_is_its_key_s_own() -> None:
    def first(of: TrialKey, purpose: str = "noise") -> float:
        return float(generator_of(of, purpose).uniform())

    plain = key("Pick_Blocks_Size")
    assert first(plain) == first(plain)
    others = [first(key("Pick_Blocks_Size", seed=SEED + 1)), first(key("Pick_Blocks_Size", 3))]
    assert len({first(plain), first(plain, "midstate"), *others}) == 4


@pytest.mark.parametrize("first", [SEED, 1_000_000, 1_234_567])
def test_shares_are_met_by_any_run_of_seeds(first: int) -> None:
    made = [kind_of(key("Put_Bottles_Dustbin", seed=s), MIXED) for s in range(first, first + 50)]
    counts = Counter(kind.partition(":")[0] for kind in made)
    assert counts["noise"] == pytest.approx(15, abs=2)
    assert counts["mistake"] == pytest.approx(5, abs=2)
    assert counts["midstate"] == pytest.approx(10, abs=2)


def test_without_shares_all_are_the_expert_s() -> None:
    assert {kind_of(key("Pick_Blocks_Size", seed=s), (0.0, 0.0, 0.0)) for s in range(30)} == {
        "expert"
    }


def test_mistakes_are_those_that_a_scene_gives_occasion_for() -> None:
    found = occasions(build_scene("Put_Bottles_Dustbin", 2, SEED))
    assert "drops" in found and "hasty" not in found and "neighbour" not in found


def test_what_is_remembered_has_no_midstates() -> None:
    with pytest.raises(ValueError, match="remembered from its beginning"):
        middle_plan(
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
    assert beginnings(task(name).plan(build_scene(name, 3, SEED))) == cuts


def test_nothing_is_displaced_that_is_named_by_where_it_lies() -> None:
    events = {
        name: {
            type(call)
            for seed in range(8)
            for call in middle_plan(build_scene(name, 2, SEED), np.random.default_rng(seed))
        }
        for name in ("Pick_Blocks_Distance", "Pick_Blocks_Size")
    }
    assert Displace not in events["Pick_Blocks_Distance"]
    assert {Displace, Wander} <= events["Pick_Blocks_Size"]


def test_a_mistake_is_marked_before_the_step_that_differs() -> None:
    scene = build_scene("Click_Can_Place_Items", 2, SEED)
    plan = task(scene.task).plan(scene)
    first = plan[0]
    assert isinstance(first, Press)
    assert marked(scene, (first, first)) == (first, GoWrong(), first)
    assert marked(scene, plan) == (*plan, GoWrong())
    scene = build_scene("Put_Bottles_Dustbin", 2, SEED)
    pick, *_ = plan = task(scene.task).plan(scene)
    assert isinstance(pick, Pick)
    assert marked(scene, (pick, Place(pick.object)))[0] == GoWrong()


def planned(kind: str, name: str, level: int) -> tuple[Scene, tuple[object, ...]]:
    scene = build_scene(name, level, SEED)
    return scene, wrong_plan(kind, scene)


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
    assert split_steps(plan) == split_steps(task(scene.task).plan(scene))[:2]  # type: ignore[arg-type]


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
    assert {EXPERT, NOISE, RECOVERY} == set(label.tolist())
    next_command = np.concatenate([recorder.commanded[1:], recorder.commanded[-1:]])
    differs = np.abs(action - next_command).max(axis=1) > 1e-4
    assert (differs == (label == NOISE)).all()
    plain = shown("expert", "Pick_Blocks_Size")[1]
    assert not np.array_equal(plain.commanded, recorder.commanded)
    assert np.allclose(plain.commanded[-1], recorder.commanded[-1], atol=0.05)
    assert made.demonstration.success and record.success


@pytest.mark.sim
def test_a_mistake_fails_as_it_should_and_says_where() -> None:
    made, recorder, label, _, record = shown("mistake:stops", "Stack_Blocks_Color_Order")
    begins = int(np.flatnonzero(label == MISTAKE)[0])
    assert 0 < begins < len(label) and (label[begins:] == MISTAKE).all()
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
    assert not record.success and not made.demonstration.failures and MISTAKE in label
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
    assert set(label.tolist()) == {EXPERT}
    assert made.demonstration.success and record.success


SHARE = 0.85
"""Of the step limit that a demonstration may take."""


@pytest.mark.sim
@pytest.mark.parametrize(
    "key",
    [
        TrialKey("Pick_Breads_Multi_View", 2, 950_001),
        TrialKey("Lift_Pot_Repeat", 1, 950_001),
        TrialKey("Press_Stapler_Repeat", 3, 950_001),
    ],
    ids=lambda key: key.task,
)
def test_a_replayed_demonstration_succeeds_within_the_step_limit(key: TrialKey) -> None:
    recorder = FrameRecorder(frame_steps(key.task))
    made = demonstrate(SapienWorld(render=False, limits=DEMONSTRATION_LIMITS), key, recorder)
    assert made.success and not made.failures
    actions = recorder.commanded[1:]
    limit = task(key.task).levels[key.level].steps
    done = play(SapienWorld(render=False), key, actions, "joint")
    assert done.success and done.end == "success"
    assert done.steps < len(actions) <= SHARE * limit  # it goes on where the replay has succeeded
    assert np.array_equal(actions[-1], actions[-2])  # and comes to rest
