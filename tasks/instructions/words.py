"""Small pieces of English that are computed: numbers, lists, and what follows from a count."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.tasks.instructions.grammar import Phrasings, Slots
from robospa.tasks.instructions.text import COMMON
from robospa.text import listed

NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_ORDINALS = (
    *("first", "second", "third", "fourth", "fifth", "sixth"),
    *("seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth"),
)


def by_count(count: int) -> str:
    """Which of the entries "one", "two" and "many" of a slot's phrasings is for `count`."""
    return {1: "one", 2: "two"}.get(count, "many")


def ordinal(rank: int) -> tuple[str, str]:
    """The two spellings of an ordinal from 1 to 12: ("3rd", "third")."""
    if not 1 <= rank <= len(_ORDINALS):
        raise ValueError(f"no ordinal for {rank}; instructions count from 1 to {len(_ORDINALS)}")
    suffix = {1: "st", 2: "nd", 3: "rd"}.get(rank, "th")
    return f"{rank}{suffix}", _ORDINALS[rank - 1]


def times(count: int) -> Phrasings:
    """How often, as an adverb, for 1 to 3 times."""
    return COMMON.phrasings(f"times.{('once', 'twice', 'thrice')[count - 1]}")


def acting_arm(side: str) -> Slots:
    """{arm} where the rule wants the gripper on one `side` ("left" or "right") to be closed."""
    return {"arm": COMMON.phrasings("acting_arm", side=side)}


def color_orders(colors: Sequence[str]) -> Phrasings:
    """Phrasings for the order of two or more colours, from the first to the last."""
    steps = (", then " if len(colors) > 2 else " and then ").join(colors)
    places = (*("first", "second", "third", "fourth")[: len(colors) - 1], "last")
    placed = ", ".join(f"{c} {p}" for c, p in zip(colors, places, strict=True))
    return (
        (listed(colors, ", then "), steps),
        (placed, " followed by ".join(colors), " before ".join(colors)),
    )


_TRAIN_LINKS = (", then ", ", and then ")
_HELDOUT_LINKS = (" followed by ", ", next ", ", after that ")


def one_after_another(nouns: Sequence[Phrasings]) -> Phrasings:
    """Phrasings for things in their order; each noun has two train and four held-out phrasings."""
    train = tuple(
        link.join(noun[0][k] for noun in nouns) for k in range(2) for link in _TRAIN_LINKS
    )
    held = tuple(
        link.join(noun[1][k] for noun in nouns) for k in range(4) for link in _HELDOUT_LINKS
    )
    return train, held
