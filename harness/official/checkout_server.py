"""Runs in the environment of a RoboSPA checkout, and does there what a harness asks over a pipe.

    PYTHON checkout_server.py CHECKOUT

One file, for Python 3.10 and later, that needs nothing of ours: numpy and PyYAML are what a
checkout needs anyway. Requests come on standard input and answers leave on standard output;
whatever the checkout prints goes to standard error. A message is four bytes with the length of a
header, the header (JSON), and the bytes of the arrays that its list `arrays` has as
[name, dtype, shape]:

    hello                                     -> version, checkout, versions
    load  task seed episode config embodiment -> state, values, flags
    step  kind ("qpos" or "ee") action        -> state, success, flags, physics_steps
    observe cameras                           -> images and state
    close

`state` is what the robot was told and where it is: `joints` [left, right] with the gripper last,
`ends` [left, right] as x y z qw qx qy qz. An answer may be `error` (unstable, unsolved or failed)
with a `text` instead. `load` is the official protocol: the scene is made, the expert has to solve
it, which also gives the `values` of the sentence's placeholders, and then it is made again.
"""

import importlib
import json
import os
import struct
import sys
import traceback
from collections.abc import Callable, Mapping
from importlib import metadata
from typing import Any

import numpy as np

VERSION = 1
MOST_HEADER = 2**22
MOST_ARRAYS = 2**27
"""Bytes of a header, and of all arrays of a message."""
DTYPES = ("uint8", "float32", "float64")
NO_LIMIT = 10**9
"""Actions that the checkout itself allows: who asks counts them."""
LAYOUT = ("envs", "task_config", "description")
CAMERAS = {
    "head": "head_camera",
    "left_wrist": "left_camera",
    "right_wrist": "right_camera",
    "front": "front_camera",
}
PACKAGES = ("sapien", "mplib", "torch", "numpy", "warp")
REQUESTS = ("hello", "load", "step", "observe")

Arrays = Mapping[str, np.ndarray]
Answer = tuple[dict[str, Any], dict[str, np.ndarray]]


class Refused(Exception):
    """A request that cannot be done; `kind` says whether it is the scene's or somebody's fault."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


def packed(header: Mapping[str, Any], arrays: Arrays | None = None) -> bytes:
    """A message as bytes."""
    plain = {name: np.ascontiguousarray(a) for name, a in (arrays or {}).items()}
    rows = [[name, a.dtype.name, list(a.shape)] for name, a in plain.items()]
    text = json.dumps({**header, "arrays": rows}).encode()
    return b"".join([struct.pack(">I", len(text)), text, *(a.tobytes() for a in plain.values())])


def unpacked(read: Callable[[int], bytes]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The message that `read`, which returns exactly as many bytes as asked for, gives. Raises
    ValueError if it is none, and what `read` raises."""
    (length,) = struct.unpack(">I", read(4))
    if length > MOST_HEADER:
        raise ValueError(f"a header of {length} bytes is none of this protocol")
    header = json.loads(read(length).decode())
    if not isinstance(header, dict) or not isinstance(header.get("arrays"), list):
        raise ValueError("a header without a list of arrays is none of this protocol")
    arrays: dict[str, np.ndarray] = {}
    left = MOST_ARRAYS
    for row in header.pop("arrays"):
        name, dtype, shape = row
        if dtype not in DTYPES or not all(type(n) is int and 0 <= n <= MOST_ARRAYS for n in shape):
            raise ValueError(f"an array of {dtype!r} and shape {shape!r} is none of this protocol")
        size = int(np.prod(shape, dtype=object)) * np.dtype(dtype).itemsize
        left -= size
        if left < 0:
            raise ValueError(f"a message with more than {MOST_ARRAYS} bytes of arrays")
        arrays[str(name)] = np.frombuffer(read(size), dtype).reshape(shape)
    return header, arrays


