"""One short hash of the code and data that can change what a trial does.

A run may only go on with the code that it was started with, and a cluster's nodes must have the
driver's. What counts are the files of the folders that a trial executes. The policy does not, which
a run identifies by its spec, nor do the lists of seeds, which a run's own list of trials replaces.
"""

import hashlib
import os
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path

FOLDERS = (
    "robospa/",
    "tasks/",
    "protocol/",
    "clients/",
    "harness/*",
    "harness/clock/",
    "harness/robots/",
    "harness/sim/",
    "harness/skills/",
    "harness/textures/",
)
"""What a trial executes: whole folders, or with a star their own files alone; single files too.
`robospa/` stands for the files that lie beside the folders."""
LEFT_OUT = ("tasks/seeds/",)
NO_CODE = (".pyc", ".pyi", ".typed", ".md")
LENGTH = 16
"""Hexadecimal digits of a hash."""


@cache
def code_hash(folders: Sequence[str] = FOLDERS, left_out: tuple[str, ...] = LEFT_OUT) -> str:
    """The hash of the files of `folders` in the installed package, but for those `left_out`."""
    root = Path(import_module("robospa").__path__[0])
    digest = hashlib.sha256()
    for name in files_of(root, folders, left_out):
        data = (root / name).read_bytes()
        digest.update(f"{name} {len(data)}\0".encode() + data)
    return digest.hexdigest()[:LENGTH]


def files_of(root: Path, folders: Sequence[str], left_out: tuple[str, ...] = ()) -> list[str]:
    """The files of `folders` below `root` that count; FileNotFoundError for a folder without."""
    counted: list[str] = []
    for folder in folders:
        found = sorted(_files(root, folder))
        if not found:
            raise FileNotFoundError(f"{root} has no files in {folder}")
        counted += [n for n in found if not n.startswith(left_out) and not n.endswith(NO_CODE)]
    return counted


def _files(root: Path, folder: str) -> Iterator[str]:
    whole = folder.endswith("/") and folder != "robospa/"
    start = root if folder == "robospa/" else root / folder.rstrip("*")
    if start.is_file():
        yield folder
    for place, folders, names in os.walk(start):
        folders[:] = [n for n in folders if whole and not n.startswith((".", "__"))]
        for name in names:
            if not name.startswith(".") and name[-1] != "~":
                yield Path(place, name).relative_to(root).as_posix()
