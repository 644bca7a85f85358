"""What a scene's mode does beyond the scene: to pictures, actions, the start pose and the clock.

Every effect is a pure function of the scene's task, level and seed, the axis with its strength, the
camera and the action's number. Actions are changed before they are executed and recorded, so that a
replay needs no axis.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.harness.clock.policy_clock import PolicyClock
from robospa.observation import View
from robospa.protocol.codec import decode_jpeg, encode_jpeg
from robospa.tasks.catalog import generator
from robospa.tasks.scene import Scene

Image = NDArray[np.uint8]
Change = Callable[[Image, float, np.random.Generator], Image]
"""A picture (height, width, 3) RGB at a strength of the axis."""
V = TypeVar("V", bound=View)
RADIANS_PER_MM = 0.1 * np.pi / 180
"""A tenth of a degree moves a hand at the end of an arm of 0.57 m by a millimetre."""
COLUMNS = 320
"""Strengths in pixels are of a picture so wide."""


def _pixels(values: NDArray[np.floating]) -> Image:
    return np.asarray(np.clip(np.rint(values), 0, 255), dtype=np.uint8)


def _blurred(image: Image, sigma: float, rng: np.random.Generator) -> Image:
    sigma *= image.shape[1] / COLUMNS
    reach = max(1, round(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2).astype(np.float32)
    found = image.astype(np.float32)
    for axis in (0, 1):
        wide = np.pad(np.moveaxis(found, axis, 0), [(reach, reach), (0, 0), (0, 0)], "edge")
        total = np.zeros_like(wide[2 * reach :])
        for k, weight in enumerate(weights / weights.sum()):
            total += weight * wide[k : k + len(total)]
        found = np.moveaxis(total, 0, axis)
    return _pixels(found)


def _noisy(image: Image, levels: float, rng: np.random.Generator) -> Image:
    return _pixels(image + np.float32(levels) * rng.standard_normal(image.shape, dtype=np.float32))


def _brighter(image: Image, stops: float, rng: np.random.Generator) -> Image:
    """Linear light times 2^stops."""
    light = np.minimum(1.0, (np.arange(256) / 255) ** 2.2 * 2.0**stops)
    return np.asarray(_pixels(255 * light ** (1 / 2.2))[image])


def _grey(image: Image, strength: float, rng: np.random.Generator) -> Image:
    light = image @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
    return _pixels(np.repeat(light[..., None], 3, axis=2))


def _shifted(image: Image, pixels: float, rng: np.random.Generator) -> Image:
    """As by a small turn of the camera, in a direction of the trial's; the edge is repeated."""
    turn, far = rng.uniform(0, 2 * np.pi), pixels * image.shape[1] / COLUMNS
    ends = zip(image.shape[:2], (np.sin(turn), np.cos(turn)), strict=True)
    rows, columns = (np.clip(np.arange(n) + round(far * way), 0, n - 1) for n, way in ends)
    return np.ascontiguousarray(image[rows][:, columns])


NOISE = "noise"
"""The one that is drawn anew for every picture."""
PICTURES: Mapping[str, tuple[Change, str]] = {
    "bright": (_brighter, ""),
    "dark": (lambda image, stops, rng: _brighter(image, -stops, rng), ""),
    "grey": (_grey, ""),
    "wrist-shift": (_shifted, "wrist"),
    "no-wrists": (lambda image, *_: np.zeros_like(image), "wrist"),
    "blur": (_blurred, ""),
    NOISE: (_noisy, ""),
    "jpeg": (lambda image, loss, _: decode_jpeg(encode_jpeg(image, 100 - round(loss))), ""),
}
"""What happens to the pictures of cameras with that in their names, in the order of a camera:
light, lens, sensor, compression."""


@dataclass(frozen=True)
class Effects:
    """The effects of the mode of `scene`."""

    scene: Scene

    def _generator(self, *place: object) -> np.random.Generator:
        scene = self.scene
        words = (scene.suite, "effects", scene.task, scene.level, scene.seed, *place)
        return generator("/".join(map(str, words)))

    def seen(self, view: V, step: int) -> V:
        """`view`, taken after `step` actions, as the policy gets it."""
        strengths = self.scene.strengths
        images = dict(view["images"]) if "images" in view else {}
        if not images or not strengths.keys() & PICTURES.keys():
            return view
        for name, (change, on) in PICTURES.items():
            for camera in (c for c in images if name in strengths and on in c):
                rng = self._generator(name, camera, step if name == NOISE else "")
                images[camera] = change(images[camera], strengths[name], rng)
        changed = view.copy()
        changed["images"] = images
        return changed

    def acted(
        self, chunk: NDArray[np.float32], step: int, space: ActionSpace
    ) -> NDArray[np.float32]:
        """The actions (T, D) of a chunk asked for after `step` actions, as they are executed:
        strengths are millimetres of a position, or as much of a joint."""
        joints = space.kind == "joint"
        parts = [arm.body if joints else arm.position for arm in space.arms]
        columns = [c for part in parts for c in range(part.start, part.stop)]
        numbers = range(step, step + len(chunk))
        for axis, places in (("action-noise", numbers), ("action-bias", ("",))):
            if strength := self.scene.strengths.get(axis, 0.0):
                size = strength * (RADIANS_PER_MM if joints else 1e-3)
                rows = [self._generator(axis, at).standard_normal(len(columns)) for at in places]
                chunk = chunk.copy()
                chunk[:, columns] += np.asarray(rows, dtype=np.float32) * np.float32(size)
        return chunk

    def start(self, joints: NDArray[np.float32], space: ActionSpace) -> NDArray[np.float32]:
        """The joint action (D,) that brings the arms from `joints` (D,) to where they start."""
        draws = self._generator("start").uniform(-1, 1, len(space.bodies))
        made = joints.copy()
        made[space.bodies] += np.radians(self.scene.strengths["start"] * draws).astype(np.float32)
        return made

    def timed(self, clock: PolicyClock | None) -> PolicyClock | None:
        """A real `clock` with the latency of the axis added."""
        more = self.scene.strengths.get("latency", 0.0)
        if clock is None or not more:
            return clock
        points = tuple((share, value + more) for share, value in clock.latency.points)
        return replace(clock, latency=replace(clock.latency, points=points))
