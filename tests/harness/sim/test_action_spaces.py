"""The same motions in every action space, and actions that no robot could follow."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from run_fakes import FakeWorld, parts
from world_scenes import READY, go_on, unequal_arms

from robospa.action_space import is_quantized
from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness import action_decoder
from robospa.harness.replay import replay
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.sim import sapien_world
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.harness.world import World
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.catalog import build_scene
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
CHAINS = [chain_of(arm) for arm in embodiment("aloha-agilex").arms]


def tools(row: NDArray[np.float32]) -> list[tuple[Pose, float]]:
    """End-effector pose and gripper of both arms after one joint action."""
    parts = (row[:7], row[7:])
    return [
        (end_effector(chain, part[:6].tolist()), float(part[6]))
        for chain, part in zip(CHAINS, parts, strict=True)
    ]


class Disguised:
    """The oracle in disguise: its motions, sent as end-effector poses or as changes of them."""

    def __init__(self, space: str) -> None:
        self._oracle = Oracle()
        self.spec = replace(self._oracle.spec, action=space)
        self._last: list[tuple[Pose, float]] = []

    def reset(self, trial: TrialInfo) -> None:
        self._oracle.reset(trial)
        self._last = tools(np.zeros(14, np.float32))

    def infer(self, observation: dict[str, Any]) -> NDArray[np.float32]:
        rows = []
        for row in self._oracle.infer(observation):
            now = tools(row)
            numbers: list[float] = []
            for (pose, gripper), (before, _) in zip(now, self._last, strict=True):
                sent = pose if self.spec.action == "ee" else before.inverse() * pose
                numbers += [*sent.position, *sent.rotation, gripper]
            self._last = now
            rows.append(numbers)
        return np.array(rows, np.float32)


def test_a_robot_whose_arms_have_different_joint_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = unequal_arms()
    monkeypatch.setattr(sapien_world, "embodiment_named", lambda name: robot)
    world = sapien_world.SapienWorld(render=False)
    world.load(build_scene("Pick_Blocks_Size", 1, 100_000))
    action = np.array([*READY, 0.25, *READY, 0.3, 0.75], np.float32)
    world.step(action, "joint", go_on)
    for state in ("commanded", "measured"):
        seen = world.observe(PolicySpec("test", (), state=state))
        assert seen["state"] == pytest.approx(action, abs=0.1)
    assert [len(joints) for joints in world.snapshot().joints] == [6, 7]
    world.close()


@pytest.mark.parametrize("space", ["ee", "delta_ee"])
def test_recorded_joints_of_what_an_oracle_solves_are_replayed_to_the_bit_whatever_the_kinematics(
    space: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, world = TrialKey("Pick_Blocks_Size", 2, 7_000_000), sapien_world.SapienWorld(render=False)
    recorder = ActionRecorder()
    record = run_trial(world, Disguised(space), key, policy_seed=0, recorder=recorder)
    assert record.success and recorder.joints is not None, record.message or record.diagnostics
    assert "unreachable_actions" not in record.diagnostics
    assert is_quantized(recorder.joints) and len(recorder.joints) == record.steps
    monkeypatch.setattr(action_decoder, "reaching", None)  # as if another version had none
    again = replay(world, key, recorder.actions, space, joints=recorder.joints)
    assert again.actions_digest == record.actions_digest
    assert (again.digest, again.physics_steps) == (record.digest, record.physics_steps)
    assert again.end == "success"


KEY = TrialKey("Pick_Blocks_Size", 1, 100_009)
ACTIONS = 6


class Absurd:
    """Holds still, but for the third action of a chunk of three."""

    def __init__(self, space: str, third: NDArray[np.float32]) -> None:
        self.spec = PolicySpec("absurd", cameras=(), state="none", action=space, horizon=3)
        self._third = third

    def reset(self, trial: TrialInfo) -> None:
        """Nothing depends on the trial."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        chunk = np.zeros((3, len(self._third)), np.float32)
        if self.spec.action == "delta_ee":
            chunk[:, [3, 11]] = 1.0
        chunk[2] = self._third
        return chunk


def joints(changed: dict[int, float]) -> NDArray[np.float32]:
    action = np.zeros(14, np.float32)
    action[[*changed]] = [*changed.values()]
    return action


FAR = np.array([4.0, 0, 0, 1, 0, 0, 0, 55.0] * 2, np.float32)
BOTH = {"clipped_joints": 2, "clipped_grippers": 2}
CASES: dict[str, tuple[str, NDArray[np.float32], dict[str, int]]] = {
    "everything": ("joint", np.full(14, -3.4e38, np.float32), BOTH),
    "degrees": ("joint", joints({1: 90.0, 9: -45.0}), {"clipped_joints": 2}),
    "gripper in percent": ("joint", joints({6: 100.0}), {"clipped_grippers": 2}),
    "far away": ("delta_ee", FAR, {"unreachable_actions": 2, "clipped_grippers": 2}),
    "just above the limits": ("joint", joints({0: -10.03, 6: 1.03}), {}),
}


def problems(world: World, find: Callable[..., TrialSetup], policy: Absurd) -> dict[str, Any]:
    """What the record of a trial of ACTIONS actions says of them."""
    limit = find(KEY).task.levels[KEY.level].steps
    record = run_trial(world, policy, KEY, policy_seed=0, parts=find, step_scale=ACTIONS / limit)
    assert (record.end, record.steps) == ("step_limit", ACTIONS), record.message
    words = ("unreachable", "clipped")
    return {k: v for k, v in record.diagnostics.items() if any(word in k for word in words)}


@pytest.mark.parametrize("case", CASES)
def test_the_simulator_counts_absurd_actions_as_the_fake_world_does(case: str) -> None:
    *sent, expected = CASES[case]
    seen = problems(SapienWorld(render=False), task_parts, Absurd(*sent))
    assert seen == problems(FakeWorld(), parts, Absurd(*sent))
    assert {name: value for name, value in seen.items() if isinstance(value, int)} == expected
