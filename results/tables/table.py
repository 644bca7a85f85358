"""A table as a value, and as Markdown and CSV.

A `Table` knows no metric and no model: labels, entries that are already text, marks and notes. What
comes from outside (names of models) is escaped by every writer.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

PRINTED_OTHERWISE = "*"
MISSING = "†"
FIELDS = ("table", "section", "row", "group", "column", "text", "value", "low", "high", "best")
LACKS = ("sign", "missing", "worst_case", "best_case")
"""Further columns: the mark, and what trials without a result leave open."""


@dataclass(frozen=True)
class TableCell:
    """One cell: its text, and for programs its value and interval in percent.

    `best` marks it; `sign` (* or †) points to the notes.
    """

    text: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    best: bool = False
    sign: str = ""
    missing: int = 0
    bounds: tuple[float, float] | None = None
    """Between which values [percent] the `missing` trials leave it, where that is known."""


@dataclass(frozen=True)
class TableRow:
    """One row. Of a `section` only the label is shown; an `average` is set apart."""

    label: str
    entries: tuple[TableCell, ...] = ()
    kind: str = "row"


@dataclass(frozen=True)
class Table:
    """A table: `heads` name its columns; `groups` (title, width) span them, or are empty."""

    name: str
    title: str
    corner: str
    heads: tuple[str, ...]
    lines: tuple[TableRow, ...]
    groups: tuple[tuple[str, int], ...] = ()
    notes: tuple[str, ...] = ()
    words: bool = False
    """Entries are words rather than numbers: set them flush left."""

    def __post_init__(self) -> None:
        if self.groups and sum(width for _, width in self.groups) != len(self.heads):
            raise ValueError(f"the groups of table {self.name} do not span its columns")
        for line in self.lines:
            if line.kind != "section" and len(line.entries) != len(self.heads):
                raise ValueError(f"row {line.label} of table {self.name} has the wrong length")

    @property
    def group_of(self) -> list[str]:
        """The group's title of every column."""
        names = [title for title, width in self.groups for _ in range(width)]
        return names or [""] * len(self.heads)


def plain(text: str) -> str:
    """`text` on one line."""
    return " ".join(text.split())


def escape_markdown(text: str) -> str:
    """`text` with what Markdown or HTML inside it would take for markup made harmless."""
    return re.sub(r"([\\|*_`<>\[\]])", r"\\\1", plain(text))


def to_markdown(grid: Table) -> str:
    """The table in Markdown, its title above and its notes below."""
    names = [
        f"{escape_markdown(group)} {escape_markdown(head)}".strip()
        for group, head in zip(grid.group_of, grid.heads, strict=True)
    ]
    rule = "---" if grid.words else "---:"
    lines = [
        f"### {escape_markdown(grid.title)}",
        "",
        f"| {escape_markdown(grid.corner)} | " + " | ".join(names) + " |",
        "|---|" + f"{rule}|" * len(names),
    ]
    for line in grid.lines:
        label = escape_markdown(line.label)
        shown = label if line.kind == "row" else f"*{label}*"
        if line.kind == "section":
            lines.append(f"| **{label}** | " + " | ".join([""] * len(names)) + " |")
        else:
            lines.append(f"| {shown} | " + " | ".join(map(_markdown_entry, line.entries)) + " |")
    for note in grid.notes:
        lines += ["", escape_markdown(note)]
    return "\n".join(lines) + "\n"


def _markdown_entry(entry: TableCell) -> str:
    text = escape_markdown(entry.text)
    return (f"**{text}**" if entry.best else text) + escape_markdown(entry.sign)


def to_csv(grids: Sequence[Table]) -> str:
    """All cells of `grids`, one a line, for programs: FIELDS, then LACKS.

    Values are not rounded. A text that a spreadsheet would run as a formula gets a quote before it.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow((*FIELDS, *LACKS))
    for grid in grids:
        section = ""
        for line in grid.lines:
            if line.kind == "section":
                section = line.label
                continue
            for group, head, entry in zip(grid.group_of, grid.heads, line.entries, strict=True):
                numbers = ("" if x is None else f"{x:.10g}" for x in _numbers(entry))
                words = (grid.name, section, line.label, group, head, entry.text)
                best = "best" if entry.best else ""
                lacks = (entry.missing or "", *(f"{x:.10g}" for x in entry.bounds or ()))
                row = (*map(_no_formula, words), *numbers, best, entry.sign, *lacks)
                writer.writerow((*row, *[""] * (len(FIELDS) + len(LACKS) - len(row))))
    return out.getvalue()


def _numbers(entry: TableCell) -> tuple[float | None, float | None, float | None]:
    return entry.value, entry.low, entry.high


def _no_formula(text: str) -> str:
    dangerous = text[:1] in "=+@\t\r" and text[:1] != ""
    return "'" + text if dangerous else text
