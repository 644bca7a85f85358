"""Which step comes next: from objects now and as first seen, a sentence, and the steps done.

Four layers in turn. Each attends to the words anew (its *control*), scales and shifts the objects
by what it read (FiLM, Perez et al. 2018), and compares them two by two; between layers a soft
pointer hops to an object, and what lies how far and in which direction from there is fed back, so
that "the second farthest from the red one" is one hop and one comparison. Answers are pointers, so
there may be any number of objects in any order; a place is a heat map over the table, not a mean.
Importing this module imports torch.

Letters in comments: B states, N objects, L words, C channels.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.rnn import pad_sequence

from robospa.baselines.learned.perceive import load_weights
from robospa.baselines.learned.scenes import SEEN_WIDTH, TOKEN_WIDTH, last_of, tokens_of
from robospa.baselines.learned.steps import KINDS, TYPES, WEIGHTS, WITH_GOAL, State, Step, taken
from robospa.tasks.colors import NAMED
from robospa.workcell import TABLE_TOP

WORD = re.compile(r"[a-z]+|[0-9]")
EMPTY, UNKNOWN, FIRST_WORD = 0, 1, 2
PIECES, MEANING = WEIGHTS / "pieces.npz", 128
LONGEST = 64
"""Words of a sentence that are read."""
COUNTED = 24
"""Steps done are counted up to that."""
SYNONYMS, ALIKE = 6, 0.5
"""So many other words may stand for one, if their meanings are at least so near (a cosine)."""
HEADS, LAYERS = 4, 4
PERIODS = (4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""Words know their place in the sentence by waves of so many words."""
LOW = -1e4
"""The liking of what is not there."""
CELL, ORIGIN, GRID = 0.01, (-0.40, -0.34), (80, 64)
"""The heat map: the size of its cells [m], its corner, and cells along x and y."""
FEATURES, RELATIONS, WAVES = 19, 11, 13
"""Numbers of an object, of a pair of objects, and of a length."""


def words_of(sentence: str) -> list[str]:
    """The words of a sentence in lower case, digits one by one: "2nd" is "2", "nd"."""
    return WORD.findall(sentence.lower())


def vocabulary_of(sentences: Iterable[str], least: int = 1) -> tuple[str, ...]:
    """All words that occur `least` times, the frequent ones first, then by the alphabet."""
    count = Counter(word for sentence in sentences for word in words_of(sentence))
    kept = (word for word in count if count[word] >= least)
    return tuple(sorted(kept, key=lambda word: (-count[word], word)))


@cache
def _pieces() -> tuple[dict[str, int], NDArray[np.float32]]:
    """Pieces of words, those that begin one with "\u2581", and the vector of each: the main
    components of those of wordllama (l2_supercat, MIT licence)."""
    with np.load(PIECES) as kept:
        names = kept["pieces"].tobytes().decode().split(" ")
        return {name: i for i, name in enumerate(names)}, kept["vectors"] * kept["scale"]


@cache
def meaning(word: str) -> NDArray[np.float32]:
    """(MEANING,): what a word means in general, of unit length: the mean of its longest pieces."""
    numbers, vectors = _pieces()
    left, found = "\u2581" + word, []
    while left:
        sizes = range(len(left), 0, -1)
        size = next((n for n in sizes if left[:n] in numbers), 0)
        if size:
            found.append(vectors[numbers[left[:size]]])
        left = left[max(size, 1) :]
    mean = np.mean(found, axis=0) if found else np.zeros(MEANING, np.float32)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-6), np.float32)


