"""Phrasings that the pick tasks share. Each pair is (train phrasings, held-out phrasings)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]
Slots = Mapping[str, Phrasings]

WORDS = (
    "zeroth", "first", "second", "third", "fourth", "fifth", "sixth",
    "seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth",
)  # fmt: skip

NOUN_CUBE: Phrasings = (("block", "cube"), ("cubic block", "coloured cube", "solid cube"))
NOUN_OBJECT: Phrasings = (("object", "item"), ("thing", "article"))


def numeral(k: int) -> str:
    """1 -> "1st", 2 -> "2nd", ... 12 -> "12th"."""
    return f"{k}{ {1: 'st', 2: 'nd', 3: 'rd'}.get(k, 'th') }"


def ordinals(k: int, train: Sequence[str], held_out: Sequence[str]) -> Phrasings:
    """Rank `k` with each superlative: "2nd largest", "second largest"; rank 1 also "largest"."""

    def phrasings(superlatives: Sequence[str]) -> tuple[str, ...]:
        numbers = (numeral(k), WORDS[k])
        ranked = tuple(f"{n} {s}" for s in superlatives for n in numbers)
        return (*superlatives, *ranked[::2]) if k == 1 else ranked

    return phrasings(train), phrasings(held_out)
