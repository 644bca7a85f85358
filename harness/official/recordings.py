"""Published demonstrations on disk: which there are, and what is known of the scene of each.

    <Task>_<level>/<configuration>/data/episode<i>.hdf5     the trajectory
    <Task>_<level>/<configuration>/scene_info.json          of each episode: slots, sometimes layout
    <Task>_<level>/<configuration>/seed.txt                 the seeds, in the order of the episodes

Files of `robospa collect` have their trial's key instead. The pickles beside official files are not
read.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from robospa.harness.convention_check.episodes import Episode, EpisodeError, text_beside
from robospa.schema import parse_json
from robospa.tasks.catalog import LEVELS
from robospa.tasks.catalog import task as find_task
from robospa.trial import REFERENCE, TrialKey

SCENES, SEEDS = "scene_info.json", "seed.txt"
MOST_BYTES = 2**26
MOST_DIGITS = 12
_FILE = re.compile(r"episode_?(\d+)\.hdf5")
_VARIANT = re.compile(r"(.+)_([1-5])")


@dataclass(frozen=True)
class Recording:
    """One demonstration: its file, its number among those beside it, its variant where the folder
    names it, the official seed, and its entry of `scene_info.json`."""

    path: Path
    number: int
    variant: tuple[str, int] | None = None
    seed: int | None = None
    scene: Mapping[str, Any] = field(default_factory=dict)


def find_recordings(folder: Path) -> list[Recording]:
    """All demonstrations below `folder`, by folder and number; raises EpisodeError if there are
    none, or if what lies beside them cannot be read."""
    if not folder.is_dir():
        raise EpisodeError(f"there is no folder {folder}; name the one that holds the recordings")
    files = [
        (path, found) for path in folder.rglob("*.hdf5") if (found := _FILE.fullmatch(path.name))
    ]
    if not files:
        raise EpisodeError(
            f"there are no recordings below {folder}: files called data/episode<i>.hdf5 in a "
            "folder for each task"
        )
    rows = sorted((path.parent, int(found[1]), path) for path, found in files)
    beside = {parent: _beside(parent.parent) for parent, _, _ in rows}
    return [
        replace(_with(number, *beside[parent]), path=path, variant=variant_of(path))
        for parent, number, path in rows
    ]


def recording_of(path: Path) -> Recording:
    """The recording in the file at `path`."""
    path = _plain(path)
    found = _FILE.fullmatch(path.name)
    if found is None:
        return Recording(path, 0)
    return replace(
        _with(int(found[1]), *_beside(path.parent.parent)), path=path, variant=variant_of(path)
    )


def variant_of(path: Path) -> tuple[str, int] | None:
    """The task and level in the names of the folders of `path`, such as `Pick_Blocks_Size_5`."""
    for parent in _plain(path).parents[:4]:
        if found := _VARIANT.fullmatch(parent.name):
            try:
                return find_task(found[1]).name, int(found[2])
            except KeyError:
                continue
    return None


def key_of(episode: Episode) -> TrialKey | None:
    """The trial of an episode of ours; None for one that does not say it."""
    about = episode.about
    task, level, seed = (about.get(name) for name in ("task", "level", "seed"))
    if not isinstance(level, int) or not isinstance(seed, int) or level not in LEVELS:
        return None
    robot, mode = (str(about.get(n, d)) for n, d in (("embodiment", REFERENCE), ("mode", "clean")))
    return TrialKey(str(task), level, seed, robot, mode, str(about.get("split", "train")))


def _with(number: int, scenes: Mapping[str, Any], seeds: list[int]) -> Recording:
    scene = scenes.get(f"episode_{number}", {})
    seed = seeds[number] if number < len(seeds) else None
    return Recording(Path(), number, None, seed, scene if isinstance(scene, dict) else {})


def _beside(folder: Path) -> tuple[Mapping[str, Any], list[int]]:
    """What `folder` says of its episodes: scenes and seeds."""
    try:
        scenes = text_beside(folder / SCENES, MOST_BYTES)
        known = parse_json(scenes) if scenes else {}
        seeds = [_seed(word) for word in text_beside(folder / SEEDS, MOST_BYTES).split()]
    except (OSError, ValueError) as error:
        raise EpisodeError(
            f"{SCENES} or {SEEDS} in {folder} cannot be read: {str(error)[:200]}"
        ) from error
    return (known if isinstance(known, dict) else {}), seeds


def _seed(word: str) -> int:
    if not (word.isascii() and word.isdecimal() and len(word) <= MOST_DIGITS):
        raise ValueError(f"{word[:20]!r} is no seed")
    return int(word)


def _plain(path: Path) -> Path:
    """`path` as it is written, without "..": links are not followed, because the folders that it
    names say what it is."""
    return Path(os.path.abspath(path))
