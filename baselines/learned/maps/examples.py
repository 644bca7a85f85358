"""Decisions of demonstrations as arrays, in a folder that training reads and a resumed one reuses.

An episode gives a decision for each of its primitives, and the one that nothing is left to do. Its
sentences are all that the data set has for its scene. Which episodes are held out follows from
their trials alone.
"""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.maps.primitives import DONE, KINDS, Decision, decisions_of
from robospa.baselines.learned.maps.proprioception import WIDTH, features
from robospa.baselines.learned.maps.table_map import TableMap
from robospa.harness.datasets.episode import (
    DatasetEpisode,
    EpisodeFileError,
    EpisodeFilm,
    read_episode_file,
)
from robospa.harness.demonstrations.recorder import KEYFRAMES
from robospa.harness.robots import embodiment
from robospa.workcell import TABLE_TOP

MAPS, NUMBERS, ABOUT = "maps.npy", "numbers.npz", "examples.json"
CAMERA = "head"
PARTS = 10_000
"""Held-out shares are told apart so finely."""


class DataError(ValueError):
    """A data set cannot be learned from; the message says why and what to do."""


@dataclass(frozen=True)
class Examples:
    """N decisions of E episodes."""

    maps: NDArray[np.uint8]
    """(N, rows, columns, 3): the table as seen when it was decided."""
    body: NDArray[np.float32]
    """(N, WIDTH): arms and what was done before (`proprioception`)."""
    kind: NDArray[np.int64]
    """(N,): index in KINDS, or DONE."""
    numbers: NDArray[np.float64]
    """(N, 7): arm, x, y [m], height over the table [m], turn, tilt [rad], opening; 0 for DONE."""
    episode: NDArray[np.int64]
    """(N,): whose decision it is."""
    sentences: tuple[tuple[str, ...], ...]
    """By episode."""
    variants: tuple[str, ...]
    """By episode: "Pick_Blocks_Size-L1"."""
    share: NDArray[np.float64]
    """(E,): 0 to 1, by which episodes are held out: those below the share wanted."""
    robot: str
    skipped: tuple[str, ...] = ()
    """Episodes that no decisions could be read from, and why."""


def episode_files(folders: Sequence[Path]) -> list[Path]:
    """All episodes of these data sets, in a fixed order; DataError for one that has none."""
    found: list[Path] = []
    for folder in folders:
        files = sorted((folder / "episodes").rglob("[0-9]*.zip"))
        if not files:
            raise DataError(
                f"{folder} holds no episodes: collect it with robospa collect --frames keyframes "
                "--keep-episodes"
            )
        found += files
    return found


def read_examples(folders: Sequence[Path], cache: Path) -> Examples:
    """The decisions in the data sets `folders`, kept in `cache`; from there, if they were read
    before. Raises DataError."""
    files = episode_files(folders)
    listed = [[str(path.name), path.stat().st_size] for path in files]
    if not _kept(cache, listed):
        _write(files, cache, listed)
    return examples_in(cache)


def examples_in(cache: Path) -> Examples:
    """What `read_examples` has kept in `cache`; DataError if there is nothing."""
    if not (cache / ABOUT).exists():
        raise DataError(f"{cache} holds no examples: train with robospa learn first")
    about = json.loads((cache / ABOUT).read_text())
    with np.load(cache / NUMBERS) as numbers:
        arrays = {name: numbers[name] for name in ("body", "kind", "numbers", "episode", "share")}
    return Examples(
        maps=np.load(cache / MAPS, mmap_mode="r"),
        sentences=tuple(tuple(some) for some in about["sentences"]),
        variants=tuple(about["variants"]),
        robot=about["robot"],
        skipped=tuple(about["skipped"]),
        **arrays,
    )


