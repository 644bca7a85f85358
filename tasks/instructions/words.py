"""Small pieces of English that several tasks' slots are made of.

A slot maps to two tuples of phrasings: those for training sentences and those for held-out ones.
Every phrasing of a slot fits every template that uses the slot; templates never put "a" or "an"
in front of a slot, so no article can go wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]
"""Train phrasings and held-out phrasings."""

Slots = dict[str, Phrasings]
"""{slot: (train phrasings, held-out phrasings)}"""

NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_ORDINALS = (
    *("first", "second", "third", "fourth", "fifth", "sixth"),
    *("seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth"),
)

COMMON: Slots = {
    "arm": (
        ("one arm", "a single arm", "either arm"),
        ("just one arm", "any one arm", "one of the arms"),
    ),
    "table": (
        ("the table", "the tabletop"),
        ("the work surface", "the table surface", "this table"),
    ),
}
"""Slots that any task may use: they change the wording and carry no information."""


def acting_arm(side: str) -> Slots:
    """{arm} where the rule wants the gripper on one `side` ("left" or "right") to be closed."""
    return {
        "arm": (
            (f"the {side} arm", f"your {side} arm", f"the robot's {side} arm"),
            (f"the arm on the {side}", f"the {side}-hand arm", f"the {side} one of the two arms"),
        )
    }


def ordinal(rank: int) -> tuple[str, str]:
    """The two spellings of an ordinal from 1 to 12: ("3rd", "third")."""
    if not 1 <= rank <= len(_ORDINALS):
        raise ValueError(f"no ordinal for {rank}; instructions count from 1 to {len(_ORDINALS)}")
    suffix = {1: "st", 2: "nd", 3: "rd"}.get(rank, "th")
    return f"{rank}{suffix}", _ORDINALS[rank - 1]


def listed(items: Sequence[str], last: str = " and ") -> str:
    """ "a", "a and b", "a, b and c"."""
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + last + items[-1]


def with_common(slots: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> Slots:
    """`slots` and the common ones."""
    return {**COMMON, **slots}
