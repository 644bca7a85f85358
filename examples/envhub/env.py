"""RoboSPA on LeRobot's EnvHub: `lerobot.envs.factory.make_env("OWNER/robospa", ...)` calls this.

ROBOSPA_TASKS and ROBOSPA_LEVELS choose among the variants, as `robospa eval` reads them.
"""

from __future__ import annotations

import os

from gymnasium.vector import VectorEnv
from lerobot.envs.configs import EnvConfig

from robospa.harness.gym.lerobot import RoboSPAConfig


def make_env(
    n_envs: int = 1, use_async_envs: bool = False, cfg: EnvConfig | None = None
) -> dict[str, dict[int, VectorEnv]]:
    """{task: {level: environments}}; `cfg.task` names tasks, too."""
    tasks = (cfg and cfg.task) or os.environ.get("ROBOSPA_TASKS", "all")
    levels = os.environ.get("ROBOSPA_LEVELS", "1-5")
    return RoboSPAConfig(task=tasks, levels=levels).create_envs(n_envs, use_async_envs)
