"""What a template is, how it is filled, and how alike two of them are.

A template is one or two English sentences with slots in braces: "Pick up {block}." Templates are
written in lower case where a slot or a clause may come first; `fill` raises the first letter of
every sentence. Nothing here knows a task.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher
from typing import NamedTuple

SENTENCES = 100
"""Sentences per scene and split (official count)."""

SPLITS = ("train", "heldout", "indirect")
"""Instruction splits: orders to train on, orders with other verbs and structures, and the same
asked for in other ways than by an order."""

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]
"""What may fill a slot: in training sentences, and in those of the two other splits.

Every phrasing of a slot fits every template that uses the slot; templates never put "a" or "an" in
front of a slot, so no article can go wrong.
"""

Slots = dict[str, Phrasings]
"""{slot: (train phrasings, held-out phrasings)}"""

_SLOT = re.compile(r"\{(\w+)\}")


class Templates(NamedTuple):
    """The templates of one variant by split: in the benchmark 50 for training and 10 held out
    (official counts), and 10 indirect ones."""

    train: tuple[str, ...]
    heldout: tuple[str, ...]
    indirect: tuple[str, ...]


def templates_of(
    train: Iterable[str], heldout: Iterable[str], indirect: Iterable[str]
) -> Templates:
    """The lists; ValueError if templates are repeated or cannot share 100 sentences evenly."""
    made = Templates(tuple(train), tuple(heldout), tuple(indirect))
    if len({text for split in made for text in split}) != sum(map(len, made)):
        raise ValueError("a template is there twice; those of all splits have to be different")
    for split in made:
        if not split or SENTENCES % len(split):
            raise ValueError(
                f"{len(split)} templates cannot share {SENTENCES} sentences evenly; give 50, 20, 10"
            )
    return made


def slot_names(template: str) -> tuple[str, ...]:
    """The slots of a template, each once, in order of appearance."""
    return tuple(dict.fromkeys(_SLOT.findall(template)))


def fill(template: str, values: Mapping[str, str]) -> str:
    """The template with its slots replaced and the first letter of every sentence raised.

    KeyError, naming the slot, if a value is missing.
    """
    missing = [name for name in slot_names(template) if name not in values]
    if missing:
        raise KeyError(f"no value for slot {missing[0]!r} of {template!r}; there is {list(values)}")
    return sentence_case(_SLOT.sub(lambda found: values[found.group(1)], template))


def sentence_case(text: str) -> str:
    """`text` with a capital at the start of every sentence (not after a colon)."""
    return re.sub(r"(^|[.?!] )([a-z])", lambda m: m.group(1) + m.group(2).upper(), text)


def masked_words(template: str) -> tuple[str, ...]:
    """Lower-case words of a template, every slot replaced by "_"."""
    return tuple(re.findall(r"[a-z0-9'_-]+", _SLOT.sub("_", template).lower()))


def similarity(one: str, other: str) -> float:
    """How alike two templates are, 0 to 1: the larger of two measures on their masked words.

    Jaccard overlap of the sets of words and the matching ratio of the sequences.
    """
    a, b = masked_words(one), masked_words(other)
    jaccard = len(set(a) & set(b)) / len(set(a) | set(b))
    return max(jaccard, SequenceMatcher(None, a, b, autojunk=False).ratio())
