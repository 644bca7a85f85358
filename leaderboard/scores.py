"""Scores and tables of a bundle, made by the same code as `robospa report`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from robospa.results.paper.columns import run_column
from robospa.results.paper.tables import FORMATS
from robospa.results.records.run_io import Run
from robospa.results.report.tables import report_tables
from robospa.results.scoring.score_json import ScoresData, to_json
from robospa.results.scoring.scores import score_run
from robospa.results.scoring.setting import IncomparableError

CLOSE = 1e-9
"""Two computations of one number may differ by this much: other numpy, other order of sums."""


def scores_of(run: Run) -> ScoresData:
    """All scores of `run`, as `report.json` has them."""
    return to_json(score_run(run))


def tables_of(run: Run) -> dict[str, bytes]:
    """The report's tables of `run` as files, by ending."""
    try:
        tables = [shown.table for shown in report_tables([run_column(run, "model")])]
    except IncomparableError:
        tables = []  # of variants that no table has
    return {ending: FORMATS[ending](tables).encode() for ending in ("csv", "md")}


def compare_scores(right: object, given: object, where: str = "") -> str:
    """Where `given` first differs from `right`, in words; "" if nowhere."""
    if isinstance(right, Mapping):
        if not isinstance(given, Mapping) or set(given) != set(right):
            return f"{where or 'the scores'} have other entries"
        pairs = [(name, right[name], given[name]) for name in right]
    elif isinstance(right, (list, tuple)):
        if not isinstance(given, list) or len(given) != len(right):
            return f"{where} has another length"
        pairs = [(str(n), a, b) for n, (a, b) in enumerate(zip(right, given, strict=True))]
    else:
        return "" if _equal(right, given) else f"{where} is {str(given)[:40]!a}, not {right!r}"
    for name, one, other in pairs:
        found = compare_scores(one, other, f"{where}, {name}" if where else str(name))
        if found:
            return found
    return ""


def _equal(right: object, given: object) -> bool:
    numbers = (int, float)
    if isinstance(right, numbers) and isinstance(given, numbers):
        if isinstance(right, bool) or isinstance(given, bool):
            return right is given
        return math.isclose(right, given, rel_tol=CLOSE, abs_tol=CLOSE)
    return type(right) is type(given) and bool(right == given)
