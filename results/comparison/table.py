"""Differences of two runs as a table."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.comparison.compare import Comparison, Difference
from robospa.results.tables import Table, TableCell, TableRow

HEAD = 18
"""Letters of a side's name over a column."""


def difference_table(found: Comparison, rows: Sequence[Difference], title: str) -> Table:
    """`rows` of the comparison `found`, in percentage points."""
    several = any(row.over_tasks for row in rows)
    names = heads_of(found.first, found.second)
    heads = ("level", *names, "difference [95 %]", "p", "q", "trials")
    heads += ("other tasks",) * several
    heads += tuple(f"only {name}" for name in names) * found.paired
    made = tuple(_row(row, several, found.paired) for row in rows)
    return Table("differences", title, "", heads, made)


def _row(row: Difference, several: bool, paired: bool) -> TableRow:
    partly = f" ({row.variants} of {row.listed})" if row.variants < row.listed else ""
    e = row.estimate
    cells = [
        f"L{row.level}" if row.level else "mean",
        f"{100 * row.first:z.1f}",
        f"{100 * row.second:z.1f}",
        f"{100 * e.value:+z.1f} [{100 * e.low:+z.1f}, {100 * e.high:+z.1f}]",
        chance(row.p),
        chance(row.q) if row.kind in ("variant", "category") else "",
        str(row.trials),
    ]
    if several:
        o = row.over_tasks
        cells.append(f"[{100 * o.low:+z.1f}, {100 * o.high:+z.1f}]" if o else "")
    if paired:
        cells += [str(row.only_first), str(row.only_second)]
    return TableRow(f"{row.label}{partly}", tuple(map(TableCell, cells)))


def heads_of(first: str, second: str) -> list[str]:
    """The names of two sides, short enough to stand over columns: their ends if need be, which is
    where names of runs differ."""
    short = [n if len(n) <= HEAD else "…" + n[1 - HEAD :] for n in (first, second)]
    return short if short[0] != short[1] else ["first", "second"]


def chance(p: float) -> str:
    """A p-value in a table."""
    return f"{p:.3f}" if p >= 0.0005 else "<.001"
