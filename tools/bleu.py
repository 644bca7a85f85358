"""Self-BLEU: how alike a list of sentences is, from 0 (nothing shared) to 1 (all the same).

The mean BLEU-4 of every sentence against all the others as references (Papineni et al. 2002; used
as a measure of diversity since Zhu et al. 2018): clipped n-gram precisions for n = 1 to 4, their
geometric mean, brevity penalty from the nearest reference length. Precisions of n > 1 are smoothed
by adding one to both counts (Lin and Och 2004), so that a short sentence without a common 4-gram
is not worth 0. Sentences of fewer than 4 words use the n-grams that they have.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

Words = Sequence[str]
Gram = tuple[str, ...]
ORDER = 4


def grams(words: Words, n: int) -> Counter[Gram]:
    """The n-grams of a sentence, counted."""
    return Counter(tuple(words[i : i + n]) for i in range(len(words) - n + 1))


def bleu(words: Words, references: Sequence[Words]) -> float:
    """Smoothed BLEU-4 of one sentence against `references`; ValueError if there is none."""
    if not references:
        raise ValueError("BLEU needs at least one reference; give other sentences")
    hits = []
    for n in range(1, ORDER + 1):
        best: Counter[Gram] = Counter()
        for other in references:
            best |= grams(other, n)
        hits.append((grams(words, n) & best).total())
    return _score(words, hits, [len(r) for r in references])


def self_bleu(sentences: Sequence[Words]) -> float:
    """Mean BLEU-4 of each sentence against all others; ValueError for fewer than two."""
    if len(sentences) < 2:
        raise ValueError(f"self-BLEU compares sentences; got {len(sentences)} of them")
    hits = [[0] * ORDER for _ in sentences]
    for n in range(1, ORDER + 1):
        counted = [grams(words, n) for words in sentences]
        leads = _two_highest(counted)
        for i, own in enumerate(counted):
            for gram, count in own.items():
                first, second, owner = leads[gram]
                hits[i][n - 1] += min(count, second if owner == i else first)
    lengths = [len(words) for words in sentences]
    scores = [
        _score(words, hits[i], lengths[:i] + lengths[i + 1 :]) for i, words in enumerate(sentences)
    ]
    return math.fsum(scores) / len(scores)


def _two_highest(counted: Sequence[Counter[Gram]]) -> dict[Gram, tuple[int, int, int]]:
    """For every n-gram its two highest counts, and in which sentence the highest is."""
    leads: dict[Gram, tuple[int, int, int]] = {}
    for i, own in enumerate(counted):
        for gram, count in own.items():
            first, second, owner = leads.get(gram, (0, 0, -1))
            if count > first:
                leads[gram] = (count, first, i)
            elif count > second:
                leads[gram] = (first, count, owner)
    return leads


def _score(words: Words, hits: Sequence[int], lengths: Sequence[int]) -> float:
    """BLEU from the clipped matches of each order and the references' lengths."""
    if not hits[0]:
        return 0.0
    logs = []
    for n, found in enumerate(hits[: len(words)], 1):
        total, extra = len(words) - n + 1, int(n > 1)
        logs.append(math.log((found + extra) / (total + extra)))
    nearest = min((abs(length - len(words)), length) for length in lengths)[1]
    penalty = min(1.0, math.exp(1 - nearest / len(words)))
    return penalty * math.exp(math.fsum(logs) / len(logs))
