"""RoboSPA as a benchmark of vla-eval 0.8, run by its orchestrator in this environment, no Docker.

    pip install vla-eval '/path/to/robospa[sim,gym]'
    PYTHONPATH=examples/vla_eval vla-eval run --no-docker --config examples/vla_eval/robospa.yaml

Observations are named as those of vla-eval's RoboTwin benchmark, so that a server for that one
serves this one. Episode n of a variant is its accepted seed number n, as in `robospa eval`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from vla_eval.benchmarks.base import StepBenchmark, StepResult
from vla_eval.specs import IMAGE_RGB, LANGUAGE, STATE_JOINT, DimSpec

from robospa.harness.gym.environment import TaskEnv
from robospa.harness.seeds.lists import find_list
from robospa.harness.selection import parse_levels, parse_tasks
from robospa.results.scoring.first_choice import first_choice
from robospa.tasks.catalog import task as find_task
from robospa.tasks.seeds import ListKey
from robospa.trial import REFERENCE

NAMES = {"head": "head_camera", "left_wrist": "left_camera", "right_wrist": "right_camera"}


class RoboSPABenchmark(StepBenchmark):
    """`tasks` and `levels` as in `robospa eval`; every variant is a task of vla-eval's."""

    render_backends = frozenset({"gpu", "cpu"})  # whichever Vulkan device there is

    def __init__(
        self,
        tasks: str = "all",
        levels: str = "1-5",
        robot: str = REFERENCE,
        split: str = "heldout",
    ) -> None:
        super().__init__()
        wanted = parse_levels(levels)
        found = [find_task(name) for name in parse_tasks(tasks)]
        self._variants = [(task, n) for task in found for n in sorted(task.levels) if n in wanted]
        self._robot, self._split = robot, split
        self._env: TaskEnv | None = None

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """The simulator finds its device by itself."""
        return {}

    def get_tasks(self) -> list[dict[str, Any]]:
        """Named as in our tables, with the category as suite."""
        return [
            {"name": f"{task.name} L{n}", "suite": task.category, "task": task.name, "level": n}
            for task, n in self._variants
        ]

    def reset(self, task: dict[str, Any]) -> Any:
        """Start the trial of the accepted seed number `episode_idx`; IndexError beyond the list."""
        self.cleanup()
        name, level = task["task"], task["level"]
        seeds = find_list(ListKey(name, level, self._robot, "clean")).seeds
        self._env = TaskEnv(name, level, embodiment=self._robot, split=self._split)
        return self._env.reset(seed=seeds[task["episode_idx"]])[0]

    def step(self, action: dict[str, Any]) -> StepResult:
        """One action, (14,); a wrong width ends the trial as an error of the policy."""
        assert self._env is not None
        row = np.asarray(action["actions"], np.float32)
        seen, reward, terminated, truncated, info = self._env.step(row)
        return StepResult(seen, reward, terminated or truncated, info)

    def make_obs(self, raw_obs: Any, task: dict[str, Any]) -> dict[str, Any]:
        """Pictures, joints as commanded, and the trial's sentence."""
        return {
            "images": {NAMES[name]: image for name, image in raw_obs["images"].items()},
            "joint_state": raw_obs["state"],
            "task_description": raw_obs["instruction"],
        }

    def get_step_result(self, step_result: StepResult) -> dict[str, Any]:
        """SR, SR@1 and PS of our record, and how the trial ended."""
        record = self._env.record if self._env is not None else None
        if record is None:
            return {"success": False, "end": "stopped"}
        done = record.done / max(1, record.total)
        sr1 = first_choice(record)
        return {"success": record.success, "sr1": sr1, "ps": done, "end": record.end}

    def get_metric_keys(self) -> dict[str, str]:
        """What vla-eval averages."""
        return {"success": "mean", "sr1": "mean", "ps": "mean"}

    def get_metadata(self) -> dict[str, Any]:
        """The longest step limit; each trial ends at its own."""
        limits = [task.levels[level].steps for task, level in self._variants]
        return {"max_steps": max(limits, default=1), "max_episodes_per_task": 100}

    def get_action_spec(self) -> dict[str, DimSpec]:
        """Absolute joints [rad], left arm first; grippers from 0 (closed) to 1."""
        return {"joints": DimSpec("joints", 14, "joint_positions")}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        """Three pictures, joints and text."""
        images = dict.fromkeys(NAMES.values(), IMAGE_RGB)
        return {**images, "state": STATE_JOINT, "language": LANGUAGE}

    def cleanup(self) -> None:
        """Close the simulator."""
        if self._env is not None:
            self._env.close()
