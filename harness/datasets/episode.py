"""One episode of a data set: what a robot did in one trial, frame by frame, and its file.

A frame is what a learner sees before it acts; what is executed then is the command of the next
frame. The file is a zip without compression, with the same bytes for the same episode:

    episode.json                 everything that is no array and no picture
    commanded.npy, ...           the arrays, `ARRAYS`
    head.mp4                     a camera's film, or
    head/000000.jpg, ...         its stills, png or jpg

Times in it are fixed. Numbers come back to the bit; a file that was torn, or changed at any byte
that matters, is refused.
"""

import io
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.observation import WIDTH, Pixels
from robospa.schema import one_of, parse_json, read
from robospa.tasks.events import Event
from robospa.trial import TrialKey

FILM_CODECS = ("h264", "av1")
STILL_CODECS = ("png", "jpeg")


@dataclass(frozen=True)
class Camera:
    """How a camera's pictures are kept."""

    codec: Annotated[str, one_of((*FILM_CODECS, *STILL_CODECS))]
    width: Pixels
    height: Pixels

    @property
    def filmed(self) -> bool:
        """True if they are one film, False if they are stills."""
        return self.codec in FILM_CODECS


@dataclass(frozen=True)
class Pictures(Camera):
    """All frames of a camera in the order of the episode: one MP4 file, or a whole file for each,
    in true colours (RGB)."""

    files: tuple[bytes, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class DatasetEpisode:
    """A demonstration of T frames of a robot whose joint action is D wide.

    Raises ValueError if an array is not as long or as wide as the others say.
    """

    key: TrialKey
    """Of the trial: its split is `train`."""
    kind: str
    """`expert`, `noise`, `mistake:NAME` or `midstate`; `official` of an imported recording."""
    success: bool
    """Whether the goal was met when what is written here was replayed."""
    instructions: tuple[str, ...]
    """All distinct training sentences of the scene, that of the trial first."""
    space: ActionSpace
    """What the columns of `commanded`, `measured` and `action` are."""
    stride: int
    """Physics steps of 1/250 s from one frame to the next while something moves; 0 for keyframes:
    a frame only where an action of the expert's own begins or ends."""
    commanded: NDArray[np.float32]
    """(T, D): joints [rad] and grippers (0 closed, 1 open) as last commanded."""
    measured: NDArray[np.float32]
    """(T, D): the same, as measured."""
    action: NDArray[np.float32]
    """(T, D): what a learner should do now. It is what was done, `executed`, but where `label` says
    noise: there it is what the expert meant to do."""
    ee: NDArray[np.float32]
    """(T, 2, 8): per arm x y z [m], qw qx qy qz, gripper, in the world frame."""
    sim_time: NDArray[np.float64]
    """(T,): simulated time since the start [s]."""
    subtask: NDArray[np.int32]
    """(T,): index in `subtasks` of what is being done, -1 for nothing in particular."""
    label: NDArray[np.uint8]
    """(T,): whose command the frame's action is, as an index of `LABELS`
    (`robospa.harness.demonstrations.noise`)."""
    environment_state: NDArray[np.float32]
    """(T, E): the objects as numbers, measured at the frame, named by `NAMES` of
    `robospa.observation`; E is 0 where they were not asked for."""
    prefix_action: NDArray[np.float32]
    """(P, D): actions that lead from the start of the trial to the first frame; P is 0 but for
    `midstate`."""
    subtasks: tuple[str, ...] = ()
    """What the subtasks are, in words."""
    events: tuple[Event, ...] = ()
    """What the goal noted while the episode was recorded, with the simulated time of each [s]."""
    scene_digest: str = ""
    replay_digest: str = ""
    """Of the simulator's state at the end of the replay."""
    failure: str = ""
    """Type of failure of a mistake's replay (`robospa.results.failures`), such as
    `target_grounding`; empty where the goal was met."""
    pictures: Mapping[str, Pictures] = field(default_factory=dict)
    """By camera, T frames each."""
    about: Mapping[str, str] = field(default_factory=dict)
    """What made it: `suite` and `version`."""
    absent: tuple[str, ...] = ()
    """Names of what an imported recording does not have: features of LeRobot's formats such as
    `measured_state`, and facts such as `success`. Whatever stands here for them is not written."""
    source: str = ""
    """The file that it was imported from, below what was imported."""
    source_sha256: str = ""

    def __post_init__(self) -> None:
        frames, width = len(self), self.space.width
        shapes = {
            "commanded": (frames, width), "measured": (frames, width), "action": (frames, width),
            "ee": (frames, 2, 8), "sim_time": (frames,), "subtask": (frames,), "label": (frames,),
            "environment_state": (frames, WIDTH if self.environment_state.size else 0),
            "prefix_action": (len(self.prefix_action), width),
        }  # fmt: skip
        for name, shape in shapes.items():
            found = getattr(self, name).shape
            if found != shape:
                raise ValueError(f"{name} has the shape {found}, not {shape}")
        for camera, seen in self.pictures.items():
            if not seen.filmed and len(seen.files) != frames:
                raise ValueError(f"camera {camera} has {len(seen.files)} frames, not {frames}")

    def __len__(self) -> int:
        """Its number of frames, T."""
        return len(self.commanded)

    @property
    def executed(self) -> NDArray[np.float32]:
        """(T, D): the command of the next frame; the last row repeats the last command. Sent one
        after the other after `prefix_action`, they are the trial that was verified."""
        return np.concatenate([self.commanded[1:], self.commanded[-1:]])


ARRAYS: Mapping[str, type[np.generic]] = {
    "commanded": np.float32,
    "measured": np.float32,
    "action": np.float32,
    "ee": np.float32,
    "sim_time": np.float64,
    "subtask": np.int32,
    "label": np.uint8,
    "environment_state": np.float32,
    "prefix_action": np.float32,
}
"""The arrays of an episode and what their numbers are."""


FORMAT = 2
"""Version of this file's layout; another is refused."""
HEADER = "episode.json"
ENDINGS = {"png": "png", "jpeg": "jpg"}
TIME = (1980, 1, 1, 0, 0, 0)
"""The earliest that a zip can say."""


class EpisodeFileError(Exception):
    """A file is no episode that can be read; the message says which and why."""


@dataclass(frozen=True)
class _Kept(Camera):
    """What is said of a camera's pictures; they are files of their own."""

    frames: int = 0

    def names(self, camera: str) -> list[str]:
        """Of these files."""
        if self.filmed:
            return [f"{camera}.mp4"]
        return [f"{camera}/{t:06d}.{ENDINGS[self.codec]}" for t in range(self.frames)]


@dataclass(frozen=True)
class _Header:
    """`episode.json`."""

    format: int
    key: TrialKey
    kind: str
    success: bool
    instructions: tuple[str, ...]
    space: ActionSpace
    stride: Annotated[int, Meta(ge=0)]
    subtasks: tuple[str, ...]
    events: tuple[Event, ...]
    scene_digest: str
    replay_digest: str
    failure: str
    cameras: dict[str, _Kept]
    about: dict[str, str]


SAME = [field.name for field in fields(_Header) if field.name not in ("format", "cameras", "about")]
"""What an episode and its header have alike."""


def episode_bytes(episode: DatasetEpisode) -> bytes:
    """The content of the file of `episode`."""
    cameras = {
        camera: _Kept(seen.codec, seen.width, seen.height, len(episode))
        for camera, seen in episode.pictures.items()
    }
    same = {name: getattr(episode, name) for name in SAME}
    header = _Header(FORMAT, **same, cameras=cameras, about=dict(episode.about))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as file:

        def put(name: str, data: bytes) -> None:
            file.writestr(zipfile.ZipInfo(name, TIME), data)

        put(HEADER, msgspec.json.format(msgspec.json.encode(asdict(header)), indent=1))
        for name, dtype in ARRAYS.items():
            put(f"{name}.npy", _npy(np.asarray(getattr(episode, name), dtype)))
        for camera, seen in episode.pictures.items():
            for name, data in zip(cameras[camera].names(camera), seen.files, strict=True):
                put(name, data)
    return stream.getvalue()


def read_episode_file(path: Path) -> DatasetEpisode:
    """The episode in `path`; EpisodeFileError, in one sentence, for whatever cannot be read."""
    try:
        with zipfile.ZipFile(path) as file:
            return _read(file)
    except EpisodeFileError as error:
        raise EpisodeFileError(f"{path} {error}") from error
    except FileNotFoundError as error:
        raise EpisodeFileError(f"there is no file {path}") from error
    except KeyError as error:
        raise EpisodeFileError(f"{path} is torn: {error.args[0]}") from error
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError) as error:
        raise EpisodeFileError(f"{path} is torn or no episode: {error}") from error
    except (OSError, ValueError, RuntimeError) as error:
        raise EpisodeFileError(f"{path} cannot be read as an episode: {error}") from error


