"""What a scene's mode does beyond the scene: to pictures, actions, the start pose and the clock.

Every effect is a pure function of the trial's scene (task, level, seed), the axis with its
strength, and the action number: the same in every worker and whenever a trial is repeated. Actions
are changed before they are executed and recorded, so that a replay needs no axis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from robospa.observation import View
from robospa.tasks.catalog import generator
from robospa.tasks.scene import Scene

if TYPE_CHECKING:
    from robospa.action_space import ActionSpace
    from robospa.harness.clock.policy_clock import PolicyClock

Image = NDArray[np.uint8]
V = TypeVar("V", bound=View)
RADIANS_PER_MM = 0.1 * np.pi / 180
"""A tenth of a degree moves a hand at the end of an arm of 0.57 m by a millimetre."""
TOLD = "effects"
"""What seeds the random streams here, with scene and axis."""


def _blurred(image: Image, sigma: float, rng: np.random.Generator) -> Image:
    """Blurred by a Gaussian of `sigma` pixels of a picture of 320 columns."""
    sigma *= image.shape[1] / 320
    reach = max(1, round(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2).astype(np.float32)
    weights /= weights.sum()
    found = image.astype(np.float32)
    for axis in (0, 1):
        width = [(reach, reach) if k == axis else (0, 0) for k in range(3)]
        wide = np.pad(found, width, "edge")
        rows = [slice(k, k + image.shape[axis]) for k in range(2 * reach + 1)]
        parts = (wide[r] if axis == 0 else wide[:, r] for r in rows)
        found = np.zeros_like(found)
        for weight, part in zip(weights, parts, strict=True):
            found += weight * part
    return _pixels(found)


def _noisy(image: Image, levels: float, rng: np.random.Generator) -> Image:
    """With normal noise of so many of 255 grey levels in every pixel."""
    noise = rng.standard_normal(image.shape, dtype=np.float32)
    return _pixels(image + np.float32(levels) * noise)


def _as_jpeg(image: Image, loss: float, rng: np.random.Generator) -> Image:
    from robospa.protocol.codec import decode_jpeg, encode_jpeg

    return decode_jpeg(encode_jpeg(image, 100 - round(loss)))


def _exposed(sign: int) -> Callable[[Image, float, np.random.Generator], Image]:
    """So many stops brighter or darker: linear light doubled or halved."""

    def change(image: Image, stops: float, rng: np.random.Generator) -> Image:
        table = 255 * np.minimum(1.0, (np.arange(256) / 255) ** 2.2 * 2.0 ** (sign * stops))
        return np.asarray(_pixels(255 * (table / 255) ** (1 / 2.2))[image])

    return change


def _grey(image: Image, strength: float, rng: np.random.Generator) -> Image:
    light = image @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
    return _pixels(np.repeat(light[..., None], 3, axis=2))


def _shifted(image: Image, pixels: float, rng: np.random.Generator) -> Image:
    """Moved by so many pixels of 320 in a direction of the trial's, as by a small turn of the
    camera; the edge is repeated."""
    turn = rng.uniform(0, 2 * np.pi)
    far = pixels * image.shape[1] / 320
    ends = zip(image.shape[:2], (np.sin(turn), np.cos(turn)), strict=True)
    rows, columns = (np.clip(np.arange(n) + round(far * way), 0, n - 1) for n, way in ends)
    return np.ascontiguousarray(image[rows][:, columns])


def _black(image: Image, strength: float, rng: np.random.Generator) -> Image:
    return np.zeros_like(image)


def _pixels(values: NDArray[np.floating]) -> Image:
    return np.asarray(np.clip(np.rint(values), 0, 255), dtype=np.uint8)


@dataclass(frozen=True)
class PictureEffect:
    """What happens to the pictures of cameras (`on` part of their names); one that is not
    `lasting` is drawn anew for every picture."""

    change: Callable[[Image, float, np.random.Generator], Image]
    on: str = ""
    lasting: bool = True


PICTURES: Mapping[str, PictureEffect] = {
    "bright": PictureEffect(_exposed(1)),
    "dark": PictureEffect(_exposed(-1)),
    "grey": PictureEffect(_grey),
    "wrist-shift": PictureEffect(_shifted, on="wrist"),
    "no-wrists": PictureEffect(_black, on="wrist"),
    "blur": PictureEffect(_blurred),
    "noise": PictureEffect(_noisy, lasting=False),
    "jpeg": PictureEffect(_as_jpeg),
}
"""In the order of a camera: light, lens, sensor, compression."""


@dataclass(frozen=True)
class Effects:
    """The effects of the mode of `scene`."""

    scene: Scene

    def _generator(self, axis: str, *place: object) -> np.random.Generator:
        scene = self.scene
        words = (scene.suite, TOLD, scene.task, scene.level, scene.seed, axis, *place)
        return generator("/".join(map(str, words)))

    def seen(self, view: V, step: int) -> V:
        """`view`, taken after `step` actions, as the policy gets it."""
        active = [name for name in PICTURES if name in self.scene.strengths]
        if not active or not view.get("images"):
            return view
        images = dict(view["images"])
        for name in active:
            effect, strength = PICTURES[name], self.scene.strengths[name]
            for camera in (c for c in images if effect.on in c):
                rng = self._generator(name, camera, *(() if effect.lasting else (step,)))
                images[camera] = effect.change(images[camera], strength, rng)
        changed = view.copy()
        changed["images"] = images
        return changed

    def acted(
        self, chunk: NDArray[np.float32], step: int, space: ActionSpace
    ) -> NDArray[np.float32]:
        """The actions (T, D) of a chunk asked for after `step` actions, as they are executed:
        strengths are millimetres of a position, or as much of a joint."""
        made = chunk
        for axis, lasting in (("action-noise", False), ("action-bias", True)):
            if strength := self.scene.strengths.get(axis, 0.0):
                joints = space.kind == "joint"
                parts = [arm.body if joints else arm.position for arm in space.arms]
                columns = [c for part in parts for c in range(part.start, part.stop)]
                size = strength * (RADIANS_PER_MM if joints else 1e-3)
                places = [()] if lasting else [(step + k,) for k in range(len(made))]
                rows = [self._generator(axis, *at).standard_normal(len(columns)) for at in places]
                made = made.copy()
                made[:, columns] += np.asarray(rows, dtype=np.float32) * np.float32(size)
        return made

    def start(self, joints: NDArray[np.float32], space: ActionSpace) -> NDArray[np.float32]:
        """The joint action (D,) that brings the arms from `joints` (D,) to where they start."""
        degrees = self.scene.strengths.get("start", 0.0)
        made = joints.copy()
        draws = self._generator("start").uniform(-1, 1, len(space.bodies))
        made[space.bodies] += np.asarray(np.radians(degrees) * draws, dtype=np.float32)
        return made

    def timed(self, clock: PolicyClock | None) -> PolicyClock | None:
        """A real `clock` with the latency of the axis added."""
        more = self.scene.strengths.get("latency", 0.0)
        if clock is None or not more:
            return clock
        points = tuple((share, value + more) for share, value in clock.latency.points)
        return replace(clock, latency=replace(clock.latency, points=points))
