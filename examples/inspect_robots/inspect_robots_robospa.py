"""RoboSPA for inspect-robots: variants as tasks, robots as embodiments, policy servers as policies.

Scenes are the accepted seeds, in order, with the sentences and step limits of `robospa eval`.
Importing this registers every task.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import inspect_robots as ir
import numpy as np
from inspect_robots.errors import ConfigError
from inspect_robots.registry import register

import robospa
from robospa.harness.factory import open_policy
from robospa.harness.gym.environment import TaskEnv
from robospa.harness.robots import embodiment as robot_named
from robospa.harness.robots.kinematics import chain_of
from robospa.harness.running.record_store import write_actions
from robospa.harness.seeds.lists import find_list
from robospa.harness.trial import policy_seed, step_limit, task_parts
from robospa.results.scoring.first_choice import first_choice
from robospa.results.statistics.samples import onta_of_bound
from robospa.tasks.catalog import task as find_task
from robospa.tasks.catalog import tasks
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey
from robospa.trial import REFERENCE, TrialKey

CAMERAS = ("head", "left_wrist", "right_wrist")


class RoboSPA(ir.EmbodimentBase):
    """Two arms at a table. `out` keeps the actions of each trial, as a run of ours does."""

    def __init__(
        self, robot: str = REFERENCE, width: int = 320, height: int = 240, out: str = ""
    ) -> None:
        arms = robot_named(robot).arms
        low = np.concatenate([(*chain_of(arm).lower, 0.0) for arm in arms])
        high = np.concatenate([(*chain_of(arm).upper, 1.0) for arm in arms])
        parts = [(*(f"j{n}" for n, _ in enumerate(arm.joints, 1)), "gripper") for arm in arms]
        labels = tuple(f"left_{p}" for p in parts[0]) + tuple(f"right_{p}" for p in parts[1])
        # A limit of the whole range lets every action pass: however far, it takes its own time.
        meaning = ir.ActionSemantics(
            "joint_pos", gripper="continuous", dim_labels=labels, max_step=tuple(high - low)
        )
        cameras = tuple(ir.CameraSpec(name, height, width) for name in CAMERAS)
        fields = ir.StateField("joint_pos", low.shape, "rad"), ir.StateField("ee", (2, 8))
        self.info = ir.EmbodimentInfo(
            name=f"robospa:{robot}",
            action_space=ir.Box(low.shape, low, high, meaning),
            observation_space=ir.ObservationSpace(cameras, state=ir.StateSpec(fields)),
            is_simulated=True,
            capabilities=frozenset({"seedable", "resettable", "privileged_success"}),
            docs="Absolute joint targets [rad]; grippers 0 (closed) to 1 (open). One action moves "
            "both arms to its targets, at 1 rad/s, however long that takes.",
            environment_id=f"robospa {robospa.__version__}",
            environment_revision=SUITE,
        )
        self._robot, self._size, self._out = robot, (width, height), out and Path(out)
        self._env: TaskEnv | None = None

    def reset(self, scene: ir.Scene, *, seed: int | None = None) -> ir.Observation:
        """The scene's accepted seed decides all; `seed` is what inspect-robots makes of it."""
        key = _key_of(scene, self._robot)
        self.close()
        self._env = TaskEnv(
            key.task, key.level, embodiment=key.embodiment, cameras=CAMERAS, size=self._size
        )
        return _observation(self._env.reset(seed=key.seed)[0])

    def step(self, action: ir.Action) -> ir.StepResult:
        """`info` of the last step has the digests of our record."""
        assert self._env is not None
        seen, reward, terminated, truncated, info = self._env.step(np.float32(action.data))
        record, trial = self._env.record, self._env.trial
        if record is not None and trial is not None:
            info["sr1"] = first_choice(record)
            if self._out:
                (self._out / "actions").mkdir(parents=True, exist_ok=True)
                write_actions(self._out, record.key, np.stack(trial.actions), "joint")
        reason = info["end"] or None
        return ir.StepResult(_observation(seen), reward, terminated, reason, truncated, info)

    def close(self) -> None:
        """Close the simulator."""
        if self._env is not None:
            self._env.close()


def _key_of(scene: ir.Scene, robot: str) -> TrialKey:
    where = scene.metadata
    if where.get("robot") != robot:
        wanted = f"--task robospa/... -T robot={robot}"
        raise ConfigError(f"{scene.id!r} is no scene of RoboSPA for {robot}: choose {wanted}")
    return TrialKey(where["task"], where["level"], scene.init_seed or 0, robot)


