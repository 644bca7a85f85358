"""The tasks as LeRobot's own command line expects an environment.

    lerobot-eval --policy.path=CHECKPOINT --env.discover_packages_path=robospa.harness.gym
        --env.type=robospa --env.task=Pick_Blocks_Size --env.levels=1,3 --seed=0

LeRobot counts seeds up from `--seed`. Here they count the accepted seeds of each variant, so that
`--seed=0 --eval.n_episodes=100` are the hundred trials of `robospa eval`, with their sentences.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.envs.utils import _LazyAsyncVectorEnv
from numpy.typing import NDArray

from robospa.harness.gym.environment import TaskEnv
from robospa.harness.robots import embodiment as robot_named
from robospa.harness.seeds.lists import find_list
from robospa.harness.selection import parse_levels, parse_tasks
from robospa.harness.settings import SettingsError
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS
from robospa.tasks.seeds import ListKey
from robospa.trial import REFERENCE

Observation = dict[str, Any]
Info = dict[str, Any]
FPS = 10
"""Frames a second of LeRobot's videos, which show one frame an action."""


class LeRobotEnv(gymnasium.Wrapper[Observation, Any, Observation, Any]):
    """A `TaskEnv` whose observation is LeRobot's: `pixels` {camera: uint8 (height, width, 3)} and
    `agent_pos`, float32 (D,). `seeds` are the accepted ones, which a seed counts."""

    def __init__(self, env: TaskEnv, seeds: tuple[int, ...]) -> None:
        super().__init__(env)
        self._inner, self._seeds = env, seeds
        whole = env.observation_space
        assert isinstance(whole, spaces.Dict)
        self.observation_space = spaces.Dict(
            {"pixels": whole["images"], "agent_pos": whole["state"]}
        )
        self.metadata = {**env.metadata, "render_fps": FPS}

    @property
    def task(self) -> str:
        return self._inner.key.task

    @property
    def task_description(self) -> str:
        """The sentence of the trial, which the policy gets."""
        return self._inner.instruction

    @property
    def _max_episode_steps(self) -> int:
        return self._inner.max_steps

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Start the trial of accepted seed number `seed`, counted from 0, round and round."""
        trial = None if seed is None else self._seeds[seed % len(self._seeds)]
        observation, info = self._inner.reset(seed=trial)
        return _as_lerobot(observation), {**info, "is_success": info["success"]}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, Info]:
        observation, reward, terminated, truncated, info = self._inner.step(action)
        told = {**info, "is_success": info["success"]}
        return _as_lerobot(observation), reward, terminated, truncated, told


def _as_lerobot(observation: Observation) -> Observation:
    return {"pixels": observation["images"], "agent_pos": observation["state"]}


@EnvConfig.register_subclass("robospa")
@dataclass
class RoboSPAConfig(EnvConfig):
    """`--env.type=robospa`: every field is `--env.NAME`; `task` and `levels` are those of
    `robospa eval`, and each variant is evaluated for itself."""

    task: str | None = "Pick_Blocks_Size"
    fps: int = FPS
    levels: str = "1"
    cameras: str = "head,left_wrist,right_wrist"
    width: int = 320
    height: int = 240
    state: str = "commanded"
    action: str = "joint"
    embodiment: str = REFERENCE
    mode: str = "clean"
    split: str = "heldout"
    control: str = "rest_to_rest"
    step_scale: float = 1.0
    world: str = SAPIEN_NAME
    """For tests: module:function of another world."""
    parts: str = TASK_PARTS
    """For tests: module:function of a trial's scene and goal."""
    features: dict[str, PolicyFeature] = field(default_factory=dict)
    features_map: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        robot = robot_named(self.embodiment)
        if self.state == "none":
            raise SettingsError("LeRobot's policies read a state: commanded or measured")
        numbers = {
            "agent_pos": (FeatureType.STATE, robot.action_space("joint").width),
            "action": (FeatureType.ACTION, robot.action_space(self.action).width),
        }
        names = [name.strip() for name in self.cameras.split(",")]
        self.features = {
            **{name: PolicyFeature(kind, (width,)) for name, (kind, width) in numbers.items()},
            **{
                f"pixels/{name}": PolicyFeature(FeatureType.VISUAL, (self.height, self.width, 3))
                for name in names
            },
        }
        self.features_map = {
            "agent_pos": "observation.state",
            "action": "action",
            **{f"pixels/{name}": f"observation.images.{name}" for name in names},
        }

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        same = ("embodiment", "mode", "split", "state", "action", "control", "step_scale")
        return {
            **{name: getattr(self, name) for name in (*same, "world", "parts")},
            "cameras": [name.strip() for name in self.cameras.split(",")],
            "size": (self.width, self.height),
            "render_mode": "rgb_array",
        }

    def create_envs(
        self, n_envs: int, use_async_envs: bool = False
    ) -> dict[str, dict[int, VectorEnv]]:
        """{task: {level: environments}}; processes of their own start when they are first used."""
        found: dict[str, dict[int, VectorEnv]] = {}
        for task in parse_tasks(self.task or ""):
            for level in parse_levels(self.levels):
                make = [self._maker(task, level)] * n_envs
                made = (
                    _LazyAsyncVectorEnv(make)
                    if use_async_envs and n_envs > 1
                    else SyncVectorEnv(make, autoreset_mode=AutoresetMode.SAME_STEP)
                )
                found.setdefault(task, {})[level] = made
        return found

    def _maker(self, task: str, level: int) -> Callable[[], LeRobotEnv]:
        seeds = find_list(ListKey(task, level, self.embodiment, self.mode)).seeds
        arguments = self.gym_kwargs
        return lambda: LeRobotEnv(TaskEnv(task, level, **arguments), seeds)