class Session:
    """The checkout in this process, with at most one scene."""

    def __init__(self, folder: str) -> None:
        self.folder = os.path.abspath(folder)
        self.env: Any = None
        self.name = ""
        self.steps = 0

    def hello(self, request: Mapping[str, Any]) -> Answer:
        """Import the checkout; who it is and what it stands on."""
        missing = [n for n in LAYOUT if not os.path.isdir(os.path.join(self.folder, n))]
        if missing:
            newer = os.path.isdir(os.path.join(self.folder, "env_cfg"))
            hint = (
                "this looks like RoboTwin's main branch, and RoboSPA is built on stable_2.0"
                if newer
                else "name the folder that holds envs/, task_config/ and description/"
            )
            raise Refused("failed", f"{self.folder} has no folder {missing[0]}: {hint}")
        os.chdir(self.folder)  # the checkout's own paths are relative
        sys.path[:0] = [self.folder]
        importlib.import_module("envs")
        versions = {name: _version(name) for name in PACKAGES}
        versions["python"] = sys.version.split()[0]
        return {"version": VERSION, "checkout": self.folder, "versions": versions}, {}

    def load(self, request: Mapping[str, Any]) -> Answer:
        """Make the scene as the official evaluation does."""
        name, seed, episode = str(request["task"]), int(request["seed"]), int(request["episode"])
        self._close_scene()
        env = self._environment(name)
        arguments = self._arguments(name, str(request["config"]), request["embodiment"])
        arguments.update(now_ep_num=episode, seed=seed, is_test=True)
        values = self._expert(env, arguments)
        self._setup(env, arguments)
        env.step_lim = NO_LIMIT
        self._count(env)
        return {"values": values, **self._state()}, {}

    def step(self, request: Mapping[str, Any], action: np.ndarray) -> Answer:
        env, before = self._loaded(), self.steps
        env.take_action(np.asarray(action, dtype=np.float64), action_type=str(request["kind"]))
        return {**self._state(), "physics_steps": self.steps - before}, {}

    def observe(self, request: Mapping[str, Any]) -> Answer:
        found = self._loaded().get_obs()
        images = {}
        for camera in request["cameras"]:
            picture = _picture(found, str(camera))
            if picture is None:
                raise Refused("failed", f"the checkout draws no camera {camera}: see its config")
            images[str(camera)] = np.asarray(picture, dtype=np.uint8)[..., :3]
        return self._state(), images

    def _loaded(self) -> Any:
        if self.env is None:
            raise Refused("failed", "no scene is loaded")
        return self.env

    def _environment(self, name: str) -> Any:
        """The task's object: made once, as officially, because it keeps its robot."""
        if self.name != name:
            try:
                module = importlib.import_module("envs." + name)
            except ModuleNotFoundError as error:
                text = f"the checkout has no task {name} ({error})"
                raise Refused("failed", text) from error
            self._made, self.name = getattr(module, name)(), name
        return self._made

    def _setup(self, env: Any, arguments: Mapping[str, Any]) -> None:
        vars(env).pop("check_success", None)
        try:
            env.setup_demo(**arguments)
        except Exception as error:
            self.env = env
            self._close_scene()
            if type(error).__name__ == "UnStableError":
                raise Refused("unstable", str(error)) from error
            raise
        self.env = env

    def _expert(self, env: Any, arguments: Mapping[str, Any]) -> dict[str, str]:
        """Values of the sentence's placeholders, from the expert, who has to solve the scene."""
        self._setup(env, arguments)
        try:
            info = env.play_once()
            solved = bool(env.plan_success) and bool(env.check_success())
        except Exception as error:
            raise Refused("unsolved", f"the official expert fails: {error}") from error
        finally:
            self._close_scene()
        if not solved:
            raise Refused("unsolved", "the official expert does not solve it")
        found = (info or {}).get("info", {})
        return {str(key).strip("{}"): str(value) for key, value in found.items()}

    def _count(self, env: Any) -> None:
        """Count physics steps: the checkout tests for success after each of an action's."""
        plain = env.check_success

        def counted() -> Any:
            self.steps += 1
            return plain()

        self.steps = 0
        env.check_success = counted

    def _state(self) -> dict[str, Any]:
        env = self._loaded()
        robot = env.robot
        joints = [robot.get_left_arm_jointState(), robot.get_right_arm_jointState()]
        ends = [robot.get_left_ee_pose(), robot.get_right_ee_pose()]
        return {
            "joints": [[float(v) for v in arm] for arm in joints],
            "ends": [[float(v) for v in end] for end in ends],
            "success": bool(env.eval_success),
            "flags": [bool(v) for v in getattr(env, "task_success", ())],
        }

    def _arguments(self, name: str, config: str, embodiment: list[Any]) -> dict[str, Any]:
        arguments = self._yaml(config + ".yml")
        robots = self._yaml("_embodiment_config.yml")
        cameras = self._yaml("_camera_config.yml")
        unknown = [robot for robot in embodiment[:2] if robot not in robots]
        if unknown:
            raise Refused("failed", f"the checkout has no robot {unknown[0]}: see task_config")
        files = [robots[robot]["file_path"] for robot in embodiment[:2]]
        head = cameras[arguments["camera"]["head_camera_type"]]
        arguments.update(
            task_name=name,
            task_config=config,
            embodiment=list(embodiment),
            left_robot_file=files[0],
            right_robot_file=files[-1],
            left_embodiment_config=_read_yaml(os.path.join(files[0], "config.yml")),
            right_embodiment_config=_read_yaml(os.path.join(files[-1], "config.yml")),
            dual_arm_embodied=len(embodiment) == 1,
            head_camera_h=head["h"],
            head_camera_w=head["w"],
            eval_mode=True,
            render_freq=0,
            eval_video_log=False,
        )
        if len(embodiment) == 3:
            arguments["embodiment_dis"] = embodiment[2]
        return arguments

    def _yaml(self, name: str) -> dict[str, Any]:
        return _read_yaml(os.path.join("task_config", name))

    def _close_scene(self) -> None:
        env, self.env = self.env, None
        if env is not None:
            env.close_env()