def _read(file: zipfile.ZipFile) -> DatasetEpisode:
    data = parse_json(file.read(HEADER).decode())
    version = data.get("format") if isinstance(data, dict) else None
    if version != FORMAT:
        raise EpisodeFileError(
            f"has layout {version!r}, and this version of robospa reads {FORMAT}: read it with the "
            "version that wrote it, or collect it again"
        )
    header = read(_Header, data, HEADER, EpisodeFileError)
    same = {name: getattr(header, name) for name in SAME}
    same |= {name: _array(file, name, dtype) for name, dtype in ARRAYS.items()}
    found = {
        name: Pictures(of.codec, of.width, of.height, tuple(map(file.read, of.names(name))))
        for name, of in header.cameras.items()
    }
    return DatasetEpisode(**same, pictures=found, about=header.about)


def _npy(array: NDArray[np.generic]) -> bytes:
    stream = io.BytesIO()
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    np.lib.format.write_array(stream, np.ascontiguousarray(little), (1, 0), allow_pickle=False)
    return stream.getvalue()


def _array(file: zipfile.ZipFile, name: str, dtype: type[np.generic]) -> NDArray[Any]:
    data = io.BytesIO(file.read(f"{name}.npy"))
    found = np.lib.format.read_array(data, allow_pickle=False)
    if found.dtype != dtype:
        raise EpisodeFileError(f"has {name} of {found.dtype}, not {np.dtype(dtype)}")
    if not np.isfinite(found).all():
        raise EpisodeFileError(f"has numbers in {name} that are not finite")
    array: NDArray[Any] = found
    return array
