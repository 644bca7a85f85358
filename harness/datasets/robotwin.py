"""Writes demonstrations as RoboTwin and RoboSPA keep them, one HDF5 file each.

    <task>/<configuration>/data/episode0.hdf5
    <task>/<configuration>/instructions/episode0.json     {"seen": [...], "unseen": []}

A base task's levels share a folder and count on. Besides what `robospa collect --record` writes, a
file has `language_instruction`, which X-VLA reads, and the group `robospa`. Pictures are JPEGs with
red and blue exchanged, as official ones are, and are coded here: keep PNG until then.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.convention_check.episodes import Episode, read_episode, write_episode
from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.features import EpisodeLayout
from robospa.harness.datasets.manifest import EpisodeLine
from robospa.harness.datasets.pictures import all_pictures
from robospa.harness.running.atomic_file import replace_file
from robospa.trial import TrialKey, path_part

CONFIGURATIONS = {"clean": "demo_clean", "randomized-seen": "demo_randomized"}


class RoboTwin:
    """Writes demonstrations below `folder`."""

    def __init__(self, folder: Path, layout: EpisodeLayout) -> None:
        self._folder, self._layout = folder, layout
        self._counts: dict[Path, int] = {}

    def add(self, episode: DatasetEpisode) -> str:
        """Write `episode`; its file, below the folder. Raises EpisodeMisfit."""
        self._layout.check(episode)
        below = configuration(episode.key)
        number = self._counts.get(below, 0)
        self._counts[below] = number + 1
        path = below / "data" / f"episode{number}.hdf5"
        write_episode(self._folder / path, _converted(path.name, episode), _more(episode))
        self.write_sentences(path, episode)
        return path.as_posix()

    def write_sentences(self, path: Path, episode: DatasetEpisode) -> None:
        """Write the sentences of `episode`, which is at `path` below the folder."""
        sentences = {"seen": list(episode.instructions), "unseen": []}
        text = json.dumps(sentences, indent=2, ensure_ascii=False) + "\n"
        beside = self._folder / path.parent.parent / "instructions" / f"{path.stem}.json"
        replace_file(beside, text.encode())

    def close(self) -> None:
        """Nothing: every file is finished."""


def configuration(key: TrialKey) -> Path:
    """The folder of a trial's demonstrations, below the data set's."""
    return Path(key.task) / CONFIGURATIONS.get(key.mode, f"demo_{path_part(key.mode)}")


def _converted(name: str, episode: DatasetEpisode) -> Episode:
    names = ("stride", "kind", "scene_digest", "replay_digest")
    about = {**asdict(episode.key), **{name: getattr(episode, name) for name in names}}
    return Episode(
        name,
        episode.commanded.astype(float),
        episode.ee.astype(float),
        {camera: list(all_pictures(seen)) for camera, seen in episode.pictures.items()},
        episode.space,
        episode.instructions[0],
        episode.measured.astype(float),
        about,
    )


def _more(episode: DatasetEpisode) -> dict[str, str | np.ndarray]:
    objects = episode.environment_state
    return {
        **({"robospa/environment_state": objects} if objects.size else {}),
        "language_instruction": episode.instructions[0],
        "robospa/action": episode.action,
        "robospa/sim_time": episode.sim_time,
        "robospa/subtask": episode.subtask,
        "robospa/label": episode.label,
    }


def commands(folder: Path, line: EpisodeLine) -> NDArray[np.float32]:
    """The commanded joints (T, D) of an episode."""
    return read_episode(folder / line.file).commanded.astype(np.float32)


def misfits(folder: Path, lines: Iterable[EpisodeLine]) -> Iterator[str]:
    """A sentence for everything in the files that is not as the episodes `lines` say."""
    import h5py

    for line in lines:
        with h5py.File(folder / line.file) as file:
            found = {len(file["joint_action/vector"])}
            found.update(len(of["rgb"]) for of in file["observation"].values())
        if found != {line.frames}:
            yield f"{line.file} has {' and '.join(map(str, found))} frames, not {line.frames}"
        sentences = Path(line.file).parent.parent / "instructions" / f"{Path(line.file).stem}.json"
        if not json.loads((folder / sentences).read_text())["seen"]:
            yield f"{sentences} has no sentence"
