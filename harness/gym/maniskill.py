"""The tasks as ManiSkill's environments: its interface outside, our trial inside.

A `BaseEnv` builds its scene once and moves things in it, steps it at a fixed rate and judges it
after every control step. A trial of ours has a fresh scene, actions that last as long as their way,
and a goal that watches at 50 Hz. So nothing here is built by ManiSkill: what it computes from a
scene comes from the trial, and what it computes from that (observation modes, spaces, rewards,
recording) is its own. An episode is a trial, and `reset(seed=s)` the trial of the seed s.

An observation is a tree of arrays whose first axis is ManiSkill's batch, or time; what is in it
says docs/gymnasium.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.envs.registration import registry
from mani_skill.envs.sapien_env import BaseEnv
from mani_skill.envs.utils.observations import parse_obs_mode_to_struct
from mani_skill.envs.utils.system.backend import CPU_SIM_BACKENDS, parse_sim_and_render_backend
from mani_skill.utils import common
from mani_skill.utils.registration import register_env
from mani_skill.utils.visualization.misc import tile_images
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.harness.gym.environment import USUAL_CAMERAS, TaskEnv
from robospa.harness.robots import embodiment as robot_named
from robospa.harness.settings import SettingsError
from robospa.harness.trial import step_limit
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import task as find_task
from robospa.tasks.catalog import tasks
from robospa.tasks.scene import SUITE
from robospa.trial import REFERENCE

CONTROL_MODES = {"pd_joint_pos": "joint", "ee": "ee", "delta_ee": "delta_ee"}
"""Our action spaces by control mode. Poses keep our names: ManiSkill's `pd_ee_pose` has another
frame and another rotation."""
OBS_MODES = ("state", "state_dict", "none", "rgb", "rgb+state", "rgb+state_dict")
PHYSICS_HZ, FILM_HZ = 250, 10
"""Steps of the simulator, and frames of films, a second: an action of ours has no fixed length."""
STATE = 13
"""Numbers of an actor's state: x y z [m], qw qx qy qz, velocities."""
Info = dict[str, Any]


