"""Reports of runs: one folder that can be moved or served as it is.

report.md and report.json for pasting and other programs, report.html with tables, figures, every
trial and its video, `figures/` for papers.
"""

from __future__ import annotations

import json
from pathlib import Path

from robospa.results.paper.origin import origin_of
from robospa.results.records.action_problems import problem_data
from robospa.results.report.page import FIGURES, page
from robospa.results.report.report import Report, draw_figures
from robospa.results.report.run_card import about, ends, facts
from robospa.results.report.tables import write_files
from robospa.results.scoring.score_json import to_json
from robospa.results.tables import escape_markdown, to_markdown

TABLES = "tables"


def write_report(report: Report, folder: Path) -> Path:
    """Write `report` into `folder` and return it."""
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    drawings = draw_figures(report.runs, report.columns, folder / FIGURES, failures=report.failures)
    write_files(report.tables, folder / TABLES)
    (folder / "report.md").write_text(markdown(report), encoding="utf-8")
    (folder / "report.json").write_text(json.dumps(to_data(report), indent=1) + "\n")
    (folder / "report.html").write_text(page(report, drawings, folder), encoding="utf-8")
    return folder


def markdown(report: Report) -> str:
    """report.md: the cards, what is missing or odd, and all tables."""
    lines = ["# " + escape_markdown(", ".join(name for name, _ in report.named_runs)), ""]
    for name, run in report.named_runs:
        lines += [f"## {escape_markdown(name)}", ""]
        lines += [f"* {title}: {escape_markdown(text)}" for title, text in facts(run)] + [""]
    for what, found in (
        ("note", report.banner),
        ("missing", report.missing),
        ("findings", [text for text in report.findings if text.startswith("error")]),
    ):
        lines += [f"* **{what}**: {escape_markdown(text)}" for text in found]
    for table in report.tables:
        lines += ["", to_markdown(table.table)]
    warnings = [text for text in report.findings if not text.startswith("error")]
    lines += ["", *(f"* **findings**: {escape_markdown(text)}" for text in warnings)]
    return "\n".join([*lines, "", " ".join(report.method), ""])


def to_data(report: Report) -> dict[str, object]:
    """report.json: facts, scores, ends and action problems of every run."""
    return {
        "origin": origin_of([model for model in report.models if not model.published]),
        "runs": [
            {
                "name": model.name,
                "run": about(run),
                **to_json(model.scores),
                "ends": ends(run),
                "problems": problem_data(run.records.values()),
            }
            for model, run in zip(report.models, report.runs, strict=False)
        ],
    }
