"""Is a data set what was collected? Hashes, counts, schema, and replays of a sample.

Everything that is wrong is one sentence. What a file holds is looked into only where its hash is
right, and episodes are replayed only where all of that is: the first cause is what is told.
"""

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.convention_check.episodes import EpisodeError
from robospa.harness.datasets.manifest import (
    MANIFEST,
    SUMS,
    DatasetError,
    DatasetRecord,
    EpisodeLine,
    file_hash,
    read_lines,
    read_record,
    read_sums,
)
from robospa.harness.datasets.pack import FORMATS, PART, files_below
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import FIRST_TRAINING_SEED, LAST_TRAINING_SEED

REPLAYS = 59
"""Episodes replayed if no number is given: the fewest that find, in 95 of 100 cases, at least one
bad episode where a twentieth are bad (1 - 0.95 ** 59 > 0.95)."""
CONFIDENCE = 0.95
RECORDINGS = "official-recordings"
"""In place of a suite: imported recordings, whose scenes the official code alone can make."""
BESIDE = ("episodes", ".lock", PART, MANIFEST, SUMS)
"""What may lie in a data set's folder without being in SHA256SUMS."""


EpisodeReplay = Callable[[EpisodeLine, NDArray[np.float32]], tuple[bool, str]]
"""Replays an episode from its commanded joints (T, D): whether the goal was met, and the digest of
the simulator's state at the end."""


@dataclass(frozen=True)
class Verification:
    """What was found: `problems`, a sentence each, and `checked`, what was looked at."""

    problems: tuple[str, ...]
    checked: tuple[str, ...]


def verify(
    folder: Path,
    replays: int = REPLAYS,
    replay: EpisodeReplay | None = None,
) -> Verification:
    """Check the data set in `folder`, replaying so many episodes (all, if there are no more).

    `replay` runs an episode; without one the simulator does. Raises DatasetError where `folder` is
    no data set that can be checked.
    """
    made = read_record(folder)
    if made.layout not in FORMATS:
        raise DatasetError(
            f"{folder} is of the format {made.layout!r}, and this version of robospa knows "
            f"{', '.join(FORMATS)}: verify it with the version that made it"
        )
    if problems := tuple(_hash_problems(folder, made)):
        return Verification(problems, ())
    checked = [f"All {len(read_sums(folder)):,} files have the hashes that {SUMS} names."]
    lines = [_light(line) for line in read_lines(folder)]
    if problems := (*_line_problems(made, lines), *_misfits(folder, made.layout, lines)):
        return Verification(problems, tuple(checked))
    checked.append(
        f"{len(lines):,} episodes with {made.frames:,} frames: as many, in the same order and with "
        f"the same columns, in {MANIFEST}, the lists of episodes and the data."
    )
    suite = made.about.get("suite")
    if suite == RECORDINGS or not replays:
        text = "No episode was replayed."
        if suite == RECORDINGS:
            text = "Official recordings: their scenes are not known here, so none was replayed."
        return Verification((), (*checked, text))
    if suite != SUITE:
        problem = f"its scenes are of the suite {suite}, and those of this version of {SUITE}"
        return Verification((f"no episode can be replayed: {problem}",), tuple(checked))
    sample = _sample(folder, len(lines), replays, made.sums)
    problems = tuple(_replay_problems(folder, made, sample, replay or in_simulator()))
    if not problems:
        checked.append(replayed_sentence(len(sample), len(lines)))
    return Verification(problems, tuple(checked))


def replayed_sentence(sample: int, total: int) -> str:
    """What `sample` good replays out of `total` episodes show."""
    how = "met or missed its goal as when it was collected, and ended in the same state to the bit"
    if sample == total:
        return f"All {total:,} episodes were replayed: each {how}."
    share = 1 - (1 - CONFIDENCE) ** (1 / sample)
    return (
        f"{sample:,} of {total:,} episodes, drawn at random, were replayed: each {how}. "
        f"Were {share:.1%} of all episodes bad, such a sample would have found one "
        f"in {CONFIDENCE:.0%} of cases."
    )