class Vocabulary:
    """Sentences as rows of numbers: of the words that training knew, and what all words mean."""

    def __init__(self, words: Sequence[str]) -> None:
        self.words = tuple(words)
        self._numbers = {word: FIRST_WORD + i for i, word in enumerate(self.words)}

    def numbers(self, sentence: str) -> NDArray[np.int64]:
        """(LONGEST,): the numbers of the first words, then EMPTY."""
        found = [self._numbers.get(word, UNKNOWN) for word in words_of(sentence)[:LONGEST]]
        return np.array(found + [EMPTY] * (LONGEST - len(found)), np.int64)

    def meanings(self, sentence: str) -> NDArray[np.float32]:
        """(LONGEST, MEANING): what the first words mean, then zeros."""
        made = np.zeros((LONGEST, MEANING), np.float32)
        for row, word in zip(made, words_of(sentence), strict=False):
            row[:] = meaning(word)
        return made

    @cached_property
    def table(self) -> NDArray[np.float32]:
        """(FIRST_WORD + words + others, MEANING): the same by number, and of other words."""
        names, _ = _pieces()
        others = [name[1:] for name in names if WORD.fullmatch(name[1:]) and name[0] == "\u2581"]
        none = [np.zeros(MEANING, np.float32)] * FIRST_WORD
        return np.stack([*none, *(meaning(word) for word in (*self.words, *others))])

    @cached_property
    def synonyms(self) -> NDArray[np.int64]:
        """(FIRST_WORD + words, SYNONYMS): the rows of `table` that mean most nearly the same, the
        word's own where there are fewer than that."""
        like = self.table[: FIRST_WORD + len(self.words)] @ self.table.T
        rows = np.argsort(-like, axis=1)[:, :SYNONYMS]
        near = np.take_along_axis(like, rows, axis=1) > ALIKE
        return np.where(near, rows, np.arange(len(rows))[:, None])


@dataclass(frozen=True)
class Batch:
    """States: `tokens` (B, N, TOKEN_WIDTH), those of no object full of zeros and not `real`
    (B, N); `words` (B, L) and what they mean (B, L, MEANING); `last` (B, 2): steps done and type of
    the last one."""

    tokens: Tensor
    real: Tensor
    words: Tensor
    meanings: Tensor
    last: Tensor


def seen_features(rows: Tensor) -> Tensor:
    """(..., SEEN_WIDTH) as (..., 19) numbers of about 1."""
    x, y, z = rows[..., 1], rows[..., 2], rows[..., 3] - TABLE_TOP
    half, turn = rows[..., 4:7], rows[..., 7]
    there = (rows[..., 4] > 0).float()
    turns = [f(k * turn) for k in (1, 2, 4) for f in (torch.cos, torch.sin)]
    logs = torch.log(half.clamp(min=1e-3) / 0.03)
    numbers = torch.stack([x / 0.2, y / 0.15, z / 0.05, *turns], dim=-1)
    rest = [half / 0.03, logs, rows[..., 8:11] * 2, rows[..., 11:12]]
    return torch.cat([numbers, *rest], dim=-1) * there[..., None]


COLORS = torch.tensor(list(NAMED.values())) ** 0.45


def names_of_colors(colors: Tensor) -> Tensor:
    """(..., 3) linear RGB as (..., len(NAMED)): which name fits how well, in shares of 1."""
    away = (colors.clamp(min=0)[..., None, :] ** 0.45 - COLORS).square().sum(dim=-1)
    return (-away / (2 * 0.08**2)).softmax(dim=-1)


def relations(tokens: Tensor) -> Tensor:
    """(B, N, N, 11): where the second object lies from the first, and how they differ."""
    now, first = tokens[..., :SEEN_WIDTH], tokens[..., SEEN_WIDTH : 2 * SEEN_WIDTH]
    rows = torch.where((now[..., 4:5] > 0), now, first)
    way = (rows[:, None, :, 1:4] - rows[:, :, None, 1:4]) / 0.1
    far = way[..., :2].norm(dim=-1, keepdim=True)
    sizes = torch.log(rows[..., 4:7].clamp(min=1e-3))
    unlike = (sizes[:, None] - sizes[:, :, None]) * 3
    color = rows[..., 8:11]
    tint = (color[:, None] - color[:, :, None]).norm(dim=-1, keepdim=True)
    same = (rows[:, None, :, 0] == rows[:, :, None, 0]).float()[..., None]
    return torch.cat([way, far, way[..., :2] / (far + 0.05), unlike, tint, same], dim=-1)


Told = tuple[Tensor, Tensor, Tensor]
"""Words by heads, key and value (B, HEADS, L, C / HEADS), and which are there (B, 1, 1, L)."""


def _read(words: Told, query: Tensor) -> Tensor:
    """(B, N, C): what queries (B, N, C) read."""
    query = query.unflatten(2, (HEADS, -1)).transpose(1, 2)
    read = F.scaled_dot_product_attention(query, *words)
    return read.transpose(1, 2).flatten(2)


def _mean(x: Tensor, real: Tensor) -> Tensor:
    """(B, C): of those of the objects (B, N, C) that are `real` (B, N)."""
    return (x * real[..., None]).sum(dim=1) / real.sum(dim=1, keepdim=True).clamp(min=1)


