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

TRAIN, HELDOUT = 50, 10
"""Templates per variant and split (official counts)."""

_SLOT = re.compile(r"\{(\w+)\}")


class Templates(NamedTuple):
    """The templates of one variant: 50 for training, 10 held out."""

    train: tuple[str, ...]
    heldout: tuple[str, ...]


def templates_of(train: Iterable[str], heldout: Iterable[str]) -> Templates:
    """The two lists, checked: the official counts, every template distinct."""
    made = Templates(tuple(train), tuple(heldout))
    counts = (len(set(made.train)), len(set(made.heldout)))
    if counts != (TRAIN, HELDOUT) or set(made.train) & set(made.heldout):
        raise ValueError(f"{counts} distinct templates instead of {(TRAIN, HELDOUT)}")
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
