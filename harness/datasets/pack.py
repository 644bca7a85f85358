"""Packs episode files into a data set of the chosen format, with its card and its hashes.

The same episodes in the same order give the same bytes, so a packing that was cut short is begun
again. `robospa.json` comes last: a data set without it was not finished.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Protocol

from robospa.extras import need
from robospa.harness.datasets.card import CardFacts, write_card
from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.episode_file import read_episode_file
from robospa.harness.datasets.features import Layout, LayoutError, layout_of
from robospa.harness.datasets.films import FilmError
from robospa.harness.datasets.lerobot_v3 import LeRobotV3
from robospa.harness.datasets.lerobot_v21 import LeRobotV21
from robospa.harness.datasets.manifest import (
    FORMAT,
    MANIFEST,
    SUMS,
    DatasetError,
    DatasetManifest,
    EpisodeLines,
    Made,
    read_sums,
    write_made,
    write_sums,
)
from robospa.harness.datasets.robotwin import RoboTwin
from robospa.harness.running.atomic_file import storage_errors

PART = ".packing"
"""Where a data set is written, in its folder, until all but `robospa.json` is there."""


class Writer(Protocol):
    """Writes one format."""

    def add(self, episode: DatasetEpisode) -> str:
        """Write the next episode; its own file below the folder, or ""."""
        ...

    def close(self) -> None:
        """Finish the data set's files."""
        ...


Source = tuple[str, DatasetEpisode]
"""An episode with a name for messages."""
MakeWriter = Callable[[Path, Layout], Writer]


def _maniskill(folder: Path, layout: Layout) -> Writer:
    from robospa.harness.datasets.maniskill import ManiSkill

    return ManiSkill(folder, layout)


FORMATS: Mapping[str, MakeWriter] = {
    "lerobot-v3": LeRobotV3,
    "lerobot-v2.1": LeRobotV21,
    "robotwin-hdf5": RoboTwin,
    "maniskill": _maniskill,
}


def check_packages(layout: str) -> None:
    """Raises MissingPackage if one that writes a format of `FORMATS`, or its card, is not
    installed."""
    table = "pyarrow" if layout.startswith("lerobot") else "h5py"
    for module in (table, "PIL", "matplotlib"):
        need(module, "demos")


def images_of(layout: str) -> tuple[str, ...]:
    """How pictures can be coded for a format of `FORMATS`; the default first. RoboTwin's files
    have JPEGs of their own and ManiSkill's bare pixels, both made from what is kept until then: PNG
    loses nothing."""
    if layout in ("robotwin-hdf5", "maniskill"):
        return ("png", "jpeg", "h264", "av1")
    return ("h264", "av1", "png", "jpeg")


def pack(
    layout: str,
    folder: Path,
    files: Sequence[Path],
    manifest: DatasetManifest,
    on_episode: Callable[[int], None] = lambda count: None,
) -> Made:
    """Write the episodes in `files`, in their order, to `folder` in a format of `FORMATS`.

    What an earlier packing left in `folder` is replaced; anything else stays. `on_episode` is told
    how many are written. Raises DatasetError if there are none or one does not fit the others,
    EpisodeFileError for a file that cannot be read, StorageError if `folder` cannot be written.
    """
    if not files:
        raise DatasetError(f"there is no episode to write to {folder}")
    read = ((str(path), read_episode_file(path)) for path in files)
    return pack_episodes(layout, folder, read, manifest, on_episode, expected=len(files))


def pack_episodes(
    layout: str,
    folder: Path,
    episodes: Iterator[Source],
    manifest: DatasetManifest,
    on_episode: Callable[[int], None] = lambda count: None,
    *,
    expected: int,
    writer: MakeWriter | None = None,
    card: Callable[[CardFacts], str] | None = None,
) -> Made:
    """As `pack`, from `episodes` with their names, at most `expected` of them.

    `writer` makes another one than the format has, `card` another text. What the settings of
    `manifest` say is read after the last episode.
    """
    make = writer or FORMATS[layout]
    part = folder / PART
    with storage_errors(folder):
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        begin = next(episodes, None)
        if begin is None:
            shutil.rmtree(part)
            raise DatasetError(f"there is no episode to write to {folder}{_why(manifest)}")
        first = layout_of(begin[1])
        facts = CardFacts(layout, first, manifest, expected)
        _write(make(part, first), part, chain([begin], episodes), facts, on_episode)
        write_card(part, facts, card)
        made = Made(
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
        write_made(folder, made)
    return made


def _why(manifest: DatasetManifest) -> str:
    """Why the first of what was left out was, if anything was."""
    left_out = manifest.settings.get("left_out")
    return f": {left_out[0]['source']}: {left_out[0]['why']}" if left_out else ""


def _write(
    writer: Writer,
    folder: Path,
    episodes: Iterable[Source],
    facts: CardFacts,
    on_episode: Callable[[int], None],
) -> None:
    lines = EpisodeLines(folder)
    try:
        for index, (name, episode) in enumerate(episodes):
            try:
                file = writer.add(episode)
            except (LayoutError, FilmError) as error:
                raise DatasetError(f"{name} cannot be packed: {error}") from error
            lines.add(index, episode, file)
            facts.add(episode)
            on_episode(index + 1)
    finally:
        lines.close()
    writer.close()


def _remove_packed(folder: Path) -> None:
    """Remove what an earlier packing left, and nothing else."""
    (folder / MANIFEST).unlink(missing_ok=True)
    if not (folder / SUMS).exists():
        return
    for name in read_sums(folder):
        (folder / name).unlink(missing_ok=True)
    (folder / SUMS).unlink()


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def files_below(folder: Path) -> list[Path]:
    """All files below `folder`, sorted by their paths."""
    return sorted(path for path in folder.rglob("*") if not path.is_dir())
