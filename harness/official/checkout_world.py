"""A user's RoboSPA checkout as a world: official physics, rendering, scenes and success.

The scene of a trial is made there, from its seed and episode number, and is not known here: a
`Scene` of ours names it only. It runs in a process of its own, whose answers are as untrusted as
those of a policy's server: sizes are checked before anything is allocated, and every wait has an
end. `examine` looks at all of it before it is used, and `valid_seeds` finds its list of seeds.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import selectors
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.official import checkout_server
from robospa.harness.official.checkout import CONFIGS, CheckoutSnapshot, checkout_parts
from robospa.harness.official.sentences import UNSEEN, OfficialSentences, read_checkout
from robospa.harness.robots import embodiment
from robospa.harness.world import (
    ActionError,
    CameraView,
    Poll,
    RenderUnavailable,
    SceneUnstable,
    StepResult,
)
from robospa.observation import DEFAULT_CAMERAS, CameraSpec, Observation
from robospa.protocol.errors import printable
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact
from robospa.trial import REFERENCE, TrialKey
from robospa.workcell import grasp_points

SENTENCE = 500
SECONDS = {"hello": 300.0, "load": 900.0, "step": 300.0, "observe": 120.0}
"""How long an answer may take [s]: at hello the simulator and torch are imported, at load a GPU
planner is warmed up and the official expert plays."""


class CheckoutFailed(Exception):
    """The checkout's process cannot go on; the message says what it was doing and what to do."""


class BadScene(Exception):
    """The checkout's scene is not stable, or its expert does not solve it: no valid seed."""


