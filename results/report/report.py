"""Reports of runs: one folder that can be moved or served as it is.

report.md and report.json for pasting and other programs, report.html with tables, figures, every
trial and its video, `figures/` for papers. Runs that cannot stand in one table (other embodiments,
scenes, suites) still get their trials and cards, and one sentence that says why there is no table.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robospa.categories import METRIC_NAMES
from robospa.results.figures.draw import draw
from robospa.results.figures.series import FORMATS, Drawing, Series
from robospa.results.paper.columns import (
    Column,
    check_columns,
    published_column,
    run_column,
)
from robospa.results.records.lint import lint_run, lint_runs
from robospa.results.records.run_io import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.page import FIGURES, page
from robospa.results.report.run_card import about, ends, facts, names_of
from robospa.results.report.score_table import loss_lines, missing_lines, to_json
from robospa.results.report.tables import Shown, for_page, report_tables, write_files
from robospa.results.scoring.scores import Scores, score_run
from robospa.results.scoring.setting import IncomparableError
from robospa.results.tables.table import escape_markdown, to_markdown

TABLES = "tables"
AVERAGES = (
    "Values in percent. A category is the mean of its tasks; dimensions and the overall value are "
    "means of categories. ONTA is 0 for guessing among the candidates."
)


def write_report(
    runs: Run | Sequence[Run], folder: Path, published: Sequence[str] = (), ci: str = "wilson"
) -> Path:
    """Write the report of one or several runs into `folder` and return it.

    `published` names published models to stand beside them, `ci` is one of `intervals.METHODS`.
    """
    shown = [runs] if isinstance(runs, Run) else list(runs)
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    found = gather(shown, published, ci)
    drawings = draw_figures(shown, found.columns, folder / FIGURES)
    write_files(found.tables, folder / TABLES)
    text = markdown(shown, found.names, found.tables, found.notes)
    (folder / "report.md").write_text(text, encoding="utf-8")
    data = to_data(shown, found.names, found.scores)
    (folder / "report.json").write_text(json.dumps(data, indent=1) + "\n")
    (folder / "report.html").write_text(
        page(
            shown,
            found.names,
            found.scores,
            for_page(found.tables),
            drawings,
            found.notes,
            folder,
        ),
        encoding="utf-8",
    )
    return folder


@dataclass(frozen=True)
class Gathered:
    """What a report says of its runs; `scores` and `columns` also have published models."""

    names: list[str]
    columns: list[Column]
    scores: dict[str, Scores]
    tables: list[Shown]
    notes: Mapping[str, Sequence[str]]


def gather(runs: Sequence[Run], published: Sequence[str] = (), ci: str = "wilson") -> Gathered:
    """Scores, tables and notes of `runs` beside the `published` models."""
    names = names_of(runs)
    columns, refused = columns_of(runs, names, published, ci)
    scores = dict(
        zip(
            [*names, *(c.title for c in columns[len(runs) :])],
            (c.scores for c in columns),
            strict=False,
        )
    ) or {name: score_run(run, ci) for name, run in zip(names, runs, strict=True)}
    tables = report_tables(columns) if columns else []
    notes = {
        "missing": missing(scores, names) + losses(runs, names),
        "findings": [*refused, *findings(runs)],
        "method": method_notes(columns),
    }
    return Gathered(names, columns, scores, tables, notes)


def columns_of(
    runs: Sequence[Run], names: Sequence[str], published: Sequence[str], ci: str
) -> tuple[list[Column], list[str]]:
    """A column for every run and model, or none and the reason in a sentence."""
    try:
        columns = [run_column(run, name, ci) for run, name in zip(runs, names, strict=True)]
        columns += [published_column(model, ci=ci) for model in published]
        check_columns(columns)
    except IncomparableError as error:
        if published or len(runs) > 1:
            raise
        return [], [f"No tables: {error}."]
    return columns, []


def draw_figures(
    runs: Sequence[Run],
    columns: Sequence[Column],
    folder: Path,
    formats: Sequence[str] = FORMATS,
) -> list[Drawing]:
    """The figures of `columns`, of which the first belong to `runs`."""
    series = []
    for number, column in enumerate(columns):
        name = column.title
        records: tuple[TrialRecord, ...] = ()
        if number < len(runs):
            run = runs[number]
            records = tuple(r for r in run.records.values() if finished(r))
            name += f" ({len(run.missing)} of {len(run.keys)} missing)" * bool(run.missing)
        series.append(Series(name, column.scores, records, bool(column.published)))
    return draw(series, folder, formats) if series else []


def missing(scores: dict[str, Scores], names: Sequence[str]) -> list[str]:
    """A sentence for every variant that lacks trials."""
    return [
        f"{name}: {line}" if len(names) > 1 else line
        for name in names
        for line in missing_lines(scores[name])
    ]


def losses(runs: Sequence[Run], names: Sequence[str]) -> list[str]:
    """Why trials are missing."""
    return [
        f"{name}: {line}" if len(names) > 1 else line
        for name, run in zip(names, runs, strict=True)
        for line in loss_lines(run)
    ]


def findings(runs: Sequence[Run]) -> list[str]:
    """What `robospa lint` finds in the runs."""
    found = [f for run in runs for f in lint_run(run)]
    found += lint_runs(runs) if len(runs) > 1 else []
    return [str(f) for f in found]


def method_notes(columns: Sequence[Column]) -> list[str]:
    """How values and intervals were made, in sentences, as the estimates themselves say."""
    if not columns:
        return []
    made: dict[str, set[str]] = {}
    for column in columns:
        scores = column.scores
        for cell in scores.cells.values():
            for metric, estimate in cell.values.items():
                if estimate is not None:
                    made.setdefault(METRIC_NAMES[metric], set()).add(estimate.method)
        for average in (*scores.categories.values(), *scores.overall.values()):
            found = {e.method for e in average.values.values() if e is not None}
            made.setdefault("averages", set()).update(found)
    parts = [f"{name}: {' or '.join(sorted(m - {''}))}" for name, m in made.items() if m - {""}]
    return [AVERAGES, "Methods of the 95 % intervals: " + "; ".join(parts) + "."]


def markdown(
    runs: Sequence[Run],
    names: Sequence[str],
    tables: Sequence[Shown],
    notes: Mapping[str, Sequence[str]],
) -> str:
    """report.md: the cards, what is missing or odd, and all tables."""
    lines = ["# " + escape_markdown(", ".join(names)), ""]
    for run, name in zip(runs, names, strict=True):
        lines += [f"## {escape_markdown(name)}", ""]
        lines += [f"* {title}: {escape_markdown(text)}" for title, text in facts(run)] + [""]
    for what in ("missing", "findings"):
        lines += [f"* **{what}**: {escape_markdown(text)}" for text in notes[what]]
    for table in tables:
        lines += ["", to_markdown(table.grid)]
    return "\n".join([*lines, "", " ".join(notes["method"]), ""])


def to_data(runs: Sequence[Run], names: Sequence[str], scores: dict[str, Scores]) -> dict[str, Any]:
    """report.json: facts, scores and ends of every run."""
    return {
        "runs": [
            {"name": name, "run": about(run), **to_json(scores[name]), "ends": ends(run)}
            for name, run in zip(names, runs, strict=True)
        ]
    }