def _picture(found: Mapping[str, Any], camera: str) -> Any:
    if camera == "third":
        return found.get("third_view_rgb")
    return found["observation"].get(CAMERAS.get(camera, ""), {}).get("rgb")


def _read_yaml(path: str) -> dict[str, Any]:
    yaml = importlib.import_module("yaml")
    try:
        with open(path, encoding="utf-8") as file:
            found = yaml.safe_load(file)
    except OSError as error:
        raise Refused("failed", f"the checkout lacks {path} ({error.strerror})") from error
    if not isinstance(found, dict):
        raise Refused("failed", f"{path} of the checkout is no map")
    return found


def _version(name: str) -> str:
    try:
        return metadata.version({"warp": "warp-lang"}.get(name, name))
    except metadata.PackageNotFoundError:
        return ""


def answer(session: Session, request: Mapping[str, Any], arrays: Arrays) -> bytes:
    """The answer to one request, as bytes; what goes wrong is an answer too."""
    try:
        what = request.get("do")
        if what not in REQUESTS:
            raise Refused("failed", f"there is no request {what!r}")
        return packed(*getattr(session, what)(request, **arrays))
    except Refused as error:
        return packed({"error": error.kind, "text": str(error)})
    except Exception as error:
        traceback.print_exc()
        return packed({"error": "failed", "text": f"{type(error).__name__}: {error}"})


def main(folder: str) -> None:
    """Answer until the pipe is closed."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the checkout prints is no answer
    session = Session(folder)

    def read(count: int) -> bytes:
        data = sys.stdin.buffer.read(count)
        if len(data) < count:
            raise EOFError
        return data

    while True:
        try:
            request, arrays = unpacked(read)
        except EOFError:
            return
        if request.get("do") == "close":
            return
        out.write(answer(session, request, arrays))
        out.flush()


if __name__ == "__main__":
    main(sys.argv[1])