class CheckoutProcess:
    """A process of `python` that runs the checkout at `folder`; `hello` is its greeting."""

    def __init__(
        self, folder: Path, python: str = "python", seconds: Mapping[str, float] = SECONDS
    ) -> None:
        """Raises CheckoutFailed if it does not come up."""
        self._seconds = seconds
        script = Path(checkout_server.__file__).resolve()
        # Nothing of ours may be imported there: our packages need another Python.
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        try:
            self._process = subprocess.Popen(
                [python, str(script), str(folder)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment,
            )
        except OSError as error:
            raise CheckoutFailed(
                f"{python} cannot be started ({error.strerror}): name the Python of the "
                "checkout's environment with --world 'checkout:DIR?python=/path/to/python'"
            ) from error
        try:
            self.hello, _ = self.ask("hello")
            if self.hello.get("version") != checkout_server.VERSION:
                raise CheckoutFailed(
                    f"the checkout's process speaks version {self.hello.get('version')!r} of the "
                    f"protocol, and this robospa speaks {checkout_server.VERSION}"
                )
        except BaseException:
            self.close()
            raise

    def ask(
        self, do: str, arrays: Mapping[str, NDArray[Any]] | None = None, **request: object
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """The answer to one request; raises CheckoutFailed, after which it is of no use any more,
        or BadScene."""
        deadline = time.monotonic() + self._seconds[do]
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(checkout_server.packed({"do": do, **request}, arrays))
            self._process.stdin.flush()
            header, found = checkout_server.unpacked(lambda n: self._read(n, deadline, do))
        except (BrokenPipeError, EOFError):
            code = self._ended()
            raise CheckoutFailed(
                f"the checkout's process ended ({code}) at {do}: what it printed is in the log of "
                "this worker"
            ) from None
        except ValueError as error:
            self.close()
            raise CheckoutFailed(f"the checkout's process answered nonsense: {error}") from error
        if "error" in header:
            text = printable(str(header.get("text", "")), SENTENCE)
            if header["error"] in ("unstable", "unsolved"):
                raise BadScene(text)
            what = "be used" if do == "hello" else do
            raise CheckoutFailed(f"the checkout cannot {what}: {text}")
        return header, found

    def _read(self, count: int, deadline: float, do: str) -> bytes:
        assert self._process.stdout is not None
        pipe, parts = self._process.stdout.fileno(), []
        with selectors.DefaultSelector() as ready:
            ready.register(pipe, selectors.EVENT_READ)
            while count:
                if not ready.select(max(0.0, deadline - time.monotonic())):
                    self.close()
                    raise CheckoutFailed(
                        f"the checkout did not {do} within {self._seconds[do]:g} s and was ended; "
                        "allow more with --world 'checkout:DIR?patience=2', a factor"
                    )
                part = os.read(pipe, min(count, 2**20))
                if not part:
                    raise EOFError
                parts.append(part)
                count -= len(part)
        return b"".join(parts)

    def _ended(self) -> str:
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.close()
            return "it closed its pipe"
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):  # what was still to be sent
                    pipe.close()


def numbers(value: object, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """`value` as finite numbers of `shape`, where -1 is any count; raises CheckoutFailed."""
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    fits = found.ndim == len(shape) and all(
        n in (-1, m) for n, m in zip(shape, found.shape, strict=True)
    )
    if not fits or not np.isfinite(found).all():
        raise CheckoutFailed(f"the checkout's {what} are not numbers of shape {shape}")
    return found


TIMESTEP = 1 / 250
KINDS = {"joint": "qpos", "ee": "ee"}
"""What the checkout calls our action spaces; it has no others."""


class CheckoutStill:
    """An instant that can be drawn until the world goes on."""

    def __init__(self, world: CheckoutWorld, steps: int) -> None:
        self._world, self._steps = world, steps

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        """Its image; raises RenderUnavailable once the world is at another instant."""
        return self.draw([camera])[0]

    def draw(self, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        if self._world.physics_steps != self._steps:
            raise RenderUnavailable("a checkout draws only the present: this instant is over")
        return list(self._world.pictures(cameras).values())


class CheckoutWorld:
    """The checkout at `folder`, run by `python` in a process of its own. `config` is a file of its
    task_config, by default that of the scene mode. Raises CheckoutFailed."""

    def __init__(
        self, folder: str, python: str = "python", config: str = "", patience: float = 1.0
    ) -> None:
        self._folder, self._config = Path(folder), config
        seconds = {name: patience * value for name, value in SECONDS.items()}
        self._process = CheckoutProcess(self._folder, python, seconds)
        self._scene: Scene | None = None
        self._state: dict[str, Any] = {}
        self._values: dict[str, str] = {}
        self._sentences: dict[tuple[str, int], OfficialSentences] = {}
        self.physics_steps = 0

    def load(self, scene: Scene, contacts: bool = False) -> None:
        """Have the scene made there, from its seed and the fact `episode`, after the official
        expert has solved it. Raises SceneUnstable, also if that does not, and CheckoutFailed."""
        self._scene, self.physics_steps = None, 0
        try:
            self._state, _ = self._process.ask(
                "load",
                task=f"{scene.task}_{scene.level}",
                seed=scene.seed,
                episode=scene.facts["episode"],
                config=self._config or CONFIGS[scene.mode],
                embodiment=official_robot(scene.embodiment),
            )
        except BadScene as error:
            raise SceneUnstable(
                f"{scene.task} level {scene.level} seed {scene.seed} is not valid in the checkout: "
                f"{error}"
            ) from error
        self._scene = scene
        self._values = {str(k): str(v) for k, v in self._state.pop("values", {}).items()}

    def instruction(self, split: str) -> str:
        """The sentence of the loaded scene, with the values that the official expert gave."""
        scene = self._loaded()
        variant = (scene.task, scene.level)
        if variant not in self._sentences:
            self._sentences[variant] = read_checkout(self._folder, [variant])
        return self._sentences[variant].instruction_of(scene, self._values, split)

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Execute one action there; `poll` is called once, after it: the checkout itself tests for
        success after every physics step, and stops at it."""
        scene = self._loaded()
        if space not in KINDS:
            raise ActionError(f"a checkout executes {' and '.join(KINDS)} actions, not {space}")
        width = embodiment(scene.embodiment).action_space(space).width
        if action.shape != (width,) or not np.isfinite(action).all():
            raise ActionError(f"a {space} action is {width} finite numbers, not {action.shape}")
        self._state, _ = self._process.ask("step", {"action": action}, kind=KINDS[space])
        steps = self._state.get("physics_steps")
        if type(steps) is not int or steps < 0:
            raise CheckoutFailed("the checkout does not say how many physics steps an action took")
        self.physics_steps += steps
        return StepResult(steps, poll(self.snapshot()))

    def observe(self, spec: PolicySpec) -> Observation:
        if spec.privileged or spec.environment_state or spec.state == "measured":
            raise RenderUnavailable(
                "a checkout shows images and the commanded state: this policy wants more"
            )
        seen: Observation = {"images": self.pictures(spec.cameras)}
        joints = self._joints()
        if spec.state != "none":
            seen["state"] = np.concatenate(joints).astype(np.float32)
        rows = [[*end, arm[-1]] for end, arm in zip(self._ends(), joints, strict=True)]
        seen["ee"] = np.array(rows, dtype=np.float32)
        return seen

    def pictures(self, cameras: Sequence[CameraSpec]) -> dict[str, NDArray[np.uint8]]:
        """Images of this instant by camera; raises RenderUnavailable for another size than the
        checkout draws."""
        if not cameras:
            return {}
        self._loaded()
        _, found = self._process.ask("observe", cameras=[camera.name for camera in cameras])
        for camera in cameras:
            image = found.get(camera.name)
            if image is None or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
                raise CheckoutFailed(f"the checkout's camera {camera.name} gave no RGB image")
            if image.shape[:2] != (camera.height, camera.width):
                height, width = image.shape[:2]
                raise RenderUnavailable(
                    f"the checkout draws {camera.name} in {width}x{height}, and the policy asks "
                    f"for {camera.width}x{camera.height}: change one of them"
                )
        return {camera.name: found[camera.name] for camera in cameras}

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        return self.pictures([camera])[camera.name]

    def identify(self, camera: CameraSpec) -> NDArray[np.int16]:
        """A checkout does not tell what its pixels show: RenderUnavailable."""
        raise RenderUnavailable("a checkout does not tell which objects its pictures show")

    def view(self, camera: CameraSpec) -> CameraView:
        """Nor where its cameras are: RenderUnavailable."""
        raise RenderUnavailable("a checkout does not tell where its cameras are")

    def still(self) -> CheckoutStill:
        return CheckoutStill(self, self.physics_steps)

    def snapshot(self) -> CheckoutSnapshot:
        """The robot and the checkout's verdict; no object is known."""
        scene, joints = self._loaded(), self._joints()
        rows = self._ends().tolist()
        left, right = (Pose((x, y, z), (a, b, c, d)) for x, y, z, a, b, c, d in rows)
        flags = self._state.get("flags", [])
        return CheckoutSnapshot(
            time=self.physics_steps * TIMESTEP,
            poses={},
            gripper=(float(joints[0][-1]), float(joints[1][-1])),
            end_effector=(left, right),
            grasp_points=grasp_points(embodiment(scene.embodiment).grippers, (left, right)),
            joints=(tuple(joints[0][:-1].tolist()), tuple(joints[1][:-1].tolist())),
            success=self._state.get("success") is True,
            flags=tuple(bool(flag) for flag in flags) if isinstance(flags, list) else (),
        )

    def contacts(self) -> tuple[Contact, ...]:
        return ()

    def digest(self) -> str:
        """Hash of what is known of the state; equal hashes do not mean equal states."""
        text = json.dumps([self.physics_steps, self._state], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def info(self) -> Mapping[str, object]:
        hello = self._process.hello
        return {"simulator": "RoboSPA checkout", "checkout": hello.get("checkout"),
                "versions": hello.get("versions"), "config": self._config}  # fmt: skip

    def close(self) -> None:
        self._process.close()

    def _loaded(self) -> Scene:
        if self._scene is None:
            raise RuntimeError("no scene is loaded: call load first")
        return self._scene

    def _joints(self) -> list[NDArray[np.float64]]:
        """Commanded joints of both arms, grippers last."""
        width = embodiment(self._loaded().embodiment).action_space("joint").width
        rows = self._state.get("joints")
        arms = rows if isinstance(rows, list) and len(rows) == 2 else [None, None]
        found = [numbers(arm, (-1,), "joints") for arm in arms]
        if sum(map(len, found)) != width:
            raise CheckoutFailed(
                f"the checkout's robot has {sum(map(len, found))} joints and grippers, and "
                f"{self._loaded().embodiment} has {width}: see the embodiment in its config"
            )
        return found

    def _ends(self) -> NDArray[np.float64]:
        return numbers(self._state.get("ends"), (2, 7), "end-effector poses")


def official_robot(name: str) -> list[object]:
    """What a checkout calls the robot `name`: one of two arms, or two and their distance [m]."""
    if name == REFERENCE:
        return [name]
    pair, _, distance = name.partition(":")
    left, _, right = pair.partition("+")
    return [left, right or left, float(distance) if distance else embodiment(name).distance]


PINS = {"sapien": "3.0.0b1", "mplib": "0.2.1", "torch": "2.4.1", "warp": "1.12.0"}
"""What RoboTwin 2.0, which RoboSPA is built on, is pinned to."""
STILL = 50
"""Physics steps of an action in which no arm moves (official)."""
TRIES = 10
"""Seeds in a row that a look at one variant may need."""


class NoValidSeed(Exception):
    """A checkout has no valid scene among the seeds that were tried."""


@dataclass(frozen=True)
class CheckoutFinding:
    """One thing that was looked at: None where only a person can say whether it is as it should."""

    what: str
    good: bool | None
    seen: str


def examine(world: CheckoutWorld, key: TrialKey) -> Iterator[CheckoutFinding]:
    """Versions, a scene of `key`'s variant, its sentence, its images, and an action that holds
    still; raises what the world raises, and NoValidSeed."""
    versions = world.info().get("versions")
    found = versions if isinstance(versions, Mapping) else {}
    for name, pin in PINS.items():
        have = str(found.get(name, "")) or "none"
        yield CheckoutFinding(f"version of {name}", have.startswith(pin), f"{have}, official {pin}")
    seeds = valid_seeds(world, key, range(key.seed, key.seed + TRIES), 1)
    parts = checkout_parts(TrialKey(*key.variant, seeds[0], key.embodiment, key.mode),
                           {key.variant: seeds})  # fmt: skip
    yield CheckoutFinding(
        "scene", True, f"{key.task} level {key.level} seed {seeds[0]}: its expert solves"
    )
    yield CheckoutFinding("sentence", None, world.instruction(UNSEEN))
    seen = world.observe(PolicySpec(name="check", cameras=DEFAULT_CAMERAS))
    for name, image in seen["images"].items():
        height, width = image.shape[:2]
        yield CheckoutFinding(f"camera {name}", bool(image.std() > 1), f"{width}x{height}")
    result = world.step(seen["state"].astype(np.float32), "joint", lambda snapshot: False)
    yield CheckoutFinding(
        "holding still", result.physics_steps == STILL, f"{result.physics_steps} physics steps"
    )
    flags, total = len(world.snapshot().flags), parts.tracker.total
    yield CheckoutFinding("flags of subtasks", flags in (0, total), f"{flags}, of {total} subtasks")


def valid_seeds(
    world: CheckoutWorld,
    key: TrialKey,
    seeds: Sequence[int],
    count: int,
    on_seed: Callable[[int, str], None] = lambda seed, trouble: None,
) -> list[int]:
    """The first `count` of `seeds` whose scene of `key`'s variant is stable and solved by the
    official expert: the official list, because a seed's episode number is that of valid ones before
    it. The last one's scene is loaded. Raises NoValidSeed if there are fewer."""
    accepted: list[int] = []
    for seed in seeds:
        trial = TrialKey(*key.variant, seed, key.embodiment, key.mode)
        trouble = ""
        try:
            world.load(checkout_parts(trial, {key.variant: [*accepted, seed]}).scene)
            accepted.append(seed)
        except SceneUnstable as error:
            trouble = str(error)
        on_seed(seed, trouble)
        if len(accepted) == count:
            return accepted
    raise NoValidSeed(
        f"of {len(seeds)} seeds from {seeds[0]} on, {len(accepted)} of {key.task} level "
        f"{key.level} are valid in the checkout, not {count}"
    )
