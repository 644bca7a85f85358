"""The same motions in every action space: an oracle in disguise must still solve its trial."""

from __future__ import annotations

import numpy as np
import pytest
from disguised_oracle import Disguised
from unequal_arms import READY, unequal_arms

from robospa.action_space import is_quantized
from robospa.harness import action_decoder
from robospa.harness.replay import replay
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.sim import sapien_world
from robospa.harness.trial import run_trial
from robospa.protocol.policy import PolicySpec
from robospa.tasks.catalog import build_scene
from robospa.trial import TrialKey


@pytest.mark.sim
@pytest.mark.parametrize("space", ["ee", "delta_ee"])
def test_an_oracle_in_disguise_solves_its_trial(space: str) -> None:
    key = TrialKey("Pick_Blocks_Size", 2, 7_000_000)
    record = run_trial(sapien_world.SapienWorld(render=False), Disguised(space), key, policy_seed=0)
    assert record.success, record.message or record.diagnostics
    assert "unreachable_actions" not in record.diagnostics


@pytest.mark.sim
def test_a_robot_whose_arms_have_different_joint_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = unequal_arms()
    monkeypatch.setattr(sapien_world, "embodiment_named", lambda name: robot)
    world = sapien_world.SapienWorld(render=False)
    world.load(build_scene("Pick_Blocks_Size", 1, 100_000))
    action = np.array([*READY, 0.25, *READY, 0.3, 0.75], np.float32)
    world.step(action, "joint", lambda snapshot: False)
    for state in ("commanded", "measured"):
        seen = world.observe(PolicySpec("test", (), state=state))
        assert seen["state"] == pytest.approx(action, abs=0.1)
    assert [len(joints) for joints in world.snapshot().joints] == [6, 7]
    world.close()


@pytest.mark.sim
@pytest.mark.parametrize("space", ["ee", "delta_ee"])
def test_recorded_joints_are_replayed_to_the_bit_whatever_the_kinematics(
    space: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, world = TrialKey("Pick_Blocks_Size", 2, 100_000), sapien_world.SapienWorld(render=False)
    recorder = ActionRecorder()
    record = run_trial(world, Disguised(space), key, policy_seed=0, recorder=recorder)
    assert record.success and recorder.joints is not None
    assert is_quantized(recorder.joints) and len(recorder.joints) == record.steps
    monkeypatch.setattr(action_decoder, "reaching", None)  # as if another version had none
    again = replay(world, key, recorder.actions, space, joints=recorder.joints)
    assert again.actions_digest == record.actions_digest
    assert (again.digest, again.physics_steps) == (record.digest, record.physics_steps)
    assert again.end == "success"
