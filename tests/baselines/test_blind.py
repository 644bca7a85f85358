"""What is scored without reading or without grasping: blind policies, and abuse of the physics."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from robot_at_home import at_home

from robospa.baselines import blind, hold, random, replay
from robospa.baselines.oracle import FailingOracle
from robospa.baselines.reactive import FASTEST, SNAP, create, line
from robospa.geometry import Pose
from robospa.harness.running.record_store import write_actions
from robospa.harness.skills.pick import pick
from robospa.harness.skills.workspace import Steps, Workspace
from robospa.harness.trial import run_trial
from robospa.harness.world import World
from robospa.protocol.policy import TrialInfo
from robospa.results.failures.labels import label
from robospa.results.records.action_problems import CLIPPED_GRIPPERS, CLIPPED_JOINTS
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene
from robospa.tasks.plan import Pick
from robospa.trial import TrialKey

POLICIES = {
    "tries-all": blind.create_tries_all,
    "presses-all": blind.create_presses_all,
    "commonest": blind.create_commonest,
}


@pytest.mark.parametrize(
    ("planner", "name"),
    [
        (blind.tries_all, "Pick_Blocks_Size"),
        (blind.presses_all, "Click_Objects_Order"),
        (blind.commonest, "Move_Blocks_Apart"),
    ],
)
def test_it_does_the_same_whatever_is_asked_for(planner: blind.Planner, name: str) -> None:
    scene = build_scene(name, 3, 100_000)
    rows, home = [], at_home(scene.embodiment, *scene.everything).snapshot
    for facts in (scene.facts, {}, {key: "wrong" for key in scene.facts}):
        expert = blind.BlindExpert(replace(scene, facts=facts), home, planner)
        rows.append(expert.next(home))
    assert len(rows[0]) > 1, "it does something"
    for other in rows[1:]:
        np.testing.assert_array_equal(rows[0], other)


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    from robospa.harness.sim.sapien_world import SapienWorld

    made = SapienWorld(render=False)
    yield made
    made.close()


def tried(world: World, policy: Any, name: str, level: int, **more: Any) -> TrialRecord:
    return run_trial(world, policy, TrialKey(name, level, 100_000), policy_seed=0, **more)


@pytest.mark.sim
@pytest.mark.parametrize(
    ("policy", "name", "level", "wrong"),
    [
        ("tries-all", "Pick_Cups_Canonical", 5, "wrong_object"),
        ("tries-all", "Lift_Fan_Repeat", 3, ""),
        ("presses-all", "Click_Objects_Order", 5, "wrong_order"),
        ("presses-all", "Observe_Objects_Click_Memory", 3, "wrong_order"),
        ("commonest", "Place_Bowls_Plates", 3, ""),
    ],
)
def test_the_official_rule_lets_it_succeed(
    world: World, policy: str, name: str, level: int, wrong: str
) -> None:
    made = POLICIES[policy]()
    record = tried(world, made, name, level)
    assert made.spec.name == policy and made.spec.privileged
    assert record.success
    assert not wrong or wrong in {event["kind"] for event in record.events}


class Throw(blind.TryOut):
    """Lift a little, then let go in the next motion, up and outwards."""

    def steps(self, ws: Workspace) -> Steps:
        grasp = yield from pick(ws, Pick(self.object, 0.03))
        x, y, z = grasp.pose.position
        out = Pose((x + 0.05 * math.copysign(1, x), y, z + 0.15), grasp.pose.rotation)
        ws.add(grasp.arm, ws.solve(grasp.arm, out, grasp.joints), 1.0)
        ws.held[grasp.arm] = None
        yield from ws.flush()


@pytest.mark.sim
def test_what_is_thrown_is_not_carried(world: World) -> None:
    def planner(scene: object, ws: Workspace) -> list[Throw]:
        return [Throw(str(build_scene(name, 1, 100_000).facts["target"]))]

    name = "Pick_Soaps_Relational"
    record = tried(world, blind.Blind("throws", planner), name, 1, step_scale=0.1)
    assert not record.success
    assert "dropped" in {event["kind"] for event in record.events}


class Extreme(hold.Hold):
    """Every number a million, this or that way."""

    def infer(self, observation: Any) -> NDArray[np.float32]:
        signs = np.random.default_rng(int(observation["step"])).choice([-1e6, 1e6], (10, 14))
        return np.asarray(signs, np.float32)


@pytest.mark.sim
def test_extreme_numbers_are_executed_as_far_as_the_robot_goes(world: World) -> None:
    record = tried(world, Extreme(), "Pick_Soaps_Relational", 1, step_scale=0.015)
    assert (record.end, record.steps) == ("step_limit", 2)
    assert record.diagnostics[CLIPPED_JOINTS.name] == record.diagnostics[CLIPPED_GRIPPERS.name] == 2


# --------------------------------------------- hold, random and replay do what they say, repeatably


KEY = TrialKey("Pick_Fake", 3, 100007)
TRIAL = TrialInfo("Pick_Fake", KEY.embodiment, "", policy_seed=5, key=KEY)
STATE = np.linspace(0, 1, 14, dtype=np.float32)


def seen(step: int = 0) -> dict[str, Any]:
    return {"state": STATE, "step": step, "images": {}, "instruction": ""}


def test_hold_sends_the_state_back() -> None:
    chunk = hold.Hold().infer(seen())
    assert chunk.dtype == np.float32
    assert (chunk == STATE).all()


def test_random_depends_on_the_policy_seed_and_the_step_only() -> None:
    policy, other = random.Random(), random.Random()
    policy.reset(TRIAL)
    policy.infer(seen(10))
    other.reset(TRIAL)
    np.testing.assert_array_equal(policy.infer(seen(20)), other.infer(seen(20)))
    assert not np.array_equal(policy.infer(seen(20)), policy.infer(seen(30)))


def test_replay_sends_exactly_what_was_recorded(tmp_path: Path) -> None:
    actions = np.random.default_rng(0).normal(size=(130, 14)).astype(np.float32)
    write_actions(tmp_path, KEY, actions, "joint")
    policy = replay.create(str(tmp_path))
    policy.reset(TRIAL)
    sent = np.concatenate([policy.infer(seen(0)), policy.infer(seen(100))])
    np.testing.assert_array_equal(sent, actions)
    np.testing.assert_array_equal(policy.infer(seen(500)), actions[-1:])


def test_replay_refuses_what_it_does_not_have(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no action traces"):
        replay.create(str(tmp_path))
    write_actions(tmp_path, KEY, np.ones((1, 14), np.float32), "joint")
    with pytest.raises(ValueError, match="no trace of Pick_Other"):
        replay.create(str(tmp_path)).reset(replace(TRIAL, key=replace(KEY, task="Pick_Other")))


# ------------------------------------------ the scripted policy that looks before every few actions


BODIES = [0, 1, 3]
PERIOD = 0.06


def test_a_line_ends_at_its_stop_and_is_never_faster_than_it_may() -> None:
    start = np.array([0.0, 1.0, 1.0, 0.5], np.float32)
    stop = np.array([0.8, 0.6, 0.0, 0.5], np.float32)
    rows = line(start, stop, BODIES, PERIOD)
    assert (rows[-1] == np.round(stop * 65536) / 65536).all()
    moves = np.abs(np.diff(np.vstack([start, rows]), axis=0))[:, BODIES].max(axis=1)
    assert moves.max() <= FASTEST * PERIOD + 1e-4
    assert moves[-2] < moves[1], "it slows down before the stop"
    shares = (rows - start)[:, [0, 1]] / (stop - start)[[0, 1]]
    assert np.allclose(shares[:, 0], shares[:, 1], atol=1e-3)


def test_a_stop_nearby_or_of_a_gripper_alone_is_one_action() -> None:
    start = np.array([0.0, 0.0, 1.0, 0.0], np.float32)
    for stop in ([SNAP / 2, 0, 1, 0], [0, 0, 0, 0]):
        assert len(line(start, np.array(stop, np.float32), BODIES, PERIOD)) == 1


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: create(chunk="0"), "1 to 200"),
        (lambda: create(chunk="x"), "1 to 200"),
        (lambda: create(feedback="maybe"), "yes or no"),
        (replay.create, "--arg run="),
        (lambda: FailingOracle("sulks"), "no mistake 'sulks'; there are neighbour"),
    ],
)
def test_what_cannot_be_is_refused(make: Callable[[], object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make()


# ---------------------------------------- policies that fail on purpose: that they fail as they say


SEED = 930_000


@pytest.mark.sim
@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        ("neighbour", "Pick_Blocks_Size", "target_grounding"),
        ("beside", "Pick_Blocks_Size", "no_contact_grasp"),
        ("drops", "Pick_Blocks_Size", "target_execution"),
        ("drops", "Put_Bottles_Dustbin", "manipulation"),
        ("swaps", "Stack_Blocks_Color_Order", "temporal_ordering"),
        ("repeats", "Click_Can_Place_Items", "redundant_repetition"),
        ("forgets", "Remember_Color_Cover", "memory"),
        ("nothing", "Press_Stapler_Repeat", "no_attempt"),
    ],
)
def test_a_scripted_mistake_is_labelled_as_scripted(
    world: World, kind: str, name: str, expected: str
) -> None:
    policy = FailingOracle(kind)
    found = label(run_trial(world, policy, TrialKey(name, 2, SEED), policy_seed=0))
    assert policy.applies and found is not None
    assert found.kind == expected


@pytest.mark.sim
def test_one_that_makes_all_mistakes_makes_another_in_every_trial(world: World) -> None:
    policy, key = FailingOracle("all"), TrialKey("Pick_Blocks_Size", 2, SEED)
    found = [label(run_trial(world, policy, key, policy_seed=seed)) for seed in range(3)]
    kinds = [failure and failure.kind for failure in found]
    assert kinds == ["target_grounding", None, "target_execution"]