def _heads(words: Tensor, said: Tensor) -> Told:
    """Of words (B, L, 2 C), keys before values, and which are `said` (B, L)."""
    key, value = words.unflatten(2, (2 * HEADS, -1)).transpose(1, 2).chunk(2, dim=1)
    return key, value, said[:, None, None]


class SentenceReader(nn.Module):
    """Words to vectors that know their neighbours; attention of a control to them."""

    def __init__(self, words: int, width: int) -> None:
        super().__init__()
        self.own = nn.Embedding(words, width)
        nn.init.normal_(self.own.weight, std=0.3)
        self.general = nn.Linear(MEANING, width, bias=False)
        self.count = nn.Embedding(COUNTED, width)
        self.last = nn.Embedding(len(TYPES) + 1, width)
        self.where = nn.Linear(2 * len(PERIODS), width)
        self.mix = nn.ModuleList([nn.Conv1d(width, width, 5, padding=2) for _ in range(2)])
        self.before, self.ask = nn.LayerNorm(width), nn.Linear(width, width)
        self.known, self.joined = nn.Linear(width, 2 * width), nn.Linear(width, width)
        self.norm = nn.LayerNorm(width)

    def forward(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """(B, L + 2, C) and which of them are there; the last two tell of what was done."""
        said = batch.words != EMPTY
        said[:, 0], there = True, said.float()[..., None]
        x = self.own(batch.words) + 4 * self.general(batch.meanings)
        turns = torch.arange(x.shape[1])[:, None] * (2 * math.pi / torch.tensor(PERIODS))
        x = (x + self.where(torch.cat([turns.sin(), turns.cos()], dim=1))) * there
        for mix in self.mix:
            x = (x + F.relu(mix(x.transpose(1, 2)).transpose(1, 2))) * there
        here = self.before(x)
        x = x + self.joined(_read(_heads(self.known(here), said), self.ask(here)))
        done = self.count(batch.last[:, 0].clamp(max=COUNTED - 1))
        last = self.last(batch.last[:, 1] + 1)
        every = torch.cat([self.norm(x), done[:, None], last[:, None]], dim=1)
        return every, torch.cat([said, torch.ones_like(batch.last) > 0], dim=1)


class ObjectLayer(nn.Module):
    """One reading of the words, by all and by each object; one comparison of the objects."""

    def __init__(self, width: int, pair: int) -> None:
        super().__init__()
        self.start = nn.Parameter(torch.randn(width) * 0.3)
        self.query, self.ask = nn.Linear(2 * width, width), nn.Linear(width, width)
        self.film = nn.Linear(width, 2 * width)
        self.before = nn.LayerNorm(width)
        self.here, self.there = nn.Linear(width, pair), nn.Linear(width, pair)
        self.between, self.told = nn.Linear(RELATIONS, pair), nn.Linear(width, 2 * pair)
        self.gate = nn.Linear(pair, pair)
        self.joined = nn.Linear(pair + 2 * width, width)
        self.alone = _twice(width, 2 * width, width)

    def forward(
        self, x: Tensor, relations: Tensor, real: Tensor, control: Tensor, words: Told
    ) -> tuple[Tensor, Tensor]:
        """Objects (B, N, C) and what is read next (B, C), of the same shapes. Each object reads for
        itself, too: how often, as which."""
        query = self.query(torch.cat([control, _mean(x, real)], dim=1)) + self.start
        control = _read(words, query[:, None])[:, 0]
        scale, shift = self.film(control)[:, None].chunk(2, dim=2)
        here = F.relu(self.before(x) * (1 + scale) + shift)
        read = _read(words, self.ask(here))
        aware = here + read
        more, less = self.told(control)[:, None, None].chunk(2, dim=3)
        pair = self.between(relations) * (1 + more) + less
        pair = F.relu(pair + self.here(aware)[:, :, None] + self.there(aware)[:, None])
        pair = pair * torch.sigmoid(self.gate(pair)) * real[:, None, :, None]
        x = x + self.joined(torch.cat([pair.sum(dim=2) / 4, here, read], dim=2))
        return x + self.alone(x), control


@dataclass(frozen=True)
class Answer:
    """Logits: `type` (B, TYPES), `object` (B, N), `hops` (B, LAYERS - 1, N), and `features` for
    the rest."""

    type: Tensor
    object: Tensor
    hops: Tensor
    features: tuple[Tensor, Tensor, Tensor]


class PointNetwork(nn.Module):
    """See the module's text."""

    def __init__(self, words: int, width: int = 96, pair: int = 32) -> None:
        super().__init__()
        self.words, self.known = SentenceReader(words, width), nn.Linear(width, 2 * width)
        self.kind = nn.Embedding(len(KINDS), 32)
        inner = 2 * (FEATURES + 32 + len(NAMED)) + TOKEN_WIDTH - 2 * SEEN_WIDTH
        self.first = _twice(inner, 2 * width, width)
        self.layers = nn.ModuleList([ObjectLayer(width, pair) for _ in range(LAYERS)])
        self.hop = nn.ModuleList([nn.Linear(width, width) for _ in range(LAYERS - 1)])
        self.hopped = nn.ModuleList(
            [nn.Linear(RELATIONS + width + 1, width) for _ in range(LAYERS - 1)]
        )
        self.deed = _twice(3 * width, width, len(TYPES))
        self.object = _twice(2 * width + len(TYPES), width)
        self.goal = _twice(3 * width + len(TYPES) + RELATIONS, width)
        self.none = _twice(2 * width + len(TYPES), width)
        self.place = _twice(3 * width + FEATURES, 2 * width, 64 + 2 * WAVES)
        self.cells = _twice(2 * WAVES, 64, 64)
        grid = _waves(torch.from_numpy(cell_places())).flatten(1)
        self.register_buffer("grid", grid, persistent=False)

    def forward(self, batch: Batch) -> Answer:
        """What is done, and with which object."""
        between = relations(batch.tokens)
        words, said = self.words(batch)
        told = _heads(self.known(words), said)
        x, real = self.first(self._inputs(batch.tokens)), batch.real.float()
        control = words[:, -2] + words[:, -1]
        hops = []
        for i, layer in enumerate(self.layers):
            x, control = layer(x, between, real, control, told)
            if i < LAYERS - 1:
                like = (x * self.hop[i](control)[:, None]).sum(dim=2) / math.sqrt(x.shape[2])
                like = like.masked_fill(~batch.real, LOW)
                share = like.softmax(dim=1)
                way = torch.einsum("bi,bijr->bjr", share, between)
                there = torch.einsum("bi,bic->bc", share, x)[:, None].expand_as(x)
                x = x + self.hopped[i](torch.cat([way, there, share[..., None]], dim=2))
                hops.append(like)
        pooled = x.masked_fill(~batch.real[..., None], LOW).amax(dim=1).clamp(min=-20)
        kinds = self.deed(torch.cat([control, pooled, _mean(x, real)], dim=1))
        every = torch.cat([control, kinds.detach().softmax(dim=1)], dim=1)[:, None]
        liked = self.object(torch.cat([x, every.expand(-1, x.shape[1], -1)], dim=2))[..., 0]
        liked = liked.masked_fill(~batch.real, LOW)
        return Answer(kinds, liked, torch.stack(hops, dim=1), (x, control, between))

    def _inputs(self, tokens: Tensor) -> Tensor:
        parts = []
        for begin in (0, SEEN_WIDTH):
            rows = tokens[..., begin : begin + SEEN_WIDTH]
            there = (rows[..., 4:5] > 0).float()
            parts += [seen_features(rows), self.kind(rows[..., 0].long()) * there]
            parts.append(names_of_colors(rows[..., 8:11]) * there)
        return torch.cat([*parts, tokens[..., 2 * SEEN_WIDTH :]], dim=-1)

    def goal_of(self, answer: Answer, batch: Batch, kind: Tensor, chosen: Tensor) -> Tensor:
        """(B, N + 1): liking of each destination, and of none, when the step is of this kind (B,)
        and its object that (B,)."""
        x, control, between = answer.features
        rows = torch.arange(len(x))
        mine, way = x[rows, chosen], between[rows, chosen]
        told = torch.cat([control, F.one_hot(kind, len(TYPES)).float()], dim=1)
        every = torch.cat([told, mine], dim=1)[:, None].expand(-1, x.shape[1], -1)
        liked = self.goal(torch.cat([x, every, way], dim=2))[..., 0]
        liked = liked.masked_fill(~batch.real, LOW).scatter(1, chosen[:, None], LOW)
        return torch.cat([liked, self.none(torch.cat([told, mine], dim=1))], dim=1)

    def heat_of(self, answer: Answer, batch: Batch, chosen: Tensor) -> Tensor:
        """(B, cells): liking of each cell when the object is that (B,)."""
        x, control, _ = answer.features
        rows = torch.arange(len(x))
        mean = _mean(x, batch.real.float())
        now = seen_features(batch.tokens[rows, chosen, :SEEN_WIDTH])
        told = self.place(torch.cat([control, x[rows, chosen], mean, now], dim=1))
        query, ahead, aside = told.split([64, WAVES, WAVES], dim=1)
        heat = (query @ self.cells(self.grid).T).unflatten(1, (GRID[1], GRID[0]))
        here = batch.tokens[rows, chosen, 1:3]
        columns, lines = (torch.from_numpy(line)[None] for line in _lines())
        heat = heat + (_waves(columns - here[:, :1]) @ ahead[:, :, None]).transpose(1, 2)
        heat = heat + _waves(lines - here[:, 1:]) @ aside[:, :, None]
        return heat.flatten(1)


def _twice(inner: int, width: int, outer: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inner, width), nn.ReLU(), nn.Linear(width, outer))


