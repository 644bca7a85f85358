"""A task as a Gymnasium environment: the trials of the runner, stepped one action at a time.

An environment's step is one action of a policy. Scene, instruction, physics, goal and step limit
are those of `robospa eval`, so that the same seed and the same actions end in the same digest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from operator import index
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector.utils import read_from_shared_memory
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.extras import need
from robospa.harness.factory import load_function
from robospa.harness.robots import embodiment as robot_named
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.kinematics import chain_of
from robospa.harness.seeds.lists import find_list
from robospa.harness.settings import Selection, SettingsError, Simulation
from robospa.harness.trial import (
    TrialState,
    open_trial,
    policy_seed,
    record_of,
    step_limit,
)
from robospa.harness.world import ActionError, World
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS, open_world
from robospa.observation import DEFAULT_CAMERAS, WIDTH, CameraSpec
from robospa.protocol.errors import DecodeError, PolicyError
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import task as find_task
from robospa.tasks.catalog import tasks
from robospa.tasks.events import outcome
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey
from robospa.trial import REFERENCE, TrialKey

USUAL_CAMERAS = tuple(camera.name for camera in DEFAULT_CAMERAS)
Observation = dict[str, Any]
Info = dict[str, Any]


class TaskEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """One variant of a task with one robot.

    Observations are those of a policy with the spec `spec`; without one, of a policy that reads
    `cameras` of `size` (width, height) [px] and the `state`, and answers actions of the space
    `action` ("joint", "ee" or "delta_ee"). The reward is 1 for the action that meets the goal.

    `reset(seed=s)` starts the trial of the seed s; without a seed one of `seeds` is drawn, by
    default of the variant's accepted seeds. `split` chooses the instructions, `mode` what surrounds
    the objects, `control` and `step_scale` are those of `robospa eval`. `render_camera` and
    `render_size` are what `render` shows.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        task: str,
        level: int = 1,
        *,
        embodiment: str = REFERENCE,
        mode: str = "clean",
        split: str = "heldout",
        spec: PolicySpec | None = None,
        cameras: Sequence[str] = USUAL_CAMERAS,
        size: tuple[int, int] = (320, 240),
        state: str = "commanded",
        action: str = "joint",
        seeds: Sequence[int] | None = None,
        control: str = "rest_to_rest",
        step_scale: float = 1.0,
        render_mode: str | None = None,
        render_camera: str = "third",
        render_size: tuple[int, int] = (640, 480),
        world: str = SAPIEN_NAME,
        parts: str = TASK_PARTS,
    ) -> None:
        found = find_task(task)
        if level not in found.levels:
            raise SettingsError(f"{found.name} has levels {sorted(found.levels)}, not {level}")
        level = int(level)  # equal numbers of other types would be other scenes
        if render_mode not in (None, "rgb_array"):
            raise SettingsError(f"render_mode {render_mode!r} is not rgb_array or None")
        if seeds is not None and (not len(seeds) or min(seeds) < 0):
            raise SettingsError("seeds are one or more whole numbers from 0 up")
        Selection(split=split)
        Simulation(control=control, step_scale=step_scale)
        self._camera = CameraSpec(render_camera, *map(index, render_size))
        check_spec(PolicySpec("render", cameras=(self._camera,)))
        self.spec_of_policy = spec or PolicySpec(
            "gymnasium",
            cameras=tuple(CameraSpec(name, *map(index, size)) for name in cameras),
            state=state,
            action=action,
        )
        check_spec(self.spec_of_policy)
        self.render_mode = render_mode
        self.max_steps = step_limit(found, level, step_scale)
        self._key = TrialKey(found.name, level, 0, embodiment, mode, split)
        robot = robot_named(embodiment)
        box = action_space(robot, kind := self.spec_of_policy.action)
        if self.spec_of_policy.action_dim not in (None, *box.shape):
            raise SettingsError(
                f"the spec has action_dim {self.spec_of_policy.action_dim}, but a {kind} action of "
                f"{embodiment} has {box.shape[0]} numbers: leave it out"
            )
        self.action_space = box  # type: ignore[assignment]
        self.observation_space = observation_space(self.spec_of_policy, robot, self.max_steps)
        self._seeds = seeds
        self._world_kind = world
        self._world_arguments = {"control": control} if world == SAPIEN_NAME else {}
        self._parts = load_function(parts)
        # What simulates is opened at the first reset: a vector's parent only looks at the spaces.
        self._world: World | None = None
        self._trial: TrialState | None = None
        self._record: TrialRecord | None = None
        self._told = 0

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, Info]:
        """Start the trial of `seed`, or of one that is drawn; there are no options.

        Raises SceneUnstable or LayoutError for a seed that has no valid scene, NoSeedList if there
        is none to draw from.
        """
        super().reset(seed=seed)
        self._trial = self._record = None  # so they stay if this seed has no scene
        self._told = 0
        self._key = replace(self._key, seed=self._draw() if seed is None else int(seed))
        setup = self._parts(self._key)
        self._trial = open_trial(self._opened(), self._key, setup)
        if self._trial.start():
            self._finish(self._trial.end, "the goal was decided before the first action")
        about = {**asdict(self._key), "instruction": self.instruction}
        return self._observation(), {**self._info(), **about}

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, Info]:
        """Execute one action, float32 (D,).

        Terminated are success, a goal that can no longer be met, and an action that cannot be
        executed (`info["end"]` is "policy_error", `info["message"]` says why); truncated is the
        step limit.
        """
        trial = self._trial
        if trial is None or self._record is not None:
            raise ResetNeeded("the trial is over: call reset() before the next step")
        spec = self.spec_of_policy
        problems: tuple[str, ...] = ()
        try:
            (row,) = trial.checked(np.asarray(action, np.float32)[None], spec)
            ended = trial.execute(row, spec.action)
            problems = trial.last_problems
            if ended:
                self._finish(trial.end)
            elif len(trial.actions) >= self.max_steps:
                self._finish("step_limit")
        except (ActionError, PolicyError) as error:
            self._finish("policy_error", str(error))
        end = "" if self._record is None else self._record.end
        info = {**self._info(), "problems": list(problems)}
        success = end == "success"
        terminated, truncated = end not in ("", "step_limit"), end == "step_limit"
        return self._observation(), float(success), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """The picture of this instant, uint8 (height, width, 3); None without "rgb_array"."""
        if self.render_mode is None or self._trial is None:
            return None
        return self._opened().render(self._camera)

    def close(self) -> None:
        if self._world is not None:
            self._world.close()
            self._world = None
        self._trial = None

    @property
    def key(self) -> TrialKey:
        """The trial that was last started."""
        return self._key

    @property
    def instruction(self) -> str:
        """The sentence of the trial; empty before the first one."""
        return "" if self._trial is None else self._trial.parts.instruction

    @property
    def trial(self) -> TrialState | None:
        """The trial that was last started, with its world, scene and events; None before it."""
        return self._trial

    @property
    def record(self) -> TrialRecord | None:
        """The record of the trial that is over, as a run writes it; None while it goes on."""
        return self._record

    def _draw(self) -> int:
        """One of the seeds, by this environment's own generator."""
        key = self._key
        if self._seeds is None:
            place = ListKey(key.task, key.level, key.embodiment, key.mode)
            self._seeds = find_list(place).seeds
        return int(self._seeds[int(self.np_random.integers(len(self._seeds)))])

    def _opened(self) -> World:
        if self._world is None:
            opened: World = open_world(self._world_kind, self._world_arguments)
            self._world = opened
        return self._world

    def _observation(self) -> Observation:
        assert self._trial is not None
        found = dict(self._trial.observation(self.spec_of_policy))
        return {
            name: space_of(name, found[name])
            for name in self.observation_space.spaces  # type: ignore[attr-defined]
        }

    def _finish(self, end: str, message: str = "") -> None:
        assert self._trial is not None
        self._trial.finish()
        seed, steps = policy_seed(self._key, 0), len(self._trial.actions)
        self._record = record_of(self._trial, self._key, end, message, seed, range(steps))

    def _info(self) -> Info:
        trial = self._trial
        assert trial is not None
        reached = outcome(trial.events, trial.parts.tracker.total)
        new, self._told = trial.rows(self._told), len(trial.events)
        info: Info = {
            "success": bool(reached.success),
            "end": "",
            "done": reached.done,
            "best": reached.best,
            "total": trial.parts.tracker.total,
            "steps": len(trial.actions),
            "events": [dict(row) for row in new],
        }
        if self._record is not None:
            for name in ("end", "message", "digest", "actions_digest"):
                info[name] = getattr(self._record, name)
        return info