def _hash_problems(folder: Path, made: DatasetRecord) -> Iterator[str]:
    if not (folder / SUMS).exists():
        yield f"{SUMS} is missing"
        return
    if file_hash(folder / SUMS) != made.sums:
        yield f"{SUMS} is not the one that {MANIFEST} names: it was changed or torn"
        return
    sums = read_sums(folder)
    for name, digest in sums.items():
        path = folder / name
        if not path.is_file():
            yield f"{name} is missing"
        elif file_hash(path) != digest:
            yield f"{name} is not what was written: it was changed or torn"
    for path in files_below(folder):
        below = path.relative_to(folder)
        if below.parts[0] in BESIDE or below.parts[0].startswith("."):
            continue
        if below.as_posix() not in sums:
            yield f"{below} is not part of the data set: move it away"


def _line_problems(made: DatasetRecord, lines: Sequence[EpisodeLine]) -> Iterator[str]:
    found = (len(lines), sum(line.frames for line in lines))
    if found != (made.episodes, made.frames):
        yield (
            f"{MANIFEST} says {made.episodes} episodes with {made.frames} frames, and its list of "
            f"episodes has {found[0]} with {found[1]}"
        )
    seen: set[object] = set()
    imported = made.about.get("suite") == RECORDINGS
    for index, line in enumerate(lines):
        if line.episode_index != index:
            yield f"episode {index} is listed as number {line.episode_index}"
        if (line.source or line.key) in seen:
            yield f"{line.source or line.key.slug} is there twice"
        seen.add(line.source or line.key)
        if imported:
            if not (line.source and line.source_sha256) or line.success is not None:
                yield f"episode {index} is no official recording, as {MANIFEST} says"
            continue
        if not FIRST_TRAINING_SEED <= line.key.seed <= LAST_TRAINING_SEED:
            yield f"{line.key.slug} has a seed of evaluation"
        if line.key.split != "train":
            yield f"{line.key.slug} has sentences of evaluation"
        if line.success is line.kind.startswith("mistake"):
            ends = "meets" if line.success else "does not meet"
            yield f"episode {index} is of the kind {line.kind}, and {ends} its goal"


def _misfits(folder: Path, layout: str, lines: Sequence[EpisodeLine]) -> Iterator[str]:
    try:
        yield from FORMATS[layout].misfits(folder, lines)
    except (OSError, ValueError, LookupError, TypeError, EpisodeError) as error:
        yield f"the files in {folder} cannot be read as {layout}: {error}"


def _light(line: EpisodeLine) -> EpisodeLine:
    """Without what takes memory: there may be hundreds of thousands."""
    return replace(line, instructions=(), subtasks=(), prefix_action=())


def _sample(folder: Path, total: int, count: int, seed: str) -> list[EpisodeLine]:
    """`count` of the episodes, drawn by the data set's own hash, in their order."""
    chosen = set(random.Random(seed).sample(range(total), min(count, total)))
    return [line for line in read_lines(folder) if line.episode_index in chosen]


def _replay_problems(
    folder: Path,
    made: DatasetRecord,
    sample: Sequence[EpisodeLine],
    replay: EpisodeReplay,
) -> Iterator[str]:
    for line in sample:
        name = f"episode {line.episode_index} ({line.key.slug})"
        try:
            success, digest = replay(line, FORMATS[made.layout].commands(folder, line))
        except Exception as error:  # whatever a simulator or a foreign task says
            yield f"{name} cannot be replayed: {error}"
            continue
        if success is not line.success:
            was, now = ("succeeded", "fails") if line.success else ("failed", "succeeds")
            yield f"{name} {was} when it was collected, and {now} when replayed"
        elif digest != line.replay_digest:
            yield (
                f"{name} ends in another state than when it was collected, with the same success: "
                f"it was made with robospa {made.about.get('version')}"
            )


def in_simulator() -> EpisodeReplay:
    """Replays episodes in the simulator, one after the other in one world, without pictures."""
    from robospa.harness.demonstrations.demonstration import replay as replayed
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=False)

    def run(line: EpisodeLine, commanded: NDArray[np.float32]) -> tuple[bool, str]:
        prefix = np.array(line.prefix_action, np.float32).reshape(-1, commanded.shape[1])
        record = replayed(world, line.key, commanded, prefix, line.kind)
        return record.success, record.digest

    return run
