"""What is learned from: the frames of data sets, as arrays in memory.

A frame is shown with the keyframes that follow it in its episode, and with a sentence of that
episode. All of it follows from the data, the seed and the number of the step alone, so a training
that is taken up again goes on as if it had not been interrupted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.act.augment import (
    SIDES,
    mirrored_arms,
    mirrored_objects,
    permuted,
)
from robospa.baselines.learned.act.poses import WIDTH, from_joints, from_poses
from robospa.baselines.learned.words import words_of
from robospa.harness.datasets.manifest import SUMS, EpisodeLine, file_hash, read_lines, read_record
from robospa.harness.robots import embodiment
from robospa.observation import FEATURES, SLOTS
from robospa.observation import WIDTH as ENVIRONMENT_WIDTH

KINDS = ("expert", "midstate")
"""Kinds of episodes that are learned from: mistakes are not."""
STATE, EE = "observation.state", "ee_pose"
ENVIRONMENT = "observation.environment_state"


class DataError(ValueError):
    """A data set cannot be learned from; the message says which, why and what to do."""


@dataclass(frozen=True)
class Batch:
    """B frames: `arms` (B, 20) as they are, `objects` (B, SLOTS, features), `words` (B, W) 1 for
    each word of the sentence, and the chunk of K keyframes that follows, `target` (B, K, 20), of
    which those that are `beyond` (B, K) the episode's end count for nothing."""

    arms: NDArray[np.float32]
    objects: NDArray[np.float32]
    words: NDArray[np.float32]
    target: NDArray[np.float32]
    beyond: NDArray[np.bool_]


@dataclass(frozen=True)
class Examples:
    """N frames of E episodes of one robot."""

    robot: str
    arms: NDArray[np.float32]
    """(N, 20): the measured end effectors, as a keyframe."""
    commanded: NDArray[np.float32]
    """(N, 20): what was commanded last, as a keyframe."""
    objects: NDArray[np.float32]
    """(N, SLOTS, features)."""
    bounds: NDArray[np.int64]
    """(E + 1,): the first frame of every episode, then N."""
    sentences: tuple[NDArray[np.int32], ...]
    """The numbers, in `texts`, of every episode's sentences."""
    texts: tuple[str, ...]
    """All sentences."""
    variants: tuple[str, ...]
    """Of every episode, as "Pick_Blocks_Size-L1"."""
    sources: tuple[str, ...] = ()
    """Hashes of the data sets."""
    episode: NDArray[np.int64] = field(init=False, repr=False)
    """(N,): the episode of every frame."""

    def __post_init__(self) -> None:
        lengths = np.diff(self.bounds)
        object.__setattr__(self, "episode", np.repeat(np.arange(len(lengths)), lengths))

    @property
    def episodes(self) -> int:
        """How many there are."""
        return len(self.bounds) - 1

    @property
    def slots(self) -> int:
        """Slots up to the last one that an object of any episode takes."""
        taken = self.objects[:, :, FEATURES.index("present")].any(axis=0)
        return int(np.flatnonzero(taken).max(initial=0)) + 1

    def held_out(self, share: float) -> NDArray[np.bool_]:
        """(E,): the episodes that are only for validation, evenly spread: at least one of them and
        one other, where there are two."""
        count = min(max(1, round(share * self.episodes)), self.episodes - 1)
        chosen = np.zeros(self.episodes, bool)
        chosen[((np.arange(count) + 0.5) * self.episodes / max(count, 1)).astype(int)] = True
        return chosen

    def learned_from(self, held_out: float, episodes: int) -> NDArray[np.bool_]:
        """(E,): those that the share `held_out` leaves; the first `episodes` of each variant, or
        all of them if that is 0."""
        chosen = ~self.held_out(held_out)
        if episodes:
            seen: Counter[str] = Counter()
            for number in np.flatnonzero(chosen).tolist():
                variant = self.variants[number]
                chosen[number] = seen[variant] < episodes
                seen[variant] += 1
        return chosen


def read_examples(folders: Sequence[Path]) -> Examples:
    """The frames of data sets of `robospa collect`; raises DataError or DatasetError."""
    parts = [_read(folder) for folder in folders]
    if len({part.robot for part in parts}) != 1:
        robots = " and ".join(sorted({part.robot for part in parts})) or "no robot"
        raise DataError(f"the data sets are of {robots}: a policy is trained for one robot")
    return parts[0] if len(parts) == 1 else _joined(parts)


