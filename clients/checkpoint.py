"""A name for a checkpoint that changes when its weights do, for `PolicySpec.checkpoint`.

Weights are gigabytes, and a server should start at once. So a folder is known by the names and
sizes of its files and by samples of their contents: training changes nearly every byte, so another
step is always another name. It guards against mistakes, not against somebody who forges one.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from robospa.protocol.errors import printable

SAMPLES, BLOCK = 16, 2**16
"""Blocks that are read of a file, spread evenly, and bytes of each."""
FILES = 10_000
"""Of a larger folder only the first files by name count."""


def describe_checkpoint(path: str) -> str:
    """The last name of `path` and a hash of what lies there: `29999 sample:6b1f...`.

    A hub's name (`org/model`) is looked up in the cache of this machine, where its loader has put
    it, and gets its revision. What is found in neither place is named as it was given.
    """
    found = Path(path).expanduser()
    if os.path.exists(found):
        return f"{printable(found.resolve().name, 170)} sample:{sample_hash(found)}"
    revision = _cached_revision(path)
    return printable(f"{path}@{revision}" if revision else path, 200)


def sample_hash(path: Path) -> str:
    """16 hexadecimal digits of a file or folder: names, sizes and samples of the contents."""
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())[:FILES]
    made = hashlib.sha256()
    for file in files:
        size = file.stat().st_size
        name = "" if file == path else file.relative_to(path).as_posix()
        made.update(f"{name}\0{size}\0".encode(errors="surrogateescape"))
        with file.open("rb") as opened:
            if size <= SAMPLES * BLOCK:
                made.update(opened.read())
                continue
            for number in range(SAMPLES):
                opened.seek((size - BLOCK) * number // (SAMPLES - 1))
                made.update(opened.read(BLOCK))
    return made.hexdigest()[:16]


def _cached_revision(name: str) -> str:
    """The revision of a hub's model that lies in the cache of this machine; empty if none does."""
    try:
        from huggingface_hub import try_to_load_from_cache

        found = try_to_load_from_cache(name, "config.json")
    except (ImportError, ValueError, OSError):  # no such library, or no name of a hub
        return ""
    return Path(found).parent.name if isinstance(found, str) else ""
