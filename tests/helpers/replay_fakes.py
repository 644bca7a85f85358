"""A made-up demonstration, and policies that know it by heart but have wrong conventions."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.geometry import axis_rotation
from robospa.harness.convention_check.episodes import Episode
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec, TrialInfo

Array = NDArray[np.float64]
Change = Callable[[Array, Array], Array]
"""(chunk, state at the query) -> chunk."""

FRAMES, CHUNK = 90, 20
OFFSETS = {"head": 10, "left_wrist": 20, "right_wrist": 60}
"""How much redder the frames of each camera are."""
SPEC = PolicySpec(
    "fake",
    cameras=tuple(CameraSpec(name, 32, 24) for name in OFFSETS),
    horizon=CHUNK,
    action_dim=14,
)
EE = PolicySpec("fake", cameras=SPEC.cameras, action="ee", horizon=CHUNK)


def picture(t: int, camera: str) -> NDArray[np.uint8]:
    """A frame from which t can be read, if one knows channels, side and the way up."""
    image = np.zeros((24, 32, 3), np.uint8)
    image[..., 0] = 2 * t + OFFSETS[camera]
    image[:12, :, 2] = 250
    return image


def episode(measured: bool = True) -> Episode:
    """Both arms move, every joint in its own way; the grippers close one after the other."""
    t = np.arange(FRAMES)[:, None]
    phase, speed = np.linspace(0, 2, 12), np.linspace(0.02, 0.05, 12)
    joints = 0.5 * np.sin(phase + speed * t) + np.linspace(-0.4, 0.7, 12)
    left, right = np.clip((50 - t) / 10, 0, 1), np.clip((75 - t) / 8, 0, 1)
    commanded = np.hstack([joints[:, :6], left, joints[:, 6:], right])
    ee = np.zeros((FRAMES, 2, 8))
    for arm in (0, 1):
        for k in range(FRAMES):
            turn = axis_rotation((1.0, 0.4 + arm, -0.3), 0.8 + 0.02 * k)
            place = (0.3 * arm - 0.2 + 0.003 * k, 0.1 * np.sin(k / 15), 0.9 + 0.002 * k)
            ee[k, arm] = [*place, *turn, commanded[k, 6 + 7 * arm]]
    late = np.vstack([commanded[:1].repeat(3, 0), commanded[:-3]])
    frames = {n: [picture(k, n) for k in range(FRAMES)] for n in OFFSETS}
    about = {"task": "Pick_Blocks_Size", "level": 1, "seed": 7}
    return Episode(
        "made-up.hdf5",
        commanded,
        ee,
        frames,
        ActionSpace("joint"),
        "Pick it up.",
        late if measured else None,
        about,
    )


class Learned:
    """Knows `made` by heart: reads the time from the images, and moves on from the state shown."""

    def __init__(
        self,
        made: Episode,
        answer: Change = lambda chunk, now: chunk,
        look: Callable[[dict[str, Any]], dict[str, Any]] = lambda seen: seen,
        spec: PolicySpec = SPEC,
        noise: float = 0.0,
    ) -> None:
        self.made, self.answer, self.look, self.spec, self.noise = made, answer, look, spec, noise
        self.rng = np.random.default_rng(3)
        self.trial: TrialInfo | None = None

    def reset(self, trial: TrialInfo) -> None:
        self.trial = trial

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        seen = self.look(dict(observation))
        joint = self.spec.action == "joint"
        track = self.made.commanded if joint else self.made.ee.reshape(FRAMES, 16)
        now = np.asarray(seen["state"] if joint else seen["ee"], float).reshape(-1)
        t = self.time(seen["images"])
        if t is None:
            chunk = np.tile(now, (CHUNK, 1))
        elif joint:
            chunk = track[t + 1 : t + 1 + CHUNK] - track[t] + now
        else:
            chunk = track[t + 1 : t + 1 + CHUNK].copy()
        chunk = self.answer(chunk, now)
        return (chunk + self.noise * self.rng.standard_normal(chunk.shape)).astype(np.float32)

    def time(self, images: Mapping[str, Any]) -> int | None:
        """The frame, if all three images agree on it as well as JPEG lets them."""
        if any(image[2, 2, 2] < 200 or image[-3, -3, 2] > 50 for image in images.values()):
            return None
        read = [(float(images[n][..., 0].mean()) - o) / 2 for n, o in OFFSETS.items()]
        t = round(sum(read) / 3)
        return None if max(read) - min(read) > 1.6 or not 0 <= t < FRAMES - 1 else t


def columns(order: list[int]) -> Change:
    return lambda chunk, now: chunk[:, order]


def grippers(change: Callable[[Array], Array]) -> Change:
    def changed(chunk: Array, now: Array) -> Array:
        out = chunk.copy()
        out[:, [6, 13]] = change(out[:, [6, 13]])
        return out

    return changed


def joints(change: Callable[[Array], Array]) -> Change:
    """Changes the joints and leaves the grippers."""

    def changed(chunk: Array, now: Array) -> Array:
        out = change(chunk)
        out[:, [6, 13]] = chunk[:, [6, 13]]
        return out

    return changed


def swapped_wrists(seen: dict[str, Any]) -> dict[str, Any]:
    images = seen["images"]
    turned = {"left_wrist": images["right_wrist"], "right_wrist": images["left_wrist"]}
    return {**seen, "images": {**images, **turned}}


def all_images(change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda seen: {**seen, "images": {n: change(i) for n, i in seen["images"].items()}}


def state(change: Callable[[Array], Array]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """The policy reads the state otherwise than it is shown: (2, 7) to (2, 7)."""
    return lambda seen: {
        **seen,
        "state": change(np.asarray(seen["state"], float).reshape(2, 7)).reshape(-1),
    }
