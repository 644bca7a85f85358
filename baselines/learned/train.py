"""The recipe: lessons and pictures made, then two parts trained, by one command that goes on where
it was stopped. Needs torch, and Pillow and the simulator's renderer for pictures.

Every batch is a function of the training's seed and the step, so a resumed training makes the very
steps that one in a piece would.
"""

from __future__ import annotations

import io
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from msgspec import Meta
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from robospa.baselines.learned import perceive, point, scenes
from robospa.baselines.learned.perceive import FindNetwork, MeasureNetwork
from robospa.baselines.learned.point import Batch, PointNetwork, Vocabulary
from robospa.baselines.learned.scenes import NOTHING, SEEN_WIDTH, Lesson, lesson
from robospa.baselines.learned.steps import WEIGHTS
from robospa.harness.datasets.manifest import file_hash
from robospa.harness.pool import JobProcess, Pool
from robospa.harness.running.atomic_file import replace_file
from robospa.protocol.options import option
from robospa.tasks.catalog import tasks
from robospa.tasks.scene import SUITE

Count = Annotated[int, Meta(ge=1)]
BATCH, PICTURES, EVERY = 64, 16, 200
"""States and pictures of a step; a line, and what can be gone on from, after so many steps."""
RATES = {"point": (1e-3, 0.6), "find": (2e-3, 0.0), "measure": (2e-3, 0.0)}
"""Learning rates, reached in WARM steps, and the share of the steps after which they fall."""
PARAPHRASES = WEIGHTS / "paraphrases.txt"
SAID_ANEW, LONGEST_PHRASE = (0.0, 0.5, 0.9), 9
"""Shares of a sentence's phrases that are said in another way; words of the longest phrase."""
WARM, QUICK = 100, 0.7
"""Perception is trained at lower precision in a share QUICK of its steps."""


@dataclass(frozen=True)
class TrainOptions:
    """How much is made and learned."""

    blocks: Count = option(120, "lessons of so many scenes of each variant")
    pictures: Count = option(50, "so many pictures of each variant")
    point: Count = option(36_000, "steps of what chooses the next step")
    find: Count = option(14_000, "steps of what finds objects in pictures")
    measure: Count = option(12_000, "steps of what measures them")
    seed: int = option(0, "seed of weights and batches")


say = partial(print, flush=True)
Losses = Mapping[str, Tensor]
"""Parts of a loss, which are summed."""


def fit(
    out: Path,
    name: str,
    network: nn.Module,
    options: TrainOptions,
    losses: Callable[[np.random.Generator, bool], Losses],
) -> None:
    """All steps of a network that are left, kept in `out` so that they can be gone on with, and its
    weights. `losses` get random numbers of the step, and whether it may be less exact."""
    path, total = out / f"{name}.pt", int(getattr(options, name))
    rate, level = RATES[name]
    done, shown = 0, dict[str, float]()
    optimizer = torch.optim.AdamW(network.parameters(), rate, weight_decay=0.01)
    if path.exists():
        kept = torch.load(path, weights_only=True)
        network.load_state_dict(kept["network"])
        optimizer.load_state_dict(kept["optimizer"])
        done = kept["done"]
    network.train()
    begun, start = done, time.monotonic()
    while done < total:
        falls = (1 - done / total) / (1 - level)
        share = min(1.0, (done + 1) / WARM) * (0.02 + 0.98 * min(1.0, falls))
        optimizer.param_groups[0]["lr"] = rate * share
        parts = losses(np.random.default_rng([options.seed, done]), done < QUICK * total)
        optimizer.zero_grad(set_to_none=True)
        sum(parts.values(), torch.zeros(())).backward()
        nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        optimizer.step()
        done += 1
        for part, value in parts.items():
            shown[part] = 0.98 * shown.get(part, value.item()) + 0.02 * value.item()
        if done % EVERY == 0 or done == total:
            states = {"network": network.state_dict(), "optimizer": optimizer.state_dict()}
            stream = io.BytesIO()
            torch.save({**states, "done": done}, stream)
            replace_file(path, stream.getvalue())
            left = (time.monotonic() - start) / (done - begun) * (total - done)
            told = ", ".join(f"{part} {value:.3f}" for part, value in shown.items())
            say(f"{name} {done:,}/{total:,}: {told}; {left / 60:.0f} min left")
    perceive.save_weights(network, out / f"{name}.npz")


