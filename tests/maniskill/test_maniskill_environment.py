"""The tasks as ManiSkill's environments, with ManiSkill itself. `make test-maniskill` runs it."""

import contextlib
import io
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy, FakeWorld, parts

from robospa.harness.settings import SettingsError
from robospa.harness.trial import run_trial
from robospa.protocol.policy import PolicySpec
from robospa.trial import TrialKey

pytestmark = pytest.mark.maniskill
pytest.importorskip("mani_skill", reason="ManiSkill has an environment of its own")

import gymnasium  # noqa: E402
import torch  # noqa: E402
from mani_skill.trajectory.replay_trajectory import main, parse_args  # noqa: E402
from mani_skill.utils.registration import REGISTERED_ENVS  # noqa: E402
from mani_skill.utils.wrappers import CPUGymWrapper, RecordEpisode  # noqa: E402
from mani_skill.utils.wrappers.flatten import FlattenRGBDObservationWrapper  # noqa: E402
from mani_skill.vector.wrappers.gymnasium import ManiSkillVectorEnv  # noqa: E402

import robospa.maniskill  # noqa: E402, F401
from robospa.tasks.catalog import tasks  # noqa: E402

ID = "RoboSPA-Pick_Blocks_Size-L1-v3"
FAKE: dict[str, Any] = {
    "world": "run_fakes:FakeWorld",
    "parts": "run_fakes:parts",
    "seeds": [100000, 100001],
    "cameras": ["head"],
    "sensor_configs": {"width": 8, "height": 6},
}
"""A trial of seed s is won when the first entries of its actions add up to s % 10 + 1."""
ONES = np.ones(14, np.float32)


def fake(**more: Any) -> Any:
    return gymnasium.make(ID, **{**FAKE, **more})


def test_every_variant_is_registered_with_its_step_limit() -> None:
    ours = [name for name in REGISTERED_ENVS if name.startswith("RoboSPA-")]
    assert len(ours) == 5 * len(tasks()) and set(ours) <= set(gymnasium.registry)
    assert REGISTERED_ENVS[ID].max_episode_steps == 150


def test_an_observation_has_maniskills_layout_in_every_mode() -> None:
    env = fake(obs_mode="rgb")
    observation, info = env.reset(seed=100001)
    assert observation["sensor_data"]["head"]["rgb"].shape == (1, 6, 8, 3)
    assert observation["sensor_param"]["head"]["intrinsic_cv"].shape == (1, 3, 3)
    assert observation["agent"]["qpos"].shape == (1, 14)
    assert sorted(observation["extra"]) == ["left_tcp_pose", "right_tcp_pose"]
    assert info["reconfigure"] and info["success"].tolist() == [False]
    assert env.unwrapped.get_language_instruction() == [env.unwrapped.task_env.instruction]
    assert env.unwrapped.single_observation_space.contains(CPUGymWrapper(env).reset()[0])
    flat = FlattenRGBDObservationWrapper(fake(obs_mode="rgb"))
    seen = flat.reset(seed=100001)[0]
    assert {name: part.shape for name, part in seen.items()} == {
        "state": (1, 42),
        "rgb": (1, 6, 8, 3),
    }
    assert fake(obs_mode="none").reset(seed=100001)[0] == {}


def test_a_trial_ends_as_in_a_run_and_stays_as_it_is() -> None:
    key = TrialKey("Pick_Blocks_Size", 1, 100001)
    record = run_trial(FakeWorld(), FakePolicy(), key, policy_seed=0, parts=parts)
    env = fake(obs_mode="none")
    env.reset(seed=100001)
    found = []
    for action in (ONES, ONES[None], torch.ones(14)):
        _, reward, terminated, truncated, info = env.step(action)
        found.append((reward.item(), terminated.item(), truncated.item(), info["done"].item()))
    assert found == [(0.0, False, False, 1), (1.0, True, False, 2), (1.0, True, False, 2)]
    ours = env.unwrapped.record
    assert (ours.digest, ours.actions_digest) == (record.digest, record.actions_digest)
    assert ours.steps == 2 and info["elapsed_steps"].item() == 3