def _read(folder: Path) -> Examples:
    import pyarrow.parquet as pq

    made = read_record(folder)
    if made.layout != "lerobot-v3":
        raise DataError(f"{folder} is of the format {made.layout}, and lerobot-v3 is what is read")
    columns = [STATE, ENVIRONMENT, EE, "episode_index"]
    files = sorted((folder / "data").glob("*/*.parquet"))
    if not files or ENVIRONMENT not in pq.read_schema(files[0]).names:
        raise DataError(
            f"{folder} does not tell of the objects: collect it with --environment-state "
            "--frames keyframes"
        )
    lines = list(read_lines(folder))
    wanted = np.array([line.kind in KINDS for line in lines])
    found: dict[str, list[NDArray[np.float32]]] = {name: [] for name in columns[:3]}
    episode = []
    for path in files:
        table = pq.read_table(path, columns=columns)
        rows = table["episode_index"].to_numpy()
        kept = wanted[rows]
        episode.append(rows[kept])
        for name, parts in found.items():
            column = table[name].combine_chunks()
            flat = np.asarray(column.flatten().to_numpy(zero_copy_only=False), np.float32)
            parts.append(flat.reshape(len(rows), -1)[kept])
    state, objects, ee = (np.concatenate(parts) for parts in found.values())
    if objects.shape[1] != ENVIRONMENT_WIDTH:
        raise DataError(
            f"{folder} has {objects.shape[1]} numbers of the objects a frame, and this version of "
            f"robospa {ENVIRONMENT_WIDTH}: collect it again"
        )
    chosen = [line for line, kept in zip(lines, wanted, strict=True) if kept]
    starts = np.flatnonzero(np.diff(np.concatenate(episode), prepend=-1))
    sentences, texts = _numbered(chosen)
    return Examples(
        made.robot,
        from_poses(ee.reshape(len(ee), 2, 8)),
        from_joints(state, embodiment(made.robot)),
        objects.reshape(len(objects), SLOTS, len(FEATURES)),
        np.array([*starts, len(state)], np.int64),
        sentences,
        texts,
        tuple(f"{line.key.task}-L{line.key.level}" for line in chosen),
        (file_hash(folder / SUMS)[:16],),
    )


def _numbered(
    lines: Sequence[EpisodeLine],
) -> tuple[tuple[NDArray[np.int32], ...], tuple[str, ...]]:
    numbers: dict[str, int] = {}
    sentences = tuple(
        np.array([numbers.setdefault(text, len(numbers)) for text in line.instructions], np.int32)
        for line in lines
    )
    return sentences, tuple(numbers)


def _joined(parts: Sequence[Examples]) -> Examples:
    numbers: dict[str, int] = {}
    sentences: list[NDArray[np.int32]] = []
    for part in parts:
        here = np.array([numbers.setdefault(t, len(numbers)) for t in part.texts], np.int32)
        sentences += [here[of] for of in part.sentences]
    first = np.cumsum([0, *(len(part.arms) for part in parts)])
    bounds = [part.bounds[:-1] + first[i] for i, part in enumerate(parts)]
    return Examples(
        parts[0].robot,
        np.concatenate([part.arms for part in parts]),
        np.concatenate([part.commanded for part in parts]),
        np.concatenate([part.objects for part in parts]),
        np.concatenate([*bounds, first[-1:]]),
        tuple(sentences),
        tuple(numbers),
        tuple(variant for part in parts for variant in part.variants),
        tuple(source for part in parts for source in part.sources),
    )


class WordTable:
    """Sentences as 1 for each of their words that `words` has. Order and number say nothing."""

    def __init__(self, words: Sequence[str]) -> None:
        self._columns = {word: i for i, word in enumerate(words)}

    def __len__(self) -> int:
        """How many words are known."""
        return len(self._columns)

    def columns(self, sentence: str) -> NDArray[np.int64]:
        """The columns of the known words of `sentence`, each once."""
        known = {self._columns[word] for word in words_of(sentence) if word in self._columns}
        return np.array(sorted(known), np.int64)

    def row(self, sentence: str) -> NDArray[np.float32]:
        """float32 (W,)."""
        row = np.zeros(len(self), np.float32)
        row[self.columns(sentence)] = 1.0
        return row


