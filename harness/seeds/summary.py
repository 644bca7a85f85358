"""Attempts of the expert in figures: a row for each variant, robot and scene mode, kept as CSV."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from robospa.harness.running.atomic_file import replace_file
from robospa.harness.seeds.sweep import Search
from robospa.tasks.seeds import ListKey

REASONS = 3
"""Reasons that a row names."""
NUMBER = re.compile(r"-?\d+(\.\d+)?")


@dataclass(frozen=True)
class Row:
    """What came of the seeds of a variant that were tried in a row from `start` up.

    `seconds` is the mean processor time of a solved trial; `inputs` names what it was made with;
    `reasons` are those of refusals, most frequent first, with # for every number.
    """

    embodiment: str
    mode: str
    task: str
    level: int
    start: int
    tried: int
    accepted: int
    seconds: float
    inputs: str
    reasons: str

    @property
    def key(self) -> ListKey:
        return ListKey(self.task, self.level, self.embodiment, self.mode)


def row_of(search: Search, inputs: str) -> Row:
    """The row of a search that is done."""
    tried = search.row()
    solved = [item.seconds for item in tried if item.accepted]
    why = Counter(NUMBER.sub("#", item.reason) for item in search.refused)
    reasons = "; ".join(f"{n}x {text}" for text, n in why.most_common(REASONS))
    mean = round(sum(solved) / len(solved), 3) if solved else 0.0
    key = search.key
    return Row(
        key.embodiment, key.mode, key.task, key.level, search.start,
        len(tried), len(solved), mean, inputs, reasons,
    )  # fmt: skip


def read_rows(path: Path) -> dict[tuple[ListKey, int], Row]:
    """The rows of a table by list and first seed; empty if there is no such file."""
    if not path.exists():
        return {}
    found = {}
    for line in csv.DictReader(path.read_text().splitlines()):
        values = {f.name: _CASTS[str(f.type)](line[f.name]) for f in fields(Row)}
        row = Row(**values)
        found[row.key, row.start] = row
    return found


_CASTS = {"str": str, "int": int, "float": float}


def write_rows(path: Path, rows: Mapping[tuple[ListKey, int], Row]) -> None:
    """Write the table, sorted, at once or not at all."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [f.name for f in fields(Row)]
    writer.writerow(names)
    order = sorted(rows.values(), key=lambda r: (r.embodiment, r.mode, r.task, r.level, r.start))
    writer.writerows([getattr(row, name) for name in names] for row in order)
    replace_file(path, text.getvalue().encode())
