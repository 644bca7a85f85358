"""RoboSPA for inspect-robots: its variants as tasks, its robot as embodiment, its servers as policy.

Scenes are the accepted seeds, in order, with the sentences and step limits of `robospa eval`; an
action is one action of a policy. Importing this registers every task.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from inspect_robots.embodiment import EmbodimentBase, EmbodimentInfo
from inspect_robots.errors import ConfigError
from inspect_robots.policy import PolicyBase, PolicyConfig, PolicyInfo
from inspect_robots.registry import register
from inspect_robots.rollout import TrialRecord
from inspect_robots.scene import Scene, Target
from inspect_robots.scorer import Score
from inspect_robots.spaces import ActionSemantics, Box, CameraSpec, ObservationSpace
from inspect_robots.task import Task
from inspect_robots.types import Action, ActionChunk, Observation, StepResult

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
STATE = frozenset({"joint_pos", "ee"})


class RoboSPA(EmbodimentBase):
    """Two arms at a table. `out` keeps the actions of each trial, as a run of ours does."""

    def __init__(
        self, robot: str = REFERENCE, width: int = 320, height: int = 240, out: str = ""
    ) -> None:
        found = robot_named(robot)
        space = found.action_space("joint")
        low, high, labels = np.zeros(space.width), np.ones(space.width), [""] * space.width
        for side, columns, arm in zip(("left", "right"), space.arms, found.arms, strict=True):
            low[columns.body], high[columns.body] = chain_of(arm).lower, chain_of(arm).upper
            numbers = range(space.width)[columns.body]
            for number, column in enumerate(numbers, 1):
                labels[column] = f"{side}_j{number}"
            labels[columns.gripper] = f"{side}_gripper"
        # A limit of the whole range lets every action pass: however far, it takes its own time.
        steps = tuple(float(step) for step in high - low)
        meaning = ActionSemantics("joint_pos", "none", "continuous", "base", tuple(labels), steps)
        self.info = EmbodimentInfo(
            name=f"robospa:{robot}",
            action_space=Box((space.width,), low, high, meaning),
            observation_space=ObservationSpace(
                tuple(CameraSpec(name, height, width) for name in CAMERAS), STATE
            ),
            is_simulated=True,
            capabilities=frozenset({"seedable", "resettable", "privileged_success"}),
            docs="Absolute joint targets [rad]; grippers 0 (closed) to 1 (open). One action moves "
            "both arms to its targets, at 1 rad/s, however long that takes.",
            environment_id=f"robospa {robospa.__version__}",
            environment_revision=SUITE,
        )
        self._robot, self._size, self._out = robot, (width, height), out
        self._env: TaskEnv | None = None

    def reset(self, scene: Scene, *, seed: int | None = None) -> Observation:
        """The scene's accepted seed decides all; `seed` is what inspect-robots makes of it."""
        if "level" not in scene.metadata:
            raise ConfigError(f"{scene.id!r} is no scene of RoboSPA: choose --task robospa/...")
        self.close()
        self._env = TaskEnv(
            scene.metadata["task"],
            scene.metadata["level"],
            embodiment=self._robot,
            cameras=CAMERAS,
            size=self._size,
        )
        return _observation(self._env.reset(seed=scene.init_seed)[0])

    def step(self, action: Action) -> StepResult:
        """`info` of the last step has the trial's scores and the digests of our record."""
        assert self._env is not None
        seen, reward, terminated, truncated, info = self._env.step(np.float32(action.data))
        record = self._env.record
        if record is not None:
            info |= {"sr1": first_choice(record), "ps": record.best / record.total}
            if record.candidates > 1:
                info["onta"] = onta_of_bound(record.success, record.candidates)
            if self._out and self._env.trial is not None:
                (Path(self._out) / "actions").mkdir(parents=True, exist_ok=True)
                actions = np.stack(self._env.trial.actions)
                write_actions(Path(self._out), record.key, actions, "joint")
        reason = info["end"] or None
        return StepResult(_observation(seen), reward, terminated, reason, truncated, info)

    def close(self) -> None:
        """Close the simulator."""
        if self._env is not None:
            self._env.close()