@dataclass(frozen=True)
class Drawing:
    """How frames are drawn and altered: keyframes of a `chunk`, the share `starts` of the frames in
    which a chunk begins when chunks are carried out one after the other, the share `word_dropout`
    of words that are left out, and the share `mirror` of scenes that are shown in a mirror."""

    chunk: int
    starts: float = 1.0
    word_dropout: float = 0.0
    mirror: float = 0.0


class Sampler:
    """Draws batches of the episodes of `examples` for which `chosen` (E,) is True."""

    def __init__(
        self,
        examples: Examples,
        table: WordTable,
        chosen: NDArray[np.bool_],
        how: Drawing,
    ) -> None:
        self._examples, self._how, self._width = examples, how, len(table)
        self._columns = [table.columns(text) for text in examples.texts]
        self._sided = np.array([not SIDES.isdisjoint(words_of(t)) for t in examples.texts])
        self._first = examples.bounds[:-1][chosen]
        self._frames = np.flatnonzero(chosen[examples.episode])
        within = self._frames - examples.bounds[examples.episode[self._frames]]
        self._begins = self._frames[within % how.chunk == 0]

    def batch(self, size: int, *key: int) -> Batch:
        """`size` frames, which follow from `key`."""
        rng = np.random.default_rng(key)
        anywhere = self._frames[rng.integers(len(self._frames), size=size)]
        begin = self._begins[rng.integers(len(self._begins), size=size)]
        frames = np.where(rng.random(size) < self._how.starts, begin, anywhere)
        texts = self._texts(frames, rng)
        keep = rng.random((size, self._width)) >= self._how.word_dropout
        batch = self._at(frames, texts)
        mirror = (rng.random(size) < self._how.mirror) & ~self._sided[texts]
        objects = np.where(mirror[:, None, None], mirrored_objects(batch.objects), batch.objects)
        permuted(objects, rng, self._examples.slots)
        return replace(
            batch,
            arms=np.where(mirror[:, None], mirrored_arms(batch.arms), batch.arms),
            objects=objects,
            words=batch.words * keep,
            target=np.where(mirror[:, None, None], mirrored_arms(batch.target), batch.target),
        )

    def first_frames(self, most: int) -> Batch:
        """The first frames of up to `most` episodes, evenly spread, as they are."""
        at = np.unique(np.linspace(0, len(self._first) - 1, most).round().astype(int))
        frames = self._first[at]
        return self._at(frames, self._texts(frames, None))

    def _texts(
        self, frames: NDArray[np.int64], rng: np.random.Generator | None
    ) -> NDArray[np.int64]:
        """The number of a sentence for each frame: one of its episode's, or the first of them."""
        told = [self._examples.sentences[e] for e in self._examples.episode[frames].tolist()]
        return np.array([of[0 if rng is None else rng.integers(len(of))] for of in told], np.int64)

    def _at(self, frames: NDArray[np.int64], texts: NDArray[np.int64]) -> Batch:
        examples = self._examples
        last = examples.bounds[1:][examples.episode[frames]] - 1
        after = frames[:, None] + 1 + np.arange(self._how.chunk)
        words = np.zeros((len(frames), self._width), np.float32)
        for row, text in enumerate(texts.tolist()):
            words[row, self._columns[text]] = 1.0
        return Batch(
            examples.arms[frames],
            examples.objects[frames],
            words,
            examples.commanded[np.minimum(after, last[:, None])],
            after > last[:, None],
        )


def moments(
    examples: Examples, chosen: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean (20,) and standard deviation (20,) of the commanded keyframes of the episodes `chosen`;
    what hardly varies counts as varying by LEAST_SPREAD."""
    rows = examples.commanded[chosen[examples.episode]].astype(float)
    assert rows.shape[1] == WIDTH
    spread = np.maximum(rows.std(axis=0), LEAST_SPREAD)
    return rows.mean(axis=0).astype(np.float32), spread.astype(np.float32)


LEAST_SPREAD = 0.05