def _kept(cache: Path, files: list[list[object]]) -> bool:
    """Whether `cache` holds what was read from these files."""
    try:
        about = json.loads((cache / ABOUT).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(about, dict) and about.get("files") == files


def _write(files: Sequence[Path], cache: Path, listed: list[list[object]]) -> None:
    """Read `files` and write what they hold into `cache`, what says so last."""
    cache.mkdir(parents=True, exist_ok=True)
    (cache / ABOUT).unlink(missing_ok=True)
    table = TableMap()
    sentences: list[tuple[str, ...]] = []
    variants, skipped, robots, shares = [], [], set(), []
    body, kind, numbers, episodes = [], [], [], []
    drawn = cache / "maps.raw"
    with drawn.open("wb") as out:
        for path in files:
            episode = _read(path)
            if episode.stride != KEYFRAMES:
                raise DataError(
                    f"{path} has frames between the expert's actions: collect the data set with "
                    "--frames keyframes"
                )
            if not episode.success or episode.kind != "expert":
                skipped.append(f"{path}: an episode of the kind {episode.kind}")
                continue
            try:
                decisions = decisions_of(embodiment(episode.key.embodiment), episode.commanded)
            except ValueError as error:
                skipped.append(f"{path}: {error}")
                continue
            robots.add(episode.key.embodiment)
            done: list[str] = []
            for decision, picture in zip(
                decisions, _pictures(path, episode, decisions), strict=True
            ):
                robot = embodiment(episode.key.embodiment)
                out.write(table.draw(picture).tobytes())
                body.append(features(robot, episode.measured[decision.frame], done))
                row = _numbers(decision)
                kind.append(DONE if row is None else KINDS.index(_kind(decision)))
                numbers.append([0.0] * 7 if row is None else row)
                episodes.append(len(sentences))
                done.append(_kind(decision))
            sentences.append(episode.instructions)
            variants.append(f"{episode.key.task}-L{episode.key.level}")
            shares.append((zlib.crc32(episode.key.slug.encode()) % PARTS) / PARTS)
    if len(robots) != 1:
        drawn.unlink()
        raise DataError(
            f"the data sets hold demonstrations of {', '.join(sorted(robots)) or 'no robot'}: a "
            "checkpoint is of one robot, so train with data sets of one"
        )
    raw = np.memmap(drawn, np.uint8, "r", shape=(len(kind), table.rows, table.columns, 3))
    np.save(cache / MAPS, raw)
    drawn.unlink()
    np.savez(
        cache / NUMBERS,
        body=np.array(body, np.float32).reshape(-1, WIDTH),
        kind=np.array(kind, np.int64),
        numbers=np.array(numbers, np.float64),
        episode=np.array(episodes, np.int64),
        share=np.array(shares, np.float64),
    )
    about = {
        "files": listed,
        "sentences": sentences,
        "variants": variants,
        "robot": robots.pop(),
        "skipped": skipped,
    }
    (cache / ABOUT).write_text(json.dumps(about))


def _read(path: Path) -> DatasetEpisode:
    try:
        return read_episode_file(path)
    except EpisodeFileError as error:
        raise DataError(f"{error}; collect it again") from error


def _kind(decision: Decision) -> str:
    return "" if decision.primitive is None else decision.primitive.kind


def _numbers(decision: Decision) -> list[float] | None:
    """A row of `Examples.numbers`; None for nothing to do."""
    one = decision.primitive
    if one is None:
        return None
    x, y, z = one.point
    return [float(one.arm), x, y, z - TABLE_TOP, one.turn, one.tilt, one.opening]


def _pictures(
    path: Path, episode: DatasetEpisode, decisions: Sequence[Decision]
) -> Iterator[NDArray[np.uint8]]:
    """What the head camera saw at every decision; DataError if it is not there."""
    seen = episode.pictures.get(CAMERA)
    if seen is None:
        raise DataError(
            f"{path} has no pictures of the head camera: collect it with --cameras head"
        )
    if isinstance(seen, EpisodeFilm):
        from robospa.harness.datasets.pictures import film_frames

        wanted = [decision.frame for decision in decisions]
        frames = list(islice(film_frames(seen.data), wanted[-1] + 1))
        yield from (frames[at] for at in wanted)
        return
    from PIL import Image

    for decision in decisions:
        with Image.open(io.BytesIO(seen.frames[decision.frame])) as image:
            yield np.asarray(image.convert("RGB"), np.uint8)
