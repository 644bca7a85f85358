"""What is scored without reading or without grasping: blind policies, and abuse of the physics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from robot_at_home import at_home

from robospa.baselines import blind, hold
from robospa.geometry import Pose
from robospa.harness.skills.pick import pick
from robospa.harness.skills.workspace import Steps, Workspace
from robospa.harness.trial import run_trial
from robospa.harness.world import World
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
