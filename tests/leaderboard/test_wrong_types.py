"""Any value in any place of any of a bundle's JSON files is refused in a sentence, or harmless."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bundle_fakes import REFERENCE, put_rows, rows_of, seal, unzip, zip_up

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.verify import verify

VALUES: tuple[Any, ...] = (None, [], {}, [1], {"a": 1}, "x", -1, 1.5, True, 10**30, [[]], [None])
CASES = int(os.environ.get("WRONG_TYPES", "60"))


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place in a JSON value, of lists the first two."""
    yield path
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from places(inner, (*path, name))
    elif isinstance(value, list):
        for number, inner in enumerate(value[:2]):
            yield from places(inner, (*path, number))


def put(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    if not path:
        return new
    value[path[0]] = put(value[path[0]], path[1:], new)
    return value


def test_wrong_types_anywhere_are_refused_in_a_sentence(honest: Path, tmp_path: Path) -> None:
    files = unzip(honest)
    cases: list[tuple[str, tuple[Any, ...], Any]] = []
    for name in (layout.RUN, layout.CARD, layout.SCORES, layout.MANIFEST):
        cases += [(name, p, v) for p in places(json.loads(files[name])) for v in VALUES]
    cases += [(layout.RECORDS, p, v) for p in places(rows_of(files)[0]) for v in VALUES]
    for name, path, value in random.Random(7).sample(cases, min(CASES, len(cases))):
        changed = dict(files)
        try:
            if name == layout.RECORDS:
                rows = rows_of(files)
                rows[0] = put(rows[0], path, value)
                put_rows(changed, rows)
            else:
                changed[name] = layout.canonical(put(json.loads(files[name]), path, value))
            if name == layout.MANIFEST:
                manifest = json.loads(changed[name])
                manifest["bundle"] = layout.bundle_hash(manifest)
                changed[name] = layout.canonical(manifest)
            else:
                seal(changed)
        except (KeyError, TypeError, AttributeError):
            continue  # even the forger's tools cannot seal this
        bundle = zip_up(tmp_path / "b.zip", changed)
        try:
            verify(bundle, REFERENCE)
        except BundleError as error:
            assert "\n" not in str(error) and len(str(error)) < 500, (name, path, value)
        except Exception as error:
            raise AssertionError(f"{name} {path} = {value!r}: {error!r}") from error