def test_the_step_limit_truncates_and_a_bad_action_fails() -> None:
    env = fake(obs_mode="none")
    env.reset(seed=100001)
    for _ in range(150):
        _, _, terminated, truncated, _ = env.step(np.zeros(14, np.float32))
    assert (terminated.item(), truncated.item()) == (False, True)
    assert env.unwrapped.record.end == "step_limit"
    env = fake(obs_mode="none", control_mode="ee")
    env.reset(seed=100001)
    _, reward, terminated, _, info = env.step(np.zeros(16, np.float32))
    assert reward.item() == -1.0 and terminated.item() and info["fail"].item()
    assert "quaternion" in env.unwrapped.record.message


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"num_envs": 4}, "one trial on the CPU"),
        ({"sim_backend": "physx_cuda"}, "one trial on the CPU"),
        ({"obs_mode": "pointcloud"}, "is not one of state, state_dict, none, rgb"),
        ({"control_mode": "pd_ee_pose"}, "is not one of pd_joint_pos, ee, delta_ee"),
        ({"sensor_configs": {"shader_pack": "rt"}}, "width and height can be set"),
    ],
)
def test_what_is_not_to_be_had_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(SettingsError, match=reason):
        fake(**given)


def test_a_state_cannot_be_set() -> None:
    env = fake(obs_mode="none")
    env.reset(seed=100001)
    with pytest.raises(NotImplementedError, match="replay it by those"):
        env.unwrapped.set_state_dict(env.unwrapped.get_state_dict())


def test_vectors_of_maniskill_and_of_gymnasium() -> None:
    one = ManiSkillVectorEnv(fake(obs_mode="rgb"), ignore_terminations=True, record_metrics=True)
    one.reset(seed=100000)
    for _ in range(3):
        *_, info = one.step(torch.ones(1, 14))
    assert info["episode"]["success_once"].tolist() == [True]
    envs = gymnasium.vector.AsyncVectorEnv([partial(wrapped, number) for number in range(2)])
    try:
        seen, _ = envs.reset(seed=100000)
        assert seen["sensor_data"]["head"]["rgb"].shape == (2, 6, 8, 3)
        _, rewards, terminated, _, _ = envs.step(np.stack([ONES, ONES]))
        assert list(rewards) == [1.0, 0.0] and list(terminated) == [True, False]
    finally:
        envs.close()


def wrapped(number: int) -> Any:
    return CPUGymWrapper(fake(obs_mode="rgb"))


def test_what_maniskill_records_its_own_tool_replays(tmp_path: Path) -> None:
    env = RecordEpisode(
        fake(obs_mode="rgb", render_mode="rgb_array"), str(tmp_path), trajectory_name="mine"
    )
    env.reset(seed=100001)
    env.step(ONES)
    env.step(ONES)
    env.close()
    with contextlib.redirect_stdout(told := io.StringIO()):
        main(parse_args(["--traj-path", str(tmp_path / "mine.h5"), "--save-traj"]))
    assert "Replayed 1 episodes, 1/" in told.getvalue()
    assert list(tmp_path.glob("mine.*.h5")) and list(tmp_path.glob("*.mp4"))


def test_the_simulator_ends_as_in_a_run() -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (3, 14)).astype(np.float32)

    class Chunks(FakePolicy):
        def infer(self, observation: object) -> Any:
            return actions

    chunks = Chunks(PolicySpec("chunks", cameras=(), horizon=3))
    key = TrialKey("Pick_Blocks_Size", 3, 100000)
    world = SapienWorld(render=False)
    run_trial(world, chunks, key, policy_seed=0, step_scale=0.02)
    digest = world.digest()
    env = gymnasium.make("robospa.maniskill:RoboSPA-Pick_Blocks_Size-L3-v3", obs_mode="rgb+state")
    observation, _ = env.reset(seed=100000)
    assert observation["sensor_data"]["head"]["rgb"].float().std() > 5
    assert observation["state"].shape == (1, 42 + 640)
    for action in actions:
        env.step(action)
    assert env.unwrapped.task_env.trial.world.digest() == digest
    actors = env.unwrapped.get_state_dict()["actors"]
    assert actors and all(row[:, :7].isfinite().all() for row in actors.values())
    env.close()