HARD = (
    *("Separate_Fries_Bread", "Move_Blocks_Apart", "Rank_Blocks_Color", "Press_Stapler_Memory"),
    *("Remember_Color_Cover", "Click_Bell_Open_Microwave_Place_Object"),
)
OFTEN = {"SDE": 4.0, "basic": 0.5, **dict.fromkeys(HARD, 8.0)}
"""How often states of a variant are drawn, 2 for all others: more often where each thing has a part
of its own in the sentence, or its own distance."""


class States:
    """The states of all lessons, drawn at random."""

    def __init__(self, lessons: Sequence[Lesson], vocabulary: Vocabulary) -> None:
        self._lessons, self._vocabulary = lessons, vocabulary
        count = np.bincount([item.variant for item in lessons], minlength=len(scenes.variants()))
        asked = [(n, tasks()[n].dimension, tasks()[n].category) for n, _ in scenes.variants()]
        often = [next((OFTEN[key] for key in keys if key in OFTEN), 2.0) for keys in asked]
        weight = np.array([often[o.variant] / count[o.variant] for o in lessons])
        self._reached = np.cumsum(weight / weight.sum())

    def draw(self, rng: np.random.Generator, count: int) -> tuple[Batch, Tensor, Tensor]:
        """`count` states, seen and told a little wrongly, an answer (B, 6) of each, and which
        objects would be as right (B, N)."""
        chosen = [self._lessons[i] for i in np.searchsorted(self._reached[:-1], rng.random(count))]
        pairs = [(item, int(rng.integers(len(item.tokens)))) for item in chosen]
        said = [paraphrased(rng, o.told[rng.integers(len(o.told))]) for o in chosen]
        told = [self._vocabulary.numbers(sentence) for sentence in said]
        known, meant = misheard(rng, np.stack(told), self._vocabulary)
        last = np.stack([item.last[i] for item, i in pairs]).astype(np.int64)
        seen = [misseen(rng, item.tokens[i]) for item, i in pairs]
        batch = point.batch_of(seen, known, self._vocabulary.table[meant], last)
        every = [item.answers[i] for item, i in pairs]
        answers = [o[rng.integers(len(o)) if rng.random() < 0.5 else 0] for o in every]
        right = np.zeros(batch.real.shape, np.bool_)
        for row, others in zip(right, every, strict=True):
            row[others[:, 1].astype(int)] = others[0, 1] != NOTHING
        return batch, torch.from_numpy(np.stack(answers)), torch.from_numpy(right)


@cache
def paraphrases() -> dict[tuple[str, ...], list[str]]:
    """Other ways to say runs of words of training sentences, written by readers of these alone."""
    rows = [row.split(" = ") for row in PARAPHRASES.read_text().splitlines()]
    return {tuple(point.words_of(said)): others.split(" | ") for said, others in rows}


def paraphrased(rng: np.random.Generator, sentence: str) -> str:
    """The words of a sentence, a share of its phrases said in another way."""
    left, made = point.words_of(sentence), list[str]()
    share = rng.choice(SAID_ANEW)
    while left:
        sizes = range(min(len(left), LONGEST_PHRASE), 0, -1)
        known = (size for size in sizes if tuple(left[:size]) in paraphrases())
        size = next((n for n in known if rng.random() < share), 0)
        others = paraphrases()[tuple(left[:size])] if size else left[:1]
        made.append(others[rng.integers(len(others))])
        left = left[max(size, 1) :]
    return " ".join(made)