def _observation(seen: dict[str, object]) -> Observation:
    state = {"joint_pos": seen["state"], "ee": np.ravel(seen["ee"])}
    return Observation(seen["images"], state, seen["instruction"])


class Served(PolicyBase):
    """The policy `at`: a server's URL in any dialect of robospa, or a local policy's name."""

    def __init__(self, at: str) -> None:
        self._policy = open_policy(at, {})
        self._spec = spec = self._policy.spec
        if spec.action != "joint" or spec.history or spec.sees_state:
            raise ConfigError(f"{spec.name} wants more than pictures, joints and joint actions")
        cameras = tuple(CameraSpec(one.name, one.height, one.width) for one in spec.cameras)
        meaning = ActionSemantics("joint_pos", gripper="continuous")
        box = Box((spec.action_dim or 14,), semantics=meaning)
        seen = ObservationSpace(cameras, frozenset({"joint_pos"}))
        self.info = PolicyInfo(spec.name, box, seen, checkpoint=spec.checkpoint or None)
        self.config = PolicyConfig(action_horizon=spec.horizon or 1, replan_interval=spec.execute)

    def bind(self, embodiment_info: EmbodimentInfo) -> None:
        """Refuse pictures of another size: nothing is scaled on the way."""
        self._robot = embodiment_info.name.partition(":")[2]
        given = embodiment_info.observation_space.cameras
        if wrong := [one for one in self.info.observation_space.cameras if one not in given]:
            size = f"-E width={wrong[0].width} -E height={wrong[0].height}"
            raise ConfigError(
                f"{self.info.name} reads {wrong[0].name} in another size: give {size}"
            )

    def reset(self, scene: Scene) -> None:
        """Begin the trial."""
        where = scene.metadata
        key = TrialKey(where["task"], where["level"], scene.init_seed or 0, self._robot)
        shown = key if self._spec.needs_trial_key else None
        seed = policy_seed(key, 0)
        self._policy.reset(
            robospa.TrialInfo(key.task, self._robot, scene.instruction, seed, scene.id, shown)
        )

    def act(self, observation: Observation) -> ActionChunk:
        """The actions that are executed before the next query."""
        chunk = self._policy.infer(
            {
                "images": dict(observation.images),
                "state": observation.state["joint_pos"],
                "ee": np.reshape(observation.state["ee"], (2, -1)),
                "instruction": observation.instruction,
                "step": observation.extra["env_step"],
            }
        )
        return ActionChunk([Action(row) for row in chunk])


@dataclass(frozen=True)
class FromRecord:
    """A score of our record, from the last step's `info`."""

    name: str

    def __call__(self, record: TrialRecord, target: Target | None) -> Score:
        """0 for a trial that never ended."""
        info = record.steps[-1].result.info if record.steps else {}
        return Score(info.get(self.name, 0.0), f"ended by {info.get('end') or 'an error'}")


def variant(task: str, level: int, trials: int = 100, robot: str = REFERENCE) -> Task:
    """The first `trials` accepted seeds of a variant."""
    seeds = find_list(ListKey(task, level, robot, "clean")).seeds[:trials]
    where = {"task": task, "level": level}
    scenes = [
        Scene(str(s), task_parts(TrialKey(task, level, s, robot)).instruction, None, s, None, where)
        for s in seeds
    ]
    found = find_task(task)
    names = ("sr1", *(["onta"] if found.dimension == "spatial" else ["ps"]))
    scorers = ["success_at_end", *map(FromRecord, names)]
    return Task(_name(task, level), scenes, scorers, max_steps=step_limit(found, level))


def _name(task: str, level: int) -> str:
    return f"robospa/{task.lower()}_l{level}"


for name, found in tasks().items():
    for level in found.levels:
        register("task", _name(name, level))(partial(variant, name, level))
first = partial(variant, "Pick_Blocks_Size", 1)
