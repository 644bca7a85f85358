"""How diverse the templates are: `python -m robospa.tasks.instructions.figures` prints the table.

Slots are masked. "mean" is the mean pairwise similarity of the train templates, "self-BLEU" their
BLEU-4 against each other, "held-out BLEU" that of the held-out templates against the train ones,
"nearest" the largest similarity across the splits; words are those of filled sentences, longest
over the scenes of ten seeds.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations

from robospa.tasks import catalog
from robospa.tasks.instructions import SPLITS, sentences, templates
from robospa.tasks.instructions.grammar import masked_words, similarity

Words = tuple[str, ...]


def bleu(words: Words, others: Sequence[Words], order: int = 4) -> float:
    """BLEU of one template against others: n-grams up to `order`, brevity penalty, unsmoothed."""
    logs = []
    for n in range(1, min(order, len(words)) + 1):
        have, best = grams(words, n), Counter[Words]()
        for other in others:
            best |= grams(other, n)
        hits = (have & best).total()
        if not hits:
            return 0.0
        logs.append(math.log(hits / have.total()))
    nearest = min((abs(len(o) - len(words)), len(o)) for o in others)[1]
    penalty = min(1.0, math.exp(1 - nearest / len(words)))
    return penalty * math.exp(sum(logs) / len(logs))


def grams(words: Words, n: int) -> Counter[Words]:
    """The n-grams of a template, counted."""
    return Counter(words[i : i + n] for i in range(len(words) - n + 1))


def row(name: str, level: int, seeds: int = 10) -> str:
    """One line of the table."""
    train, held = templates(name, level)
    pairs = list(combinations(train, 2))
    mean = sum(similarity(a, b) for a, b in pairs) / len(pairs)
    nearest = max(similarity(a, b) for a in train for b in held)
    own = [masked_words(t) for t in train]
    self_bleu = sum(bleu(w, own[:i] + own[i + 1 :]) for i, w in enumerate(own)) / len(own)
    held_bleu = sum(bleu(masked_words(t), own) for t in held) / len(held)
    scenes = [catalog.build_scene(name, level, 100000 + seed) for seed in range(seeds)]
    lengths = [len(t.split()) for s in scenes for p in SPLITS for t in sentences(s, p)]
    return (
        f"| {name} | {level} | {mean:.2f} | {self_bleu:.2f} | {held_bleu:.2f} | {nearest:.2f} "
        f"| {sum(lengths) / len(lengths):.0f} | {max(lengths)} |"
    )


def main() -> None:
    """Print the table as Markdown, levels 1 and 5 of every task."""
    print("| task | level | mean | self-BLEU | held-out BLEU | nearest | words | longest |")
    print("|---|---|---|---|---|---|---|---|")
    for name in catalog.MODULES:
        for level in (1, 5):
            print(row(name, level))


if __name__ == "__main__":
    main()
