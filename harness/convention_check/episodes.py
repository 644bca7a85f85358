"""Recorded demonstrations: read the official HDF5 files and ours, write ours.

One layout for both, that of RoboTwin and RoboSPA (docs/replay-check.md has the table), so that
what `robospa collect` writes can be trained on with the official converters. The action of frame t
is the command of frame t + 1. Red and blue are exchanged inside the JPEGs (they were coded from RGB
as if it were BGR) and put right here. Needs h5py and Pillow, which the extra `demos` brings.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS, POSE, SEVEN_JOINT_ARMS, SIX_JOINT_ARMS, ActionSpace
from robospa.extras import remedy
from robospa.harness.running.atomic_file import replace_file
from robospa.observation import CameraSpec, Observation
from robospa.protocol.codec import decode_jpeg
from robospa.protocol.errors import DecodeError
from robospa.protocol.policy import PolicySpec

if TYPE_CHECKING:
    import h5py

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

VIEWS = {
    "head": "observation/head_camera/rgb",
    "left_wrist": "observation/left_camera/rgb",
    "right_wrist": "observation/right_camera/rgb",
    "front": "observation/front_camera/rgb",
    "third": "third_view_rgb",
}
"""Our cameras and where their frames are."""
ABOUT = ("task", "level", "seed", "embodiment", "mode", "split", "stride")
MOST_FRAMES = 20_000
MOST_JOINTS = 32
MOST_BYTES = 2**31
"""Of the pictures of one camera; official episodes have some 10 MB."""
MOST_TEXT = 2**22
"""Bytes of a file of sentences."""
QUALITY = 95
"""Of a written JPEG: OpenCV's default, which the official recordings have."""

Frame = bytes | NDArray[np.uint8]
"""A picture as JPEG (official colours) or as an array (H, W, 3) RGB."""


class EpisodeError(Exception):
    """A file is no demonstration that can be read, or lacks something; the message says what."""


@dataclass(frozen=True)
class Episode:
    """A demonstration of T frames.

    `commanded` and `measured` float64 (T, D) as in an observation's `state`, `measured` None where
    it was not recorded; `ee` float64 (T, 2, 8) as in an observation; `frames` per camera T JPEGs
    (bytes, official colours) or arrays uint8 (H, W, 3) RGB; `space` has the columns of `commanded`;
    `about` what is known of the trial.
    """

    name: str
    commanded: Array
    ee: Array
    frames: Mapping[str, Sequence[Frame]]
    space: ActionSpace
    instruction: str = ""
    measured: Array | None = None
    about: Mapping[str, str | int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.commanded)

    @property
    def actions(self) -> NDArray[np.float32]:
        """float32 (T - 1, D): the action of a frame is the next one's command."""
        return self.commanded[1:].astype(np.float32)

    def picture(self, camera: CameraSpec, t: int) -> Picture:
        """Frame `t` uint8 (height, width, 3) RGB in the size that `camera` asks for."""
        if camera.name not in self.frames:
            known = ", ".join(self.frames) or "none"
            raise EpisodeError(
                f"the policy wants camera {camera.name!r}, and {self.name} has only {known}"
            )
        frame = self.own_picture(camera.name, t)
        if frame.shape[:2] != (camera.height, camera.width):
            small = _module("PIL.Image", "Pillow").fromarray(np.ascontiguousarray(frame))
            frame = np.asarray(small.resize((camera.width, camera.height)))
        return np.ascontiguousarray(frame)

    def own_picture(self, camera: str, t: int) -> Picture:
        """Frame `t` of a camera uint8 (H, W, 3) RGB in its own size; raises EpisodeError."""
        frame = self.frames[camera][t]
        if not isinstance(frame, bytes):
            return frame
        try:
            return decode_jpeg(frame)[..., ::-1]
        except DecodeError as error:
            raise EpisodeError(
                f"{self.name}: frame {t} of camera {camera} cannot be read: {error}"
            ) from error

    def observation(self, spec: PolicySpec, t: int) -> Observation:
        """Frame `t` as a policy with `spec` observes it; `step` is t. Raises EpisodeError."""
        seen = self._view(spec, t)
        seen["instruction"], seen["step"] = self.instruction, t
        if spec.history:
            seen["history"] = {
                offset: self._view(spec, max(t + offset, 0)) for offset in spec.history
            }
        return seen

    def _view(self, spec: PolicySpec, t: int) -> Observation:
        view: Observation = {
            "images": {camera.name: self.picture(camera, t) for camera in spec.cameras},
            "ee": self.ee[t].astype(np.float32),
        }
        if spec.state != "none":
            use = self.measured if spec.state == "measured" else self.commanded
            if use is None:
                raise EpisodeError(
                    f"the policy wants measured joints, and {self.name} has commanded ones only: "
                    "use one made with `robospa collect --record`"
                )
            view["state"] = use[t].astype(np.float32)
        return view


