"""The accepted seeds that are shipped: scenes that settle and that the expert solves.

There is a folder for each robot and, in it, one for each scene mode, with a file for each task
(`ListKey.file`), in which each level has its seeds as a range and what it leaves out (`shown`).
`robospa seeds` makes lists of what is not shipped, which `robospa.harness.seeds.lists` finds. A run
on shipped lists needs no expert.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from robospa.tasks.catalog import task
from robospa.tasks.modes import tangible
from robospa.trial import REFERENCE, path_part

FIRST_SEED = 100_000
"""Where the official evaluation starts (infrastructure facts, section 8)."""
PER_VARIANT = 100
FIRST_TRAINING_SEED, LAST_TRAINING_SEED = 1_000_000, 1_999_999
"""Demonstrations to learn from are of these seeds alone. No list of an evaluation has one of them,
nor any hidden seed, nor what measures the expert."""


class ListKey(NamedTuple):
    """What a list of accepted seeds is for."""

    task: str
    level: int
    embodiment: str = REFERENCE
    mode: str = "clean"

    def __str__(self) -> str:
        robot = "" if self.embodiment == REFERENCE else f" with {self.embodiment}"
        scenes = "" if self.mode == "clean" else f" in {self.mode} scenes"
        return f"{self.task} level {self.level}{robot}{scenes}"

    @property
    def command(self) -> str:
        """The command that makes the list."""
        robot = "" if self.embodiment == REFERENCE else f" --embodiment {self.embodiment}"
        mode = "" if self.mode == "clean" else f" --mode {self.mode}"
        return f"robospa seeds {self.task} --levels {self.level}{robot}{mode}"

    @property
    def file(self) -> str:
        """Where the list is, below a folder of lists: one file holds all levels of a task."""
        return f"{path_part(self.embodiment)}/{path_part(self.mode)}/{self.task}.json"


class NoSeedList(LookupError):
    """There is no list of accepted seeds; the message names the command that makes it."""

    def __init__(self, key: ListKey) -> None:
        super().__init__(
            f"no list of accepted seeds of {key} is shipped; make it with `{key.command}`"
        )


@cache
def _lists(file: str) -> dict[int, tuple[int, ...]]:
    path = files("robospa.tasks.seeds").joinpath(file)
    if not path.is_file():
        return {}
    return read_lists(path.read_text())


def read_lists(text: str) -> dict[int, tuple[int, ...]]:
    """The seeds of each level in the text of a file; ValueError if it is not one."""
    data = json.loads(text)
    return {int(level): _seeds(row) for level, row in data.items() if level.isdecimal()}


def shown(seeds: Sequence[int]) -> str:
    """Ascending seeds as a range and what it leaves out: "100000-100100 but 100007 100031"."""
    out = sorted(set(range(seeds[0], seeds[-1] + 1)).difference(seeds))
    return f"{seeds[0]}-{seeds[-1]}" + " but ".join(["", " ".join(map(str, out))] if out else [])


def _seeds(text: str) -> tuple[int, ...]:
    span, _, out = text.partition(" but ")
    first, last = map(int, span.split("-"))
    left_out = set(map(int, out.split()))
    return tuple(seed for seed in range(first, last + 1) if seed not in left_out)


def accepted(
    name: str, level: int, embodiment: str = REFERENCE, mode: str = "clean"
) -> tuple[int, ...]:
    """Accepted seeds of a variant with a robot in a scene mode, ascending.

    Modes that differ in looks alone share their lists (`robospa.tasks.modes.tangible`). Raises
    NoSeedList, a LookupError, if none are shipped.
    """
    key = ListKey(task(name).name, level, embodiment, tangible(mode))
    seeds = _lists(key.file).get(level)
    if not seeds:
        raise NoSeedList(key)
    return seeds


def list_hash(lists: Mapping[ListKey, Sequence[int]]) -> str:
    """16 hexadecimal digits that are equal for equal lists, in whatever order they come."""
    rows = [[*key, list(lists[key])] for key in sorted(lists)]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:16]
