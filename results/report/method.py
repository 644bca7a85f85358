"""Sentences on how the values and intervals of a report were made."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.results.paper.columns import Column

AVERAGES = (
    "Values in percent. A category is the mean of its tasks; dimensions and the overall value are "
    "means of categories. ONTA is 0 for guessing among the candidates."
)
SINGLE = {"wilson": "Wilson's", "exact": "Clopper and Pearson's exact", "jeffreys": "Jeffreys'"}
"""Methods for the success rate of one variant, by the name of `intervals.METHODS`."""
BOOTSTRAP = "95 % intervals are the paper's: a bootstrap over the trials within each variant."
PROGRESS = "Intervals of progress are a bootstrap over trials."
PRINTED = (
    "Of published progress only the mean is known: its interval is rather too wide than too narrow."
)


def method_notes(columns: Sequence[Column]) -> list[str]:
    """The sentences for a report of `columns`; none if there are none."""
    if not columns:
        return []
    cells = [
        (c, estimate) for c in columns for cell in c.scores.cells.values()
        if (estimate := cell.values.get("ps")) is not None
    ]  # fmt: skip
    printed = any(column.published for column, _ in cells)
    ci = columns[0].scores.ci
    if ci == "bootstrap":
        return [AVERAGES, BOOTSTRAP, *([PRINTED] if printed else [])]
    rates = (
        f"95 % intervals are over trials on other seeds: {SINGLE[ci]} for the rate of one variant; "
        "for an average MOVER, which combines the intervals of the variants below it."
    )
    resampled = any(not column.published for column, _ in cells)
    return [
        AVERAGES,
        rates,
        *([PROGRESS] if resampled else []),
        *([PRINTED] if printed else []),
    ]