class RoboSPAEnv(BaseEnv):
    """One variant of a task with one robot, `robot_uids`, for ManiSkill.

    `mode`, `split`, `seeds` and `control` are those of `TaskEnv`, which is `task_env`. Pictures are
    those of `cameras`, whose width and height [px] `sensor_configs` may set, for all or by name;
    `human_render_camera_configs` sets those of `render_camera`, which `render` shows.
    """

    SUPPORTED_OBS_MODES = OBS_MODES
    SUPPORTED_REWARD_MODES = ("sparse", "none")

    def __init__(
        self,
        task: str,
        level: int,
        *,
        num_envs: int = 1,
        obs_mode: str | None = None,
        reward_mode: str | None = None,
        control_mode: str | None = None,
        render_mode: str | None = None,
        robot_uids: str = REFERENCE,
        sensor_configs: Mapping[str, Any] | None = None,
        human_render_camera_configs: Mapping[str, int] | None = None,
        reconfiguration_freq: int | None = None,
        sim_backend: str = "auto",
        render_backend: str = "cpu",
        cameras: Sequence[str] = USUAL_CAMERAS,
        render_camera: str = "third",
        mode: str = "clean",
        split: str = "heldout",
        seeds: Sequence[int] | None = None,
        control: str = "rest_to_rest",
        world: str = SAPIEN_NAME,
        parts: str = TASK_PARTS,
    ) -> None:
        del reconfiguration_freq  # every trial has a scene of its own
        if num_envs != 1 or sim_backend not in ("auto", *CPU_SIM_BACKENDS):
            raise SettingsError(
                f"num_envs={num_envs} with sim_backend={sim_backend!r} is not to be had: an "
                "environment is one trial on the CPU; for several at once give "
                "gymnasium.vector.AsyncVectorEnv one each"
            )
        self.num_envs, self.reconfiguration_freq = 1, 1
        self.backend = parse_sim_and_render_backend(BACKEND, render_backend)
        self.device = self.backend.device
        self.robot_uids = robot_uids
        self._sim_freq, self._control_freq = PHYSICS_HZ, FILM_HZ
        self._obs_mode = _one_of("obs_mode", obs_mode, OBS_MODES)
        self.obs_mode_struct = parse_obs_mode_to_struct(self._obs_mode)
        self._reward_mode = _one_of("reward_mode", reward_mode, self.SUPPORTED_REWARD_MODES)
        self._control_mode = _one_of("control_mode", control_mode, tuple(CONTROL_MODES))
        self.render_mode = render_mode
        self._sensors: dict[str, Any] = {}
        seen = cameras if self.obs_mode_struct.visual.rgb else ()
        spec = PolicySpec(
            "maniskill",
            cameras=_cameras(seen, sensor_configs or {}),
            state="measured",
            action=CONTROL_MODES[self._control_mode],
            environment_state=self.obs_mode_struct.use_state,
        )
        self._commands = PolicySpec("maniskill", cameras=(), state="commanded", action=spec.action)
        size = {"width": 640, "height": 480, **(human_render_camera_configs or {})}
        self.task_env = TaskEnv(
            task, level, embodiment=robot_uids, mode=mode, split=split, spec=spec, seeds=seeds,
            control=control,
            render_mode=render_mode if render_mode in (None, "human") else "rgb_array",
            render_camera=render_camera, render_size=(size["width"], size["height"]),
            world=world, parts=parts,
        )  # fmt: skip
        sizes = {camera.name: (camera.width, camera.height) for camera in spec.cameras}
        self._sensor_params = common.to_tensor(sensor_params(robot_uids, sizes, 1))
        self._elapsed_steps = torch.zeros(1, dtype=torch.int32)
        self._episode_seed = np.zeros(1, np.int64)
        self.agent = _Robot(robot_uids, self._control_mode, self.task_env.action_space)
        self.action_space = self.single_action_space = self.agent.action_space
        self._show(_nothing(self.task_env.observation_space))
        self._init_raw_obs = self._last_obs = self.get_obs({})
        # BaseEnv forgets both before it makes them anew, so they have to be there.
        _ = self.single_observation_space, self.observation_space

    def reset(
        self,
        seed: int | Sequence[int] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Any, Info]:
        """Start the trial of `seed`, or of one of the variant's accepted seeds."""
        if options and "reset_to_env_states" in options:
            raise _no_states()
        one = int(np.asarray(seed).ravel()[0]) if seed is not None else None
        observation, told = self.task_env.reset(seed=one)
        self._episode_seed = np.array([told["seed"]])
        self._elapsed_steps = torch.zeros(1, dtype=torch.int32)
        self._show(observation, told)
        info = self.get_info()
        self._last_obs = self.get_obs(info)
        # The scene is another one: what was recorded of the last must not be joined to this.
        return self._last_obs, {**info, "reconfigure": True}

    def _step_action(self, action: NDArray[np.float32] | torch.Tensor | None) -> torch.Tensor:
        """Execute one action, (D,) or (1, D). A trial that is over stays as it is."""
        if action is None or isinstance(action, dict):
            raise TypeError("an action of a trial is an array; there is no step without one")
        row: NDArray[np.float32] = common.to_numpy(action).reshape(-1)
        if self.task_env.record is None:
            observation, *_, told = self.task_env.step(row)
            self._show(observation, told)
        return torch.from_numpy(np.asarray(row, np.float32))[None]

    def evaluate(self) -> Info:
        """Success and failure for good (bool), subtasks `done`, `best` and in `total` (int64)."""
        ended = "" if self.record is None else self.record.end
        failed = ended not in ("", "success", "step_limit")
        counts = {name: torch.tensor([self._told[name]]) for name in ("done", "best", "total")}
        success = torch.tensor([bool(self._told["success"])])
        return {"success": success, "fail": torch.tensor([failed]), **counts}

    def close(self) -> None:
        self.task_env.close()

    def _show(self, observation: Mapping[str, Any], told: Mapping[str, Any] | None = None) -> None:
        """Keep what a trial, or before the first an empty one, shows and tells now."""
        self._told = told or {"success": False, "done": 0, "best": 0, "total": 0}
        trial = self.task_env.trial
        measured = observation["state"]
        commanded = measured if trial is None else trial.observation(self._commands)["state"].copy()
        tree = proprioception(
            measured[None],
            commanded[None],
            observation["ee"][None],
            observation["environment_state"][None] if self.obs_mode_struct.use_state else None,
        )
        self._seen: Tree = common.to_tensor(tree)
        images = observation.get("images", {})
        self._pictures = {name: torch.from_numpy(image)[None] for name, image in images.items()}

    def _get_obs_agent(self) -> Tree:
        return dict(self._seen["agent"])

    def _get_obs_extra(self, info: Info) -> Tree:
        return dict(self._seen["extra"])

    def get_sensor_params(self) -> Tree:
        """The cameras' matrices; where they are is not told."""
        return dict(self._sensor_params)

    def _get_obs_sensor_data(self, apply_texture_transforms: bool = True) -> Tree:
        return {name: {"rgb": image} for name, image in self._pictures.items()}

    def get_sensor_images(self) -> Tree:
        return self._get_obs_sensor_data()

    def render_rgb_array(self, camera_name: str | None = None) -> torch.Tensor | None:
        """The picture of `render_camera`, uint8 (1, height, width, 3)."""
        picture = self.task_env.render()
        return None if picture is None else torch.from_numpy(picture)[None]

    def render_human(self) -> None:
        self.task_env.render()

    def render_all(self) -> torch.Tensor:
        return tile_images([self.render_rgb_array(), *self._pictures.values()])

    @property
    def record(self) -> TrialRecord | None:
        """The record of the trial that is over, as a run writes it; None while it goes on."""
        return self.task_env.record

    def get_language_instruction(self) -> list[str]:
        return [self.task_env.instruction]

    def get_state_dict(self) -> Tree:
        """`actors`: of every object its pose, (1, 13). Velocities are not read, and NaN, as is all
        of an object that comes later."""
        trial = self.task_env.trial
        if trial is None:
            return {"actors": {}, "articulations": {}}
        poses = trial.world.snapshot().poses
        actors = {}
        for item in trial.parts.scene.everything:
            row = torch.full((1, STATE), torch.nan)
            if item.name in poses:
                pose = poses[item.name]
                row[0, :7] = torch.tensor([*pose.position, *pose.rotation])
            actors[item.name] = row
        return {"actors": actors, "articulations": {}}

    def set_state_dict(self, state: Tree, env_idx: object = None) -> None:
        raise _no_states()

    @property
    def gpu_sim_enabled(self) -> bool:
        return False

    @property
    def spec(self) -> gymnasium.envs.registration.EnvSpec | None:
        """Gymnasium's entry, with an id by which any program finds it."""
        return getattr(self, "_spec", None)

    @spec.setter
    def spec(self, entry: gymnasium.envs.registration.EnvSpec | None) -> None:
        if entry is not None and not entry.id.startswith(f"{MODULE}:"):
            entry.id = f"{MODULE}:{entry.id}"  # recordings name it, and replays look it up
        self._spec = entry