def space_of(name: str, value: Any) -> Any:
    """An entry of an observation as its space has it: copies, because the world keeps its own."""
    if name == "images":
        return {camera: np.array(image) for camera, image in value.items()}
    if name == "step":
        return np.int64(value)
    return value if isinstance(value, str) else np.array(value, dtype=np.float32)


NAMESPACE = "RoboSPA"
ENTRY = "robospa.harness.gym.environment:TaskEnv"


def env_id(task: str) -> str:
    """The id of `task`; another suite has other ids, because its trials are others."""
    return f"{NAMESPACE}/{task}-v{SUITE.rpartition('-')[2]}"


def register_tasks() -> None:
    """Register every task that is not registered yet; raises MissingPackage without Gymnasium."""
    registration = need("gymnasium.envs.registration")
    for name in tasks():
        if env_id(name) not in registration.registry:
            registration.register(env_id(name), entry_point=ENTRY, kwargs={"task": name})


SENTENCE = 1000
"""Most characters of an instruction."""
LETTERS = "".join(map(chr, range(32, 127)))
"""What instructions are written in: printable ASCII."""
BEYOND = 0.5
"""How far [rad], or of a gripper's unit, a measured joint may be beyond its limit."""
FARTHEST = 3.0
"""[m] No end effector is that far from the world's origin."""