def _lines() -> list[NDArray[np.float32]]:
    """x and y [m] of the middles of the heat map's columns and lines."""
    return [(ORIGIN[i] + CELL * (np.arange(GRID[i]) + 0.5)).astype(np.float32) for i in (0, 1)]


def cell_places() -> NDArray[np.float32]:
    """(cells, 2): x and y [m] of the middles of the heat map's cells, x running fastest."""
    return np.stack(np.meshgrid(*_lines()), axis=-1).reshape(-1, 2)


def _waves(lengths: Tensor) -> Tensor:
    """(..., WAVES): lengths [m] as waves of 1.6 m and shorter."""
    turns = lengths[..., None] / 0.8 * (math.pi * 2.0 ** torch.arange(6))
    return torch.cat([lengths[..., None] / 0.8, turns.sin(), turns.cos()], dim=-1)


def batch_of(
    tokens: Sequence[NDArray[np.float32]],
    words: NDArray[np.int64],
    meanings: NDArray[np.float32],
    last: NDArray[np.int64],
) -> Batch:
    """States of different numbers of objects, side by side."""
    rows = pad_sequence([torch.from_numpy(item) for item in tokens], batch_first=True)
    real = pad_sequence([torch.ones(len(item)) > 0 for item in tokens], batch_first=True)
    longest = max(1, int((words != EMPTY).sum(axis=1).max()))
    parts = (torch.from_numpy(part) for part in (words[:, :longest], meanings[:, :longest], last))
    return Batch(rows, real, *parts)