class _Robot:
    """What ManiSkill's tools ask of `env.agent`."""

    def __init__(self, uid: str, control_mode: str, space: gymnasium.Space[Any]) -> None:
        self.uid, self.control_mode = uid, control_mode
        self.supported_control_modes = list(CONTROL_MODES)
        self.action_space = self.single_action_space = space


def register_variants() -> None:
    """Register every variant that is not registered yet."""
    for name in tasks():
        found = find_task(name)
        for level in found.levels:
            if (uid := variant_id(name, level)) not in registry:
                limit = step_limit(found, level)
                register_env(uid, max_episode_steps=limit, task=name, level=level)(RoboSPAEnv)


def _one_of(what: str, given: str | None, known: Sequence[str]) -> str:
    if given is not None and given not in known:
        raise SettingsError(f"{what} {given!r} is not one of {', '.join(known)}")
    return given or known[0]


def _cameras(names: Sequence[str], configs: Mapping[str, Any]) -> tuple[CameraSpec, ...]:
    """`names` in the sizes of `configs`: of one camera, else of all, else the usual one."""
    for name, value in configs.items():
        wrong = set(value if isinstance(value, Mapping) else [name]) - {"width", "height"}
        if wrong:
            raise SettingsError(
                f"sensor_configs has {sorted(wrong)[0]!r}; a camera's width and height can be set"
            )
    common_size = {name: value for name, value in configs.items() if name in ("width", "height")}
    return tuple(CameraSpec(name, **{**common_size, **configs.get(name, {})}) for name in names)


def _nothing(space: gymnasium.Space[Any]) -> Tree:
    """An observation of zeros: spaces are known before a simulator is opened."""
    assert isinstance(space, gymnasium.spaces.Dict)
    return {
        name: _nothing(part) if name == "images" else np.zeros(part.shape or (), part.dtype)
        for name, part in space.spaces.items()
        if name != "instruction"
    }


def _no_states() -> NotImplementedError:
    return NotImplementedError(
        "a state cannot be set: a trial follows from its seed and its actions; replay it by those"
    )


MODULE = "robospa.maniskill"
"""What has to be imported before Gymnasium knows the ids, and may stand before one."""
BACKEND = "physx_cpu"
"""ManiSkill's name of the simulator that our worlds run on."""
Tree = dict[str, Any]


def variant_id(task: str, level: int) -> str:
    """The id of a variant, such as RoboSPA-Pick_Blocks_Size-L3-v3, where 3 is the suite's
    version."""
    return f"RoboSPA-{task}-L{level}-v{SUITE.rpartition('-')[2]}"


def proprioception(
    measured: NDArray[np.float32],
    commanded: NDArray[np.float32],
    ee: NDArray[np.float32],
    objects: NDArray[np.float32] | None = None,
) -> Tree:
    """`agent` and `extra` of joints (N, D), end effectors (N, 2, 8) and objects (N, E)."""
    extra = {"left_tcp_pose": ee[:, 0, :7], "right_tcp_pose": ee[:, 1, :7]}
    if objects is not None:
        extra["objects"] = objects
    return {
        "agent": {"qpos": measured, "controller": {"target_qpos": commanded}},
        "extra": extra,
    }


def sensor_params(robot: str, sizes: Mapping[str, tuple[int, int]], count: int) -> Tree:
    """`sensor_param` of cameras of `sizes` (width, height) [px], `count` times each."""
    known = robot_named(robot)
    fields = {f"{side}_wrist": arm.wrist_fov for side, arm in zip(ARMS, known.arms, strict=True)}
    fields.update({name: camera.fov for name, camera in known.cameras.items()})
    found = {}
    for camera, (width, height) in sizes.items():
        focal = height / 2 / math.tan(fields[camera] / 2)
        matrix = [[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]]
        found[camera] = {"intrinsic_cv": np.tile(np.array(matrix, np.float32), (count, 1, 1))}
    return found
