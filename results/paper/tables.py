"""All tables of the paper by name, and writing them to files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from robospa.results.paper import other_tables as given
from robospa.results.paper.columns import Column, check_worlds
from robospa.results.paper.result_tables import summary_table, task_table
from robospa.results.tables import Table, html_page, latex_document, to_csv, to_latex, to_markdown

Maker = Callable[[Sequence[Column], str], Table]

TABLES: dict[str, Maker] = {
    "main": lambda c, m: summary_table(c, "main", "sr", ("L1", "L5", "Drop"), m),
    "onta": lambda c, m: summary_table(c, "onta", "onta", ("L1", "L3", "L5"), m),
    "ps": lambda c, m: summary_table(c, "ps", "ps", ("L1", "L3", "L5"), m),
    "intervals": lambda c, m: given.interval_table(c),
    "sr-tasks": lambda c, m: task_table(c, "sr-tasks", "sr", m),
    "onta-tasks": lambda c, m: task_table(c, "onta-tasks", "onta", m),
    "ps-tasks": lambda c, m: task_table(c, "ps-tasks", "ps", m),
    "embodiments-spatial": lambda c, m: given.embodiment_table("spatial", c),
    "embodiments-procedural": lambda c, m: given.embodiment_table("procedural", c),
    "basic": lambda c, m: given.basic_table(c),
    "models": lambda c, m: given.models_table(),
    "datasets": lambda c, m: given.datasets_table(),
    "assets": lambda c, m: given.assets_table(),
    "errata": lambda c, m: given.errata_table(),
}
"""Name -> what makes it from columns and a way of marking the best (`tables_paper.MARKS`)."""

FORMATS: dict[str, Callable[[Sequence[Table]], str]] = {
    "md": lambda tables: "\n".join(to_markdown(table) for table in tables),
    "tex": latex_document,
    "html": lambda tables: html_page(tables, "RoboSPA: results"),
    "csv": to_csv,
}
"""Ending -> what writes several tables as one file."""


def make_tables(
    columns: Sequence[Column], names: Sequence[str] | None = None, mark: str = "tied"
) -> list[Table]:
    """The tables called `names` (default all); ValueError if one is unknown.

    Runs of basic grounding tasks alone appear in the table of these only. IncomparableError if runs
    of official worlds and of this benchmark's own suites are mixed.
    """
    chosen = list(TABLES) if names is None else list(names)
    for name in chosen:
        if name not in TABLES:
            raise ValueError(f"no table is called {name!r}; there are {', '.join(TABLES)}")
    check_worlds(columns)
    base = [column for column in columns if column.covers_benchmark]
    alike = like_paper(columns)

    def shown(name: str) -> Sequence[Column]:
        if name.startswith("embodiments-"):
            return base
        return [c for c in (columns if name == "basic" else base) if c in alike]

    return [TABLES[name](shown(name), mark) for name in chosen]


def like_paper(columns: Sequence[Column]) -> list[Column]:
    """The columns that may stand beside the published models in `columns`, if there are any: those
    of their robot. Runs on another robot are rows of the embodiment tables only."""
    robots = {column.embodiment for column in columns if column.published}
    return [column for column in columns if not robots or column.embodiment in robots]


def write_tables(tables: Sequence[Table], folder: Path, formats: Sequence[str]) -> list[Path]:
    """Write `tables.<ending>` with all of `tables`; for LaTeX also one file each, to be input."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for ending in formats:
        path = folder / f"tables.{ending}"
        path.write_text(FORMATS[ending](tables), encoding="utf-8")
        written.append(path)
        if ending == "tex":
            for table in tables:
                path = folder / f"{table.name}.tex"
                path.write_text(to_latex(table), encoding="utf-8")
                written.append(path)
    return written