def misheard(
    rng: np.random.Generator, words: NDArray[np.int64], vocabulary: Vocabulary
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sentences (B, L) as others may say them: numbers of words, and rows of the vocabulary's table
    with their meanings. Words are unknown, replaced by others of near meaning, left out or put in.
    """

    def some(shares: Sequence[float]) -> NDArray[np.bool_]:
        share = rng.choice(shares, size=(len(words), 1))
        return (words >= point.FIRST_WORD) & (rng.random(words.shape) < share)

    like = vocabulary.synonyms[words, rng.integers(point.SYNONYMS, size=words.shape)]
    meant = np.where(some([0.0, 0.0, 0.2]), like, words)
    known = np.where((meant != words) | some([0.0, 0.1, 0.4, 1.0]), point.UNKNOWN, words)
    meant = np.where(some([0.0, 0.0, 0.0, 0.1]), point.UNKNOWN, meant)
    left_out, put_in = some([0.0, 0.0, 0.0, 0.15]), some([0.0, 0.0, 0.1, 0.2])
    others = rng.integers(point.FIRST_WORD, len(vocabulary.table), words.shape)
    for row in np.flatnonzero((left_out | put_in).any(axis=1)):
        kept = np.stack([~left_out[row], put_in[row]], axis=1)
        for every, other in ((known, np.full_like(others, point.UNKNOWN)), (meant, others)):
            made = np.stack([every[row], other[row]], axis=1)[kept][: point.LONGEST]
            every[row] = np.pad(made, (0, point.LONGEST - len(made)))
    return known, meant


WRONG = np.array([0, 0.003, 0.003, 0.002, 0.0012, 0.0012, 0.0012, 0.05, 0.02, 0.02, 0.02, 0.02])
"""How wrong the numbers of a `Seen` are at most, one standard deviation."""


def misseen(rng: np.random.Generator, tokens: NDArray[np.float32]) -> NDArray[np.float32]:
    """Objects (N, TOKEN_WIDTH) as somebody sees them who may err."""
    made, strength = tokens.copy(), rng.random()
    errors = rng.normal(size=(2, len(tokens), SEEN_WIDTH)) * WRONG * strength
    if rng.random() < 0.5:
        errors[1] = errors[0]
    for i, error in enumerate(errors):
        rows = made[:, i * SEEN_WIDTH : (i + 1) * SEEN_WIDTH]
        there = rows[:, 4] > 0
        rows += np.where(there[:, None], error, 0).astype(np.float32)
        rows[:, 4:7] = np.where(there[:, None], rows[:, 4:7].clip(0.002), 0)
        quarter = rng.integers(4, size=len(rows)) * (there & (rows[:, 0] == perceive.BLOCK))
        rows[:, 7] += quarter * (np.pi / 2)
        odd = quarter % 2 == 1
        rows[odd, 4:6] = rows[odd, 5:3:-1]
    return made


def point_losses(network: PointNetwork, batch: Batch, answers: Tensor, right: Tensor) -> Losses:
    """Of the type, the object, the destination, the place, and the reference where there is one."""
    kind, chosen, goal, refers = (answers[:, i].long() for i in (0, 1, 2, 5))
    told = network(batch)
    losses = {"type": F.cross_entropy(told.type, kind)}
    acts = chosen != NOTHING
    likely = told.object.log_softmax(dim=1)
    any_right = likely.masked_fill(~right, point.LOW).logsumexp(dim=1) * acts
    losses["object"] = -0.7 * any_right.mean() + 0.3 * _cross(told.object, chosen, acts)
    liked = network.goal_of(told, batch, kind, chosen.clamp(min=0))
    nowhere = torch.where(goal == NOTHING, liked.shape[1] - 1, goal)
    losses["goal"] = _cross(liked, nowhere, acts)
    placed = ~answers[:, 3].isnan()
    heat = network.heat_of(told, batch, chosen.clamp(min=0))[placed].log_softmax(dim=1)
    away = torch.from_numpy(point.cell_places())[None] - answers[placed, None, 3:5]
    near = (-away.square().sum(dim=2) / (2 * 0.012**2)).softmax(dim=1)
    losses["place"] = -(heat * near).sum() / len(placed)
    hops = [_cross(told.hops[:, i], refers, refers != NOTHING) for i in range(told.hops.shape[1])]
    losses["reference"] = 0.3 * sum(hops, torch.zeros(()))
    return losses


def _cross(liked: Tensor, right: Tensor, counts: Tensor) -> Tensor:
    return (F.cross_entropy(liked, right.clamp(min=0), reduction="none") * counts).mean()


PARTS = ("pictures 0", "pictures 1"), ("measure", "find", "point")
"""What is made by two workers, one after the other; then what is learned from it."""


def _worker(argument: tuple[Path, TrainOptions]) -> Callable[[str], None]:
    """What does a part of the recipe, on one core."""
    out, options = argument
    torch.set_num_threads(1)

    def work(part: str) -> None:
        name, _, half = part.partition(" ")
        if name == "pictures":
            scenes.make(out / "made", range(int(half), options.pictures, 2), say)
        elif name == "point":
            _point(out, options)
        else:
            _perceive(out, name, options)

    return work


def _point(out: Path, options: TrainOptions) -> None:
    blocks = (scenes.scenes(n) for n in range(options.blocks))
    lessons = [lesson(scene) for block in blocks for scene in block]
    told = (sentence for item in lessons for sentence in item.told)
    vocabulary = Vocabulary(point.vocabulary_of(chain(told, *paraphrases().values()), 2))
    states = States(lessons, vocabulary)
    torch.manual_seed(options.seed)
    network = PointNetwork(point.FIRST_WORD + len(vocabulary.words))

    def losses(rng: np.random.Generator, quick: bool) -> Losses:
        return point_losses(network, *states.draw(rng, BATCH))

    fit(out, "point", network, options, losses)
    replace_file(out / "words.json", json.dumps(vocabulary.words).encode())


def _perceive(out: Path, name: str, options: TrainOptions) -> None:
    shown = scenes.read(scenes.make(out / "made", range(options.pictures), say))
    torch.manual_seed(options.seed)
    network = FindNetwork() if name == "find" else MeasureNetwork()
    network.to(memory_format=torch.channels_last)

    def losses(rng: np.random.Generator, quick: bool) -> Losses:
        chosen = [shown[i] for i in rng.integers(len(shown), size=PICTURES)]
        images, seen = [o.image for o in chosen], [o.seen for o in chosen]
        if isinstance(network, FindNetwork):
            return perceive.find_losses(network, images, seen, quick)
        return perceive.measure_losses(network, rng, images, seen, quick)

    fit(out, name, network, options, losses)


def train(out: Path, options: TrainOptions | None = None) -> None:
    """The whole recipe, on two cores, into the folder `out`; what is there already is not made
    again. The weights that `perceive` and `point` read, and their card, are left there.
    """
    options = options or TrainOptions()
    begun = time.monotonic()
    start = partial(JobProcess, _worker, (out, options), name="learner", nice=5)
    with Pool[str, None](start, 2) as pool:
        for parts in PARTS:
            for done in [pool.submit(part) for part in parts]:
                done.result()
    files = [out / name for name in ("find.npz", "measure.npz", "point.npz", "words.json")]
    card = {
        "name": "learned",
        "suite": SUITE,
        "learned_from": "drawn scenes and their plans: training seeds, seen textures, sentences of "
        "the split train and paraphrases of them",
        "labels": "poses, sizes and kinds of the scenes' objects; steps of the expert's plans",
        "options": asdict(options),
        "pieces": "pieces.npz is cut from the weights of wordllama (MIT, see LICENSE-wordllama)",
        "sha256": {path.name: file_hash(path) for path in (*files, point.PIECES)},
    }
    replace_file(out / "card.json", (json.dumps(card, indent=1) + "\n").encode())
    say(f"done in {(time.monotonic() - begun) / 60:.0f} min: {out}")
