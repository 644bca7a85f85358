"""Where lists of accepted seeds are: shipped with the package, or made by this user.

A list that a user makes lies in her cache folder under the hash of what it depends on: another
version of a task, robot or suite does not find it. It is as good as a shipped one for her own
runs, whose manifest says that it was made there. A ranking knows the shipped lists alone.
"""

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from robospa.extras import user_cache
from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.code_hash import FOLDERS, LENGTH, code_hash
from robospa.harness.running.manifest import this_processor
from robospa.registry import ROBOTS, SCENE_MODES, module_of
from robospa.tasks.catalog import home_of
from robospa.tasks.modes import tangible
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey, NoSeedList, accepted, read_lists, shown

SHIPPED, LOCAL = "shipped", "local"


@dataclass(frozen=True)
class SeedList:
    """Accepted seeds, ascending, and whether they were `shipped` or made here (`local`)."""

    seeds: tuple[int, ...]
    origin: str


def local_folder() -> Path:
    """The folder of this user's lists and of the attempts behind them."""
    return user_cache() / "seeds" / SUITE


def local_file(key: ListKey) -> Path:
    """The file of a list that a user makes, named after what it depends on."""
    path = local_folder() / key.file
    return path.with_name(f"{path.stem}-{inputs(key)}.json")


def find_list(key: ListKey) -> SeedList:
    """The list for `key`; raises NoSeedList, which names the command that makes it.

    Modes that differ in looks alone share their lists.
    """
    key = key._replace(mode=tangible(key.mode))
    try:
        return SeedList(accepted(*key), SHIPPED)
    except NoSeedList:
        found = read_levels(local_file(key)).get(key.level)
        if not found:
            raise
        return SeedList(found, LOCAL)


def read_levels(path: Path) -> dict[int, tuple[int, ...]]:
    """The lists in a file, by level; empty if there is none that can be read."""
    try:
        return read_lists(path.read_text())
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def save(path: Path, level: int, seeds: Sequence[int]) -> None:
    """Put a list into the file of its task, at once or not at all; none takes the old one out. The
    file begins with the kind of processor that made what is in it last."""
    lists = {**read_levels(path), level: list(seeds)}
    made: dict[object, object] = {"processor": str(this_processor())}
    made |= {level: shown(lists[level]) for level in sorted(lists) if lists[level]}
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, (json.dumps(made, indent=0) + "\n").encode())


FAMILIES = "robospa.tasks.families."
NOT_EXECUTED = (
    "tasks/seeds/",
    "tasks/families/",
    "tasks/instructions/",
    "tasks/sentences.py",
    "protocol/",
    "clients/",
    "harness/clock/",
)


def inputs(key: ListKey) -> str:
    """16 hexadecimal digits that are equal while every attempt at `key` ends alike: those of the
    suite, the simulator, and the code and data that the expert's trials of one task execute. Other
    tasks do not count, nor robots and modes of other packages that `key` does not name.
    """
    robots = key.embodiment.partition(":")[0].split("+")
    mode = key.mode.partition(":")[0]
    modules = [home_of(key.task), *(module_of(ROBOTS, r) for r in robots)]
    return _hash(*modules, module_of(SCENE_MODES, mode))


@cache
def _hash(task: str, *modules: str) -> str:
    hashes = [code_hash(FOLDERS, NOT_EXECUTED), code_hash(("baselines/oracle.py",))]
    if task.startswith(FAMILIES):
        hashes.append(code_hash(tuple(sorted(_family(task)))))
    digest = hashlib.sha256(f"{SUITE} {metadata.version('sapien')} {hashes}".encode())
    for name in (task, *modules):
        if not name.startswith("robospa.") and (spec := find_spec(name or " ")) and spec.origin:
            digest.update(name.encode() + Path(spec.origin).read_bytes())
    return digest.hexdigest()[:LENGTH]


def _family(module: str) -> set[str]:
    """The files of a family's module and of those that it builds on."""
    spec = find_spec(module)
    assert spec is not None and spec.origin is not None
    source = Path(spec.origin).read_text()
    found = {module.removeprefix("robospa.").replace(".", "/") + ".py"}
    for name in set(re.findall(rf"from {FAMILIES[:-1]}(?:\.| import )(\w+)", source)):
        found |= _family(FAMILIES + name)
    return found