class Pointer:
    """Decides the next step, with the weights in `folder`."""

    def __init__(self, folder: Path) -> None:
        self._vocabulary = Vocabulary(json.loads((folder / "words.json").read_text()))
        self._network = PointNetwork(FIRST_WORD + len(self._vocabulary.words))
        load_weights(self._network, folder / "point.npz")

    def next_step(self, state: State, sentence: str) -> Step:
        """What is most liked: a type, then an object for it, then where to, if nothing is there."""
        if not state.objects:
            return Step("done")
        batch = batch_of(
            [tokens_of(state)],
            self._vocabulary.numbers(sentence)[None],
            self._vocabulary.meanings(sentence)[None],
            np.array([last_of(state)], np.int64),
        )
        with torch.inference_mode():
            told = self._network(batch)
            kind, chosen = told.type.argmax(dim=1), told.object.argmax(dim=1)
            name, number = TYPES[int(kind)], int(chosen)
            if name in ("wait", "done"):
                return Step(name)
            if name not in WITH_GOAL:
                return Step(name, number)
            liked = self._network.goal_of(told, batch, kind, chosen)[0]
            goal = int((liked if name == "move" else liked[:-1]).argmax())
            if goal < len(state.objects):
                return Step(name, number, goal)
            heat = self._network.heat_of(told, batch, chosen)[0].numpy()
            for place, far in taken(state, number):
                heat[np.hypot(*(cell_places() - place).T) < far] = LOW
            x, y = cell_places()[int(heat.argmax())].tolist()
            return Step(name, number, None, (x, y))