def read_episode(path: Path, instruction: str | None = None) -> Episode:
    """The demonstration in `path`; `instruction` replaces the recorded one.

    Official files do not hold their instruction: it is taken from `../instructions/<name>.json`.
    Raises EpisodeError, in one sentence, for whatever cannot be read.
    """
    h5py = _module("h5py", "h5py")
    if not path.is_file():
        raise EpisodeError(f"there is no file {path}")
    try:
        with h5py.File(path, "r") as file:
            return _read(file, path, instruction)
    except EpisodeError:
        raise
    except (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        why = " ".join(str(error).split(" (")[-1].strip(")").split())
        raise EpisodeError(f"{path} cannot be read as an HDF5 demonstration: {why}") from error


def _read(file: h5py.File, path: Path, instruction: str | None) -> Episode:
    name = path.name
    commanded = _numbers(file, "joint_action/vector", name)
    length, width = commanded.shape
    space = _space(file, width)
    if not 2 <= length <= MOST_FRAMES or space is None:
        raise EpisodeError(
            f"{name}: joint_action/vector is {commanded.shape}; expected 2 to {MOST_FRAMES} frames "
            "of 14 numbers (16 for two 7-joint arms)"
        )
    arms = []
    for side in ARMS:
        pose = _numbers(file, f"endpose/{side}_endpose", name)
        grip = _numbers(file, f"endpose/{side}_gripper", name).reshape(-1, 1)
        if pose.shape != (length, len(POSE)) or grip.shape != (length, 1):
            raise EpisodeError(f"{name}: endpose/{side}_* is not 7 and 1 numbers a frame")
        arms.append(np.hstack([pose, grip]))
    measured = None
    if "joint_action/measured" in file:
        measured = _numbers(file, "joint_action/measured", name)
        if measured.shape != commanded.shape:
            raise EpisodeError(f"{name}: joint_action/measured does not fit joint_action/vector")
    frames = {view: _frames(file, at, name, length) for view, at in VIEWS.items() if at in file}
    about = {key: _plain(file.attrs[key]) for key in ABOUT if key in file.attrs}
    if not about and len(path.absolute().parents) > 2:  # <task>/<configuration>/data/episode0.hdf5
        about = {"task": path.absolute().parents[2].name}
    text = instruction or str(_plain(file.attrs.get("instruction", "")))
    text = text or next(iter(seen_sentences(path)), "")
    return Episode(name, commanded, np.stack(arms, axis=1), frames, space, text, measured, about)


def _space(file: h5py.File, width: int) -> ActionSpace | None:
    """The columns of `joint_action/vector`: two arms of six or of seven joints, or, in files that
    have the arms one by one as well, of as many as those have. None where it is neither."""
    counts = [SIX_JOINT_ARMS, SEVEN_JOINT_ARMS]
    arms = [file.get(f"joint_action/{arm}_arm") for arm in ARMS]
    shapes = [tuple(getattr(arm, "shape", ())) for arm in arms]
    if all(len(shape) == 2 and 0 < shape[1] <= MOST_JOINTS for shape in shapes):
        counts.append((shapes[0][1], shapes[1][1]))
    spaces = (ActionSpace("joint", count) for count in counts)
    return next((space for space in spaces if space.width == width), None)


def _numbers(file: h5py.File, at: str, name: str) -> Array:
    if at not in file or not hasattr(file[at], "dtype"):
        raise EpisodeError(f"{name} has no {at}: it is not in the layout of RoboTwin 2.0")
    found = file[at]
    _own(found, file, at, name)
    if found.size > 64 * MOST_FRAMES:
        raise EpisodeError(f"{name}: {at} has {found.size} numbers, which is too many")
    values = np.asarray(found[()], dtype=float)
    if not np.isfinite(values).all():
        raise EpisodeError(f"{name}: {at} has numbers that are not finite")
    return values if values.ndim > 1 else values.reshape(-1, 1)


def _own(found: h5py.Dataset, file: h5py.File, at: str, name: str) -> None:
    """Raises EpisodeError for data that lie in another file: HDF5 can link to any of this user."""
    if found.file.filename != file.filename or found.external or found.is_virtual:
        raise EpisodeError(f"{name}: {at} lies in another file, which is not read")


def _frames(file: h5py.File, at: str, name: str, length: int) -> list[Frame]:
    found = file[at]
    if not hasattr(found, "dtype"):
        raise EpisodeError(f"{name}: {at} is a group, not frames")
    _own(found, file, at, name)
    if found.nbytes > MOST_BYTES:
        raise EpisodeError(f"{name}: {at} has {found.nbytes} bytes, more than {MOST_BYTES}")
    if found.shape[:1] != (length,):
        raise EpisodeError(f"{name}: {at} has {found.shape[0]} frames, not {length}")
    if found.ndim == 4 and found.dtype == np.uint8 and found.shape[3] == 3:
        return [np.asarray(found[t]) for t in range(length)]
    if found.ndim != 1 or found.dtype.kind not in "SO":
        raise EpisodeError(f"{name}: {at} holds neither JPEGs nor RGB frames")
    return [bytes(frame) for frame in found[()]]


def _plain(value: object) -> str | int:
    """An attribute as a JSON value."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    plain = value.item() if isinstance(value, np.generic) else value
    return plain if isinstance(plain, int) else str(plain)


def seen_sentences(path: Path) -> tuple[str, ...]:
    """The distinct training sentences that official data keep beside the episode at `path`, if
    there are any; those of `unseen` are left where they are."""
    at = path.absolute().parent.parent / "instructions" / f"{path.stem}.json"
    try:
        listed = json.loads(text_beside(at))["seen"]
        return tuple(dict.fromkeys(text for text in listed if isinstance(text, str) and text))
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return ()


def text_beside(path: Path, most: int = MOST_TEXT) -> str:
    """What the file at `path` says, nothing if it is none. Raises OSError, and ValueError for one
    that is no UTF-8 or has more than `most` bytes."""
    if not path.is_file():
        return ""
    if path.stat().st_size > most:
        raise ValueError(f"{path.name} has more than {most} bytes")
    return path.read_text(encoding="utf-8")


def write_episode(
    path: Path, episode: Episode, more: Mapping[str, str | NDArray[np.generic]] | None = None
) -> None:
    """Write `episode`, frames as JPEG, and `more` data by name, at once or not at all."""
    h5py = _module("h5py", "h5py")
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs["instruction"] = episode.instruction
        for key, value in episode.about.items():
            file.attrs[key] = value
        file["joint_action/vector"] = episode.commanded
        for arm, columns in enumerate(episode.space.arms):
            side = columns.name
            file[f"joint_action/{side}_arm"] = episode.commanded[:, columns.body]
            file[f"joint_action/{side}_gripper"] = episode.commanded[:, columns.gripper]
            file[f"endpose/{side}_endpose"] = episode.ee[:, arm, :-1]
            file[f"endpose/{side}_gripper"] = episode.ee[:, arm, -1]
        if episode.measured is not None:
            file["joint_action/measured"] = episode.measured
        for camera, frames in episode.frames.items():
            file[VIEWS[camera]] = np.array([to_jpeg(f) for f in frames], dtype="S")
        for name, data in (more or {}).items():
            file[name] = data
    replace_file(path, stream.getvalue())


def to_jpeg(frame: Frame) -> bytes:
    """uint8 (H, W, 3) RGB as official recordings keep it; bytes stay what they are."""
    if isinstance(frame, bytes):
        return frame
    stream = io.BytesIO()
    swapped = np.ascontiguousarray(frame[..., ::-1])
    _module("PIL.Image", "Pillow").fromarray(swapped).save(stream, "JPEG", quality=QUALITY)
    return stream.getvalue()


def require() -> None:
    """Raises EpisodeError, saying what to install, if demonstrations cannot be read or written."""
    _module("h5py", "h5py")
    _module("PIL.Image", "Pillow")


def _module(name: str, package: str) -> ModuleType:
    try:
        return import_module(name)
    except ImportError as error:
        raise EpisodeError(
            f"reading and recording demonstrations needs {package}, which is not installed; "
            f"{remedy(name.partition('.')[0])}"
        ) from error
