"""The words of a task: templates and phrasings, written in a TOML file beside its module.

    [[templates]]                       # of some levels; see `compose` for shorter ways to write 50
    levels = [1, 2]
    train = ["pick up {block}.", ...]   # 50 sentences with slots in braces
    heldout = ["hoist {block} clear of {table}.", ...]                 # 10 other orders
    indirect = ["could {block} be raised off {table}?", ...]           # 10 that are no orders

    [phrasings.block]                   # what may fill the slot {block}
    train = ["the {color} block", "the {color} cube"]
    heldout = ["the block colored {color}", ...]

A phrasing may have values of the scene in braces ({color}); the task's `slots` gives them. What
several phrasings of one slot have to be chosen from has names of two parts, such as
`[phrasings.blocks.two]`. What a group of templates leaves out is taken from the top of the file.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from robospa.tasks.instructions.compose import composed
from robospa.tasks.instructions.grammar import Phrasings, Slots, Templates
from robospa.text import listed

SHARED = Path(__file__).with_name("shared.toml")
"""Clauses and phrasings that many tasks use."""


@dataclass(frozen=True)
class TaskText:
    """A file of templates and phrasings, read when something of it is first asked for."""

    path: Path

    @staticmethod
    def beside(module: str, name: str) -> TaskText:
        """The file called `name` in the folder of a module, given as its `__file__`."""
        return TaskText(Path(module).with_name(name))

    def templates(self, level: int, name: str = "") -> Templates:
        """The templates of a level; of several sets in the file those called `name`.

        KeyError if the file has none.
        """
        return _templates(self.path, level, name)

    def phrasings(self, entry: str, **values: object) -> Phrasings:
        """The phrasings called `entry` ("block", "blocks.two"), with the values filled in.

        KeyError for an unknown entry or a missing value.
        """
        return _phrasings(self.path, entry, tuple(values.items()))

    def slots(self, *entries: str, **values: object) -> Slots:
        """The phrasings of several entries by slot, and those that every task may use.

        The slot of an entry is the first part of its name: "blocks.two" fills {blocks}.
        """
        own = {entry.split(".")[0]: self.phrasings(entry, **values) for entry in entries}
        return {**COMMON.shared("arm", "table"), **own}

    def shared(self, *entries: str, **values: object) -> Slots:
        """The phrasings of several entries by slot, without further ones."""
        return {entry.split(".")[0]: self.phrasings(entry, **values) for entry in entries}


COMMON = TaskText(SHARED)
"""Phrasings of slots that any task may use."""


@cache
def _read(path: Path) -> Mapping[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def _templates(path: Path, level: int, name: str) -> Templates:
    data = _read(path)
    for group in data.get("templates", ()):
        if level in group["levels"] and group.get("name", "") == name:
            own = {**data, **group}
            shared = _read(SHARED)["groups"][own["shared"]] if "shared" in own else {}
            return composed({**shared, **own})
    raise KeyError(f"{path} has no templates {name!r} for level {level}")


@lru_cache(maxsize=4096)
def _phrasings(path: Path, entry: str, values: tuple[tuple[str, object], ...]) -> Phrasings:
    found: Any = _read(path)["phrasings"]
    for part in entry.split("."):
        if part not in found:
            raise KeyError(f"{path} has no phrasings {entry!r}; {part!r} is none of {list(found)}")
        found = found[part]
    train, heldout = (
        tuple(text.format_map(dict(values)) for text in found[split])
        for split in ("train", "heldout")
    )
    return train, heldout


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