def _observation(seen: dict[str, object]) -> ir.Observation:
    state = {"joint_pos": seen["state"], "ee": seen["ee"]}
    return ir.Observation(seen["images"], state, seen["instruction"])


class Served(ir.PolicyBase):
    """The policy `at`: a server's URL in any dialect of robospa, or a local policy's name."""

    def __init__(self, at: str) -> None:
        self._policy = open_policy(at, {})
        self._spec = spec = self._policy.spec
        more = spec.history or spec.sees_state or spec.state == "measured"
        if more or spec.action != "joint":
            raise ConfigError(
                f"{spec.name} wants more than pictures, joints as commanded and joint actions"
            )
        cameras = tuple(ir.CameraSpec(one.name, one.height, one.width) for one in spec.cameras)
        meaning = ir.ActionSemantics("joint_pos", gripper="continuous")
        box = ir.Box((spec.action_dim or 14,), semantics=meaning)
        seen = ir.ObservationSpace(cameras)
        self.info = ir.PolicyInfo(spec.name, box, seen, checkpoint=spec.checkpoint or None)
        self.config = ir.PolicyConfig(spec.horizon or 1, spec.execute)

    def bind(self, embodiment_info: ir.EmbodimentInfo) -> None:
        """Refuse pictures of another size: nothing is scaled on the way."""
        self._robot = embodiment_info.name.partition(":")[2]
        if self._spec.action_dim is None:
            self.info = replace(self.info, action_space=embodiment_info.action_space)
        given = embodiment_info.observation_space.cameras
        if wrong := [one for one in self.info.observation_space.cameras if one not in given]:
            size = f"-E width={wrong[0].width} -E height={wrong[0].height}"
            raise ConfigError(
                f"{self.info.name} reads {wrong[0].name} in another size: give {size}"
            )

    def reset(self, scene: ir.Scene) -> None:
        """Begin the trial."""
        key = _key_of(scene, self._robot)
        shown = key if self._spec.needs_trial_key else None
        left, right = (len(arm.joints) for arm in robot_named(self._robot).arms)
        text, seed = scene.instruction, policy_seed(key, 0)
        self._policy.reset(
            robospa.TrialInfo(
                key.task, self._robot, text, seed, scene.id, shown, joints=(left, right)
            )
        )

    def act(self, observation: ir.Observation) -> ir.ActionChunk:
        """The actions that are executed before the next query."""
        chunk = self._policy.infer(
            {
                "images": dict(observation.images),
                "state": observation.state["joint_pos"],
                "ee": observation.state["ee"],
                "instruction": observation.instruction,
                "step": observation.extra["env_step"],
            }
        )
        return ir.ActionChunk([ir.Action(row) for row in chunk])


@dataclass(frozen=True)
class FromRecord:
    """`sr1`, `ps` or `onta` (among so many `candidates`) by the last step's `info`; a trial that a
    policy gave up has failed."""

    name: str
    candidates: int = 0

    def __call__(self, record: ir.TrialRecord, target: ir.Target | None) -> ir.Score:
        """The score, and how the trial ended."""
        info = record.steps[-1].result.info if record.steps else {}
        value = info.get("sr1", False)
        if self.name == "ps":
            value = info.get("done", 0) / max(1, info.get("total", 1))
        elif self.name == "onta":
            value = onta_of_bound(info.get("success", False), self.candidates)
        return ir.Score(value, f"ended by {info.get('end') or record.termination_reason}")


def variant(task: str, level: int, trials: int = 100, robot: str = REFERENCE) -> ir.Task:
    """The first `trials` accepted seeds of a variant."""
    seeds = find_list(ListKey(task, level, robot, "clean")).seeds[:trials]
    where = {"task": task, "level": level, "robot": robot}
    scenes = []
    for seed in seeds:
        text = task_parts(TrialKey(task, level, seed, robot)).instruction
        scenes.append(ir.Scene(str(seed), text, init_seed=seed, metadata=where))
    found = find_task(task)
    name = "onta" if found.dimension == "spatial" else "ps"
    other = FromRecord(name, found.levels[level].candidates)
    scorers = ["success_at_end", FromRecord("sr1"), other]
    return ir.Task(_name(task, level), scenes, scorers, max_steps=step_limit(found, level))


def _name(task: str, level: int) -> str:
    return f"robospa/{task.lower()}_l{level}"


for name, found in tasks().items():
    for level in found.levels:
        register("task", _name(name, level))(partial(variant, name, level))
first = partial(variant, "Pick_Blocks_Size", 1)