Bounds = tuple[NDArray[np.float32], NDArray[np.float32]]


class SentenceSpace(spaces.Text):
    """Sentences that environments in processes of their own show as they are now: of its own text
    Gymnasium keeps what was in the shared memory before the first reset."""


class _Sentences(Sequence[str]):
    """The present sentences of several environments, in shared memory; copied, a tuple."""

    def __init__(self, space: SentenceSpace, memory: Any, n: int = 1) -> None:
        self._place = (space, memory, n)

    def __deepcopy__(self, memo: object) -> tuple[str, ...]:
        return tuple(read_from_shared_memory.dispatch(spaces.Text)(*self._place))

    def __getitem__(self, place: Any) -> Any:
        return self.__deepcopy__(None)[place]

    def __len__(self) -> int:
        return self._place[2]


read_from_shared_memory.register(SentenceSpace, _Sentences)  # type: ignore[arg-type]


def check_spec(spec: PolicySpec) -> None:
    """SettingsError for what an environment cannot give, and what no policy may ask for."""
    try:
        PolicySpec.from_json(spec.to_json())
    except DecodeError as error:
        raise SettingsError(str(error)) from None
    if spec.history:
        raise SettingsError(
            "an environment gives no history: stack its observations with Gymnasium's wrappers"
        )
    if spec.privileged:
        raise SettingsError(
            "an environment gives no privileged state: ask for environment_state, which is numbers"
        )


def action_space(robot: Embodiment, kind: str) -> spaces.Box:
    """Of one action, float32 (D,): joints within the limits in which the robot's own kinematics
    looks, positions [m] over the table, quaternions, grippers from 0 (closed) to 1 (open).

    It is what is sampled from. What lies outside is executed too, as a policy's would be.
    """
    space = robot.action_space(kind)
    low, high = _joint_bounds(robot, working=True) if kind == "joint" else _pose_bounds(space)
    return spaces.Box(low, high, dtype=np.float32)


def _joint_bounds(robot: Embodiment, working: bool) -> Bounds:
    space = robot.action_space("joint")
    low, high = np.zeros(space.width, np.float32), np.ones(space.width, np.float32)
    for columns, arm in zip(space.arms, robot.arms, strict=True):
        chain = chain_of(arm)
        low[columns.body] = chain.working_lower if working else chain.lower
        high[columns.body] = chain.working_upper if working else chain.upper
    return low, high


def _pose_bounds(space: ActionSpace) -> Bounds:
    low, high = np.zeros(space.width, np.float32), np.ones(space.width, np.float32)
    reach = 0.05 if space.kind == "delta_ee" else 1.0
    for columns in space.arms:
        low[columns.position], high[columns.position] = -reach, reach
        low[columns.quaternion], high[columns.quaternion] = -1.0, 1.0
        if space.kind == "ee":
            low[columns.position][2], high[columns.position][2] = 0.7, 1.2
    return low, high


def observation_space(spec: PolicySpec, robot: Embodiment, limit: int) -> spaces.Dict:
    """Of an observation (`robospa.Observation`) as `spec` asks for it; `limit` is the number of
    actions that a trial may have. `ee`: per arm x y z [m], qw qx qy qz, gripper."""
    images: dict[str, spaces.Space[object]] = {
        camera.name: spaces.Box(0, 255, (camera.height, camera.width, 3), np.uint8)
        for camera in spec.cameras
    }
    parts: dict[str, spaces.Space[object]] = {"images": spaces.Dict(images)} if images else {}
    if spec.state != "none":
        low, high = _joint_bounds(robot, working=False)
        parts["state"] = spaces.Box(
            low - np.float32(BEYOND), high + np.float32(BEYOND), dtype=np.float32
        )
    high = np.ones((2, 8), np.float32) * 1.01
    high[:, :3], high[:, 7] = FARTHEST, 1.0 + BEYOND
    low = -high
    low[:, 7] = -BEYOND
    parts["ee"] = spaces.Box(low, high, dtype=np.float32)
    if spec.environment_state:
        parts["environment_state"] = spaces.Box(-np.inf, np.inf, (WIDTH,), np.float32)
    parts["instruction"] = SentenceSpace(SENTENCE, charset=LETTERS)
    parts["step"] = spaces.Discrete(limit + 1)
    return spaces.Dict(parts)
