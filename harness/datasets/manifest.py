"""What a finished data set says of itself, in files that all of its formats have:

    robospa.json                  its settings, counts and failed seeds; written last
    meta/robospa_episodes.jsonl   a line an episode, in the data set's order
    meta/robospa_events.jsonl     a line an event of an episode, in the same order
    SHA256SUMS                    of every other file, as `sha256sum --check` reads it
    README.md                     its card

A data set without `robospa.json` was not finished.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.running.atomic_file import replace_file
from robospa.schema import Count, Sha256, parse_json, read
from robospa.trial import TrialKey

FORMAT = 1
"""Version of these files; another is refused."""
MANIFEST, SUMS = "robospa.json", "SHA256SUMS"
EPISODES, EVENTS = "meta/robospa_episodes.jsonl", "meta/robospa_events.jsonl"


class DatasetError(Exception):
    """A folder is no data set, or no sound one; the message says which and why."""


@dataclass(frozen=True)
class SeedFailure:
    """A seed that gave no episode."""

    key: TrialKey
    why: str


@dataclass(frozen=True)
class DatasetManifest:
    """How a data set came about."""

    command: str
    """The command line that makes it."""
    settings: Mapping[str, Any]
    """What was set in it, as JSON values."""
    failures: tuple[SeedFailure, ...] = ()
    """Seeds that gave no episode."""


@dataclass(frozen=True)
class DatasetRecord:
    """`robospa.json`: the manifest, and what was packed."""

    format: Annotated[int, Meta(ge=1)]
    layout: str
    robot: str
    episodes: Count
    frames: Count
    sums: Sha256
    """Of the file SHA256SUMS."""
    about: dict[str, str]
    """What made the episodes: `suite` and `version`."""
    command: str
    settings: dict[str, Any]
    failures: tuple[SeedFailure, ...] = ()


@dataclass(frozen=True)
class EpisodeLine:
    """A line of `meta/robospa_episodes.jsonl`."""

    episode_index: Count
    key: TrialKey
    kind: str
    success: bool | None
    """None where it is not known."""
    frames: Count
    stride: Annotated[int, Meta(ge=0)]
    scene_digest: str
    replay_digest: str
    instructions: tuple[str, ...]
    subtasks: tuple[str, ...] = ()
    failure: str = ""
    file: str = ""
    """The episode's own file, where it has one, below the data set's folder."""
    prefix_action: tuple[tuple[float, ...], ...] = ()
    """(P, D): actions before the first frame."""
    absent: tuple[str, ...] = ()
    """Of an imported recording: what it does not have; where these are fields here they are empty,
    and the key's seed is 0."""
    source: str = ""
    """Of an imported recording: the file that was read, below what was imported, and its hash."""
    source_sha256: str = ""


SAME = (
    "key", "kind", "stride", "scene_digest", "replay_digest", "instructions", "subtasks", "failure",
    "absent", "source", "source_sha256",
)  # fmt: skip
"""What an episode and its line have alike."""


IMPORTED = ("absent", "source", "source_sha256")
"""Fields of a line that only imported recordings have."""


class EpisodeLines:
    """Writes the two files of lines, episode by episode."""

    def __init__(self, folder: Path) -> None:
        (folder / EPISODES).parent.mkdir(parents=True, exist_ok=True)
        self._episodes = (folder / EPISODES).open("w", encoding="utf-8")
        self._events = (folder / EVENTS).open("w", encoding="utf-8")

    def add(self, index: int, episode: DatasetEpisode, file: str = "") -> None:
        """Write the lines of `episode`. An event's `frame_index` is the first frame not before
        it."""
        line = asdict(
            EpisodeLine(
                episode_index=index,
                success=None if "success" in episode.absent else episode.success,
                frames=len(episode),
                file=file,
                prefix_action=tuple(tuple(row) for row in episode.prefix_action.tolist()),
                **{name: getattr(episode, name) for name in SAME},
            )
        )
        self._episodes.write(
            json_line({n: of for n, of in line.items() if of or n not in IMPORTED})
        )
        times = np.array([event.time for event in episode.events])
        frames = np.minimum(np.searchsorted(episode.sim_time, times - 1e-9), len(episode) - 1)
        for event, frame in zip(episode.events, frames, strict=True):
            where = {"episode_index": index, "frame_index": int(frame)}
            self._events.write(json_line({**where, **asdict(event)}))

    def close(self) -> None:
        """Finish both files."""
        self._episodes.close()
        self._events.close()


def json_line(value: object) -> str:
    """One line of JSON."""
    return json.dumps(value, ensure_ascii=False) + "\n"


def read_lines(folder: Path) -> Iterator[EpisodeLine]:
    """The episodes of the data set in `folder`, in its order; raises DatasetError."""
    path = folder / EPISODES
    try:
        with path.open(encoding="utf-8") as file:
            for number, text in enumerate(file, 1):
                what = f"{path}, line {number},"
                yield read(EpisodeLine, parse_json(text), what, DatasetError)
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}") from error


def write_sums(folder: Path, files: Sequence[Path]) -> str:
    """Write SHA256SUMS for `files`, and return its own hash."""
    lines = [f"{file_hash(path)}  {path.relative_to(folder).as_posix()}\n" for path in files]
    data = "".join(lines).encode()
    replace_file(folder / SUMS, data)
    return hashlib.sha256(data).hexdigest()


def read_sums(folder: Path) -> dict[str, str]:
    """Every file's hash by its path below `folder`, as SHA256SUMS says; raises DatasetError."""
    try:
        lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise DatasetError(f"{folder / SUMS} cannot be read: {error}") from error
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def file_hash(path: Path) -> str:
    """SHA-256 of the file `path`, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_record(folder: Path, made: DatasetRecord) -> None:
    """Write `robospa.json`: from then on the data set is finished."""
    text = json.dumps(asdict(made), indent=1, ensure_ascii=False) + "\n"
    replace_file(folder / MANIFEST, text.encode())


def read_record(folder: Path) -> DatasetRecord:
    """What the data set in `folder` says of itself; DatasetError if it is none, or unfinished, or
    of another version."""
    path = folder / MANIFEST
    try:
        data = parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise DatasetError(_no_data_set(folder)) from error
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}") from error
    version = data.get("format") if isinstance(data, dict) else None
    if version != FORMAT:
        raise DatasetError(
            f"{path} is of version {version!r}, and this version of robospa reads {FORMAT}: verify "
            "the data set with the version that made it"
        )
    return read(DatasetRecord, data, str(path), DatasetError)


def _no_data_set(folder: Path) -> str:
    if not folder.is_dir():
        return f"there is no folder {folder}"
    if (folder / "episodes").is_dir() or (folder / EPISODES).exists():
        return (
            f"the data set in {folder} was not finished: it has no {MANIFEST}; go on with the "
            "command that began it and --resume"
        )
    return f"{folder} is no data set that `robospa collect` made: it has no {MANIFEST}"
