"""Official recordings as a data set: what they have, in our formats, and nothing that they lack.

    <Task>_<level>/<configuration>/data/episode<i>.hdf5             commands, poses, pictures
    <Task>_<level>/<configuration>/instructions/episode<i>.json     sentences; those of `seen` count
    <Task>_<level>/<configuration>/seed.txt                         seeds, if it is there

What they do not hold (`ABSENT`) is left out of the data set, and its card says so. Without their
scenes nobody can play them again, so verification looks at hashes and counts alone.
"""

import shlex
import shutil
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.convention_check.episodes import (
    Episode,
    EpisodeError,
    read_episode,
    seen_sentences,
)
from robospa.harness.datasets.episode import DatasetEpisode, Pictures
from robospa.harness.datasets.features import UNSTATED, EpisodeLayout, EpisodeMisfit, layout_of
from robospa.harness.datasets.manifest import MANIFEST, DatasetManifest, DatasetRecord, file_hash
from robospa.harness.datasets.pack import Source, image_codec, pack_episodes
from robospa.harness.datasets.pictures import encode
from robospa.harness.datasets.robotwin import RoboTwin
from robospa.harness.datasets.settings import AUTO
from robospa.harness.datasets.verify import RECORDINGS
from robospa.harness.official.recordings import OfficialRecording, key_of
from robospa.harness.official.sentences import SEEN
from robospa.harness.settings import SettingsError
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

ABSENT = (
    "measured_state", "sim_time", "subtask_index", "label", "embodiment", "success", "failure",
    "scene_digest", "replay_digest", "stride",
)  # fmt: skip
"""Features of our formats, and facts of an episode, that official recordings do not have."""
OFFICIAL = "official"
"""The kind of their episodes."""


def import_recordings(
    recordings: Sequence[OfficialRecording], home: Path, layout: str, out: Path, images: str = AUTO
) -> DatasetRecord:
    """Write the official `recordings`, which lie below `home`, as a data set in `out`.

    `images` is how pictures are kept; robotwin-hdf5 has the files as they are. What cannot be read,
    or does not fit the first, is left out with its reason, in the record's settings. Raises
    SettingsError for a format that does not exist or a folder that is not empty, DatasetError if no
    recording is left, CodecMissing, StorageError.
    """
    codec = image_codec(layout, images)
    if (out / MANIFEST).exists() or (out.is_dir() and any(out.iterdir())):
        raise SettingsError(f"{out} is not empty: choose another --out")
    left_out: list[dict[str, str]] = []
    settings: dict[str, Any] = {
        "imported": len(recordings), "format": layout, "images": codec, "absent": list(ABSENT),
        "left_out": left_out,
    }  # fmt: skip
    words = ["robospa", "collect", "--import", "DATA", "--format", layout, "--out", "DIR"]
    sources = _sources(recordings, home, "png" if layout == "robotwin-hdf5" else codec, left_out)
    manifest = DatasetManifest(shlex.join(words), settings)
    writer = partial(Copies, home=home) if layout == "robotwin-hdf5" else None
    return pack_episodes(layout, out, sources, manifest, writer=writer, expected=len(recordings))


def _sources(
    recordings: Sequence[OfficialRecording], home: Path, codec: str, left_out: list[dict[str, str]]
) -> Iterator[Source]:
    """The recordings that fit with the first that can be read; the others go to `left_out`."""
    layout: EpisodeLayout | None = None
    for recording in recordings:
        name = source(recording, home)
        try:
            episode = to_episode(recording, home, codec)
            layout = layout or layout_of(episode)
            layout.check(episode)
        except (EpisodeError, EpisodeMisfit) as error:
            left_out.append({"source": name, "why": str(error)})
            continue
        yield name, episode


def source(recording: OfficialRecording, home: Path) -> str:
    """Where a recording is below `home`."""
    return recording.path.absolute().relative_to(home.absolute()).as_posix()


def to_episode(recording: OfficialRecording, home: Path, codec: str) -> DatasetEpisode:
    """A recording with what it has. Raises EpisodeError for one that cannot be read, is ours, or
    lacks its task, level or sentences."""
    if recording.variant is None:
        raise EpisodeError("its folder names no task and level, such as Pick_Blocks_Size_5")
    found = read_episode(recording.path, instruction=" ")
    if key_of(found) is not None:
        raise EpisodeError("it is a recording of robospa, no official one")
    if not found.frames:
        raise EpisodeError("it has no pictures")
    instructions = seen_sentences(recording.path)
    if not instructions:
        raise EpisodeError("no sentence is beside it: instructions/<episode>.json has no `seen`")
    configuration = recording.path.absolute().parents[1].name
    task, level = recording.variant
    key = TrialKey(task, level, recording.seed or 0, UNSTATED, configuration, SEEN)
    commanded = found.commanded.astype(np.float32)
    frames = len(found)
    absent = ABSENT if recording.seed is not None else (*ABSENT, "seed")
    return DatasetEpisode(
        key=key,
        kind=OFFICIAL,
        success=False,
        instructions=instructions,
        space=found.space,
        stride=0,
        commanded=commanded,
        measured=np.zeros_like(commanded),
        action=np.concatenate([commanded[1:], commanded[-1:]]),
        ee=found.ee.astype(np.float32),
        sim_time=np.zeros(frames),
        subtask=np.full(frames, -1, np.int32),
        label=np.zeros(frames, np.uint8),
        environment_state=np.zeros((frames, 0), np.float32),
        prefix_action=np.zeros((0, found.space.width), np.float32),
        pictures=_pictures(found, codec),
        about={"suite": RECORDINGS, "version": version("robospa")},
        absent=absent,
        source=source(recording, home),
        source_sha256=file_hash(recording.path),
    )


def _pictures(episode: Episode, codec: str) -> dict[str, Pictures]:
    """All frames of all cameras, in the sizes of their first."""
    cameras = []
    for name in episode.frames:
        height, width = episode.own_picture(name, 0).shape[:2]
        cameras.append(CameraSpec(name, width, height))
    images: Iterator[list[NDArray[np.uint8]]] = (
        [episode.picture(camera, t) for camera in cameras] for t in range(len(episode))
    )
    return encode(images, cameras, codec)


class Copies(RoboTwin):
    """Puts recordings below `home`, which are in this layout, below `folder`, each where it was."""

    def __init__(self, folder: Path, layout: EpisodeLayout, home: Path) -> None:
        super().__init__(folder, layout)
        self._home = home

    def add(self, episode: DatasetEpisode) -> str:
        """Copy the file of `episode`, and write its training sentences; its path."""
        self._layout.check(episode)
        path = Path(episode.source)
        target = self._folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self._home / path, target)
        self.write_sentences(path, episode)
        return path.as_posix()
