"""Packs episode files into a data set of the chosen format, with its card and its hashes.

The same episodes in the same order give the same bytes, so a packing that was cut short is begun
again. `robospa.json` comes last: a data set without it was not finished.
"""

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.datasets import lerobot, robotwin
from robospa.harness.datasets.card import CardFacts, write_card
from robospa.harness.datasets.episode import DatasetEpisode, read_episode_file
from robospa.harness.datasets.features import EpisodeLayout, EpisodeMisfit, layout_of
from robospa.harness.datasets.manifest import (
    FORMAT,
    MANIFEST,
    SUMS,
    DatasetError,
    DatasetManifest,
    DatasetRecord,
    EpisodeLine,
    EpisodeLines,
    read_sums,
    write_record,
    write_sums,
)
from robospa.harness.datasets.pictures import EpisodeFilmError
from robospa.harness.datasets.settings import AUTO
from robospa.harness.running.atomic_file import storage_errors
from robospa.harness.settings import SettingsError
from robospa.registry import did_you_mean

PART = ".packing"
"""Where a data set is written, in its folder, until all but `robospa.json` is there."""


Writer = lerobot.LeRobotV3 | lerobot.LeRobotV21 | robotwin.RoboTwin
Source = tuple[str, DatasetEpisode]
"""An episode with a name for messages."""
MakeWriter = Callable[[Path, EpisodeLayout], Writer]
FILMED, STILL = ("h264", "av1", "png", "jpeg"), ("png", "jpeg", "h264", "av1")


@dataclass(frozen=True)
class DatasetFormat:
    """One format of data sets: its name in words, the package that writes it, how pictures can be
    coded (the default first), its writer, and how it is read back.

    `commands` gives the commanded joints (T, D) of an episode, `misfits` a sentence for everything
    in the files that is not as the episodes' lines say.
    """

    title: str
    package: str
    images: tuple[str, ...]
    writer: MakeWriter
    commands: Callable[[Path, EpisodeLine], NDArray[np.float32]]
    misfits: Callable[[Path, Sequence[EpisodeLine]], Iterable[str]]


def _lerobot(
    title: str, writer: type[lerobot.LeRobotV3] | type[lerobot.LeRobotV21]
) -> DatasetFormat:
    misfits = partial(lerobot.misfits, writer.version)
    return DatasetFormat(title, "pyarrow", FILMED, writer, lerobot.commands, misfits)


FORMATS: Mapping[str, DatasetFormat] = {
    "lerobot-v3": _lerobot("LeRobot dataset v3.0", lerobot.LeRobotV3),
    "lerobot-v2.1": _lerobot("LeRobot dataset v2.1", lerobot.LeRobotV21),
    # RoboTwin's files have JPEGs of their own, made from what is kept until then: PNG loses nothing
    "robotwin-hdf5": DatasetFormat(
        "RoboTwin's HDF5", "h5py", STILL, robotwin.RoboTwin, robotwin.commands, robotwin.misfits
    ),
}


def image_codec(layout: str, wanted: str) -> str:
    """How pictures are kept in the format `layout`, if they are `wanted` so; SettingsError if there
    is no such format, or it cannot hold them."""
    if layout not in FORMATS:
        near = did_you_mean(layout, FORMATS)
        raise SettingsError(f"no format {layout!r}; {near}known are {', '.join(FORMATS)}")
    known = FORMATS[layout].images
    if wanted != AUTO and wanted not in known:
        raise SettingsError(f"{layout} holds no {wanted} but {', '.join(known)}")
    return known[0] if wanted == AUTO else wanted


def pack(
    layout: str, folder: Path, files: Sequence[Path], manifest: DatasetManifest
) -> DatasetRecord:
    """Write the episodes in `files`, in their order, to `folder` in a format of `FORMATS`.

    What an earlier packing left in `folder` is replaced; anything else stays. Raises DatasetError
    if there are none or one does not fit the others, EpisodeFileError for a file that cannot be
    read, StorageError if `folder` cannot be written.
    """
    read = ((str(path), read_episode_file(path)) for path in files)
    return pack_episodes(layout, folder, read, manifest, expected=len(files))


def pack_episodes(
    layout: str,
    folder: Path,
    episodes: Iterator[Source],
    manifest: DatasetManifest,
    *,
    expected: int,
    writer: MakeWriter | None = None,
) -> DatasetRecord:
    """As `pack`, from `episodes` with their names, at most `expected` of them.

    `writer` makes another one than the format has. What the settings of `manifest` say is read
    after the last episode.
    """
    make = writer or FORMATS[layout].writer
    part = folder / PART
    with storage_errors(folder):
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        begin = next(episodes, None)
        if begin is None:
            shutil.rmtree(part)
            left_out = manifest.settings.get("left_out")
            why = f": {left_out[0]['source']}: {left_out[0]['why']}" if left_out else ""
            raise DatasetError(f"there is no episode to write to {folder}{why}")
        first = layout_of(begin[1])
        facts = CardFacts(layout, FORMATS[layout].title, first, manifest, expected)
        _write(make(part, first), part, chain([begin], episodes), facts)
        write_card(part, facts)
        made = DatasetRecord(
            FORMAT,
            layout,
            first.robot,
            facts.episodes,
            facts.frames,
            write_sums(part, files_below(part)),
            facts.about,
            manifest.command,
            dict(manifest.settings),
            manifest.failures,
        )
        _remove_packed(folder)
        for path in sorted(part.iterdir()):
            _remove(folder / path.name)
            path.rename(folder / path.name)
        part.rmdir()
        write_record(folder, made)
    return made


def _write(writer: Writer, folder: Path, episodes: Iterable[Source], facts: CardFacts) -> None:
    with closing(EpisodeLines(folder)) as lines:
        for index, (name, episode) in enumerate(episodes):
            try:
                file = writer.add(episode)
            except (EpisodeMisfit, EpisodeFilmError) as error:
                raise DatasetError(f"{name} cannot be packed: {error}") from error
            lines.add(index, episode, file)
            facts.add(episode)
    writer.close()


def _remove_packed(folder: Path) -> None:
    (folder / MANIFEST).unlink(missing_ok=True)
    for name in (*read_sums(folder), SUMS) if (folder / SUMS).exists() else ():
        (folder / name).unlink(missing_ok=True)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def files_below(folder: Path) -> list[Path]:
    """All files below `folder`, sorted by their paths."""
    return sorted(path for path in folder.rglob("*") if not path.is_dir())
