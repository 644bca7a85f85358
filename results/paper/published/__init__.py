"""The published results of RoboSPA as data, one JSON file a table or group of tables.

Every file names the label of the paper's table that it was read from. Numbers are percent exactly
as printed, misprints included: what does not follow is named by `robospa.results.paper.check`.
Tasks have the names of the environments; `PublishedTask.printed` is the name in the result tables.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

LEVELS = (1, 2, 3, 4, 5)
TITLES = {"pi0.5": "π0.5"}
"""Names of models that are written otherwise than their key."""


@dataclass(frozen=True)
class PublishedTask:
    """A base task: `counts` per level are candidates (the n of ONTA) or subtasks (the T of PS)."""

    name: str
    printed: str
    category: str
    counts: tuple[int, ...]


@dataclass(frozen=True)
class PrintedTable:
    """A table: values by row and model in the order of `columns`; `best` is its shading."""

    source: str
    metric: str
    columns: tuple[str, ...]
    rows: Mapping[str, Mapping[str, Sequence[float]]]
    best: Mapping[str, Mapping[str, Sequence[str]]]


@dataclass(frozen=True)
class PerTask:
    """A printed per-task table of one model: values at L1 to L5 by task."""

    source: str
    metric: str
    model: str
    rows: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class Embodiments:
    """X-VLA on five robots: `rows[robot][short]` at `columns`, `tasks[short]` is the task."""

    source: Mapping[str, str]
    model: str
    columns: tuple[str, ...]
    tasks: Mapping[str, str]
    names: Mapping[str, str]
    rows: Mapping[str, Mapping[str, Sequence[float]]]


@dataclass(frozen=True)
class Published:
    """Everything that the paper prints. `models` are in its order, with their training budget."""

    trials: int
    embodiment: str
    mode: str
    models: Mapping[str, Mapping[str, Any]]
    tasks: Mapping[str, PublishedTask]
    per_task: Mapping[tuple[str, str], PerTask]
    main: PrintedTable
    onta: PrintedTable
    ps: PrintedTable
    intervals: Mapping[str, Any]
    embodiments: Embodiments
    basic_grounding: Mapping[str, Any]
    datasets: Mapping[str, Any]
    assets: Mapping[str, Any]
    budget_source: str

    @property
    def members(self) -> dict[str, list[str]]:
        """The tasks of every category, in the paper's order."""
        found: dict[str, list[str]] = {}
        for task in self.tasks.values():
            found.setdefault(task.category, []).append(task.name)
        return found

    def value(self, model: str, metric: str, task: str, level: int) -> float | None:
        """The printed per-task value, None where the metric does not apply."""
        row = self.per_task[model, metric].rows.get(task)
        return None if row is None else row[LEVELS.index(level)]


def title(model: str) -> str:
    """How a model's name is written."""
    return TITLES.get(model, model)


def _read(name: str) -> dict[str, Any]:
    text = files("robospa.results.paper.published").joinpath(name).read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data


def _table(name: str) -> PrintedTable:
    data = _read(name)
    columns = tuple(data["columns"])
    return PrintedTable(data["source"], data["metric"], columns, data["rows"], data["best"])


def _embodiments() -> Embodiments:
    data = _read("embodiments.json")
    columns = tuple(data["columns"])
    return Embodiments(
        data["source"], data["model"], columns, data["tasks"], data["names"], data["rows"]
    )


@cache
def load() -> Published:
    """The published results; read once."""
    tasks = {
        name: PublishedTask(
            name, row["printed"], row["category"], tuple(row.get("candidates") or row["subtasks"])
        )
        for name, row in _read("tasks.json")["tasks"].items()
    }
    per_task = _read("per_task.json")
    printed = [
        PerTask(source, table["metric"], table["model"], table["rows"])
        for source, table in per_task["tables"].items()
    ]
    models = _read("models.json")
    return Published(
        trials=per_task["trials"],
        embodiment=models["embodiment"],
        mode=models["mode"],
        models=models["rows"],
        tasks=tasks,
        per_task={(t.model, t.metric): t for t in printed},
        main=_table("main.json"),
        onta=_table("onta.json"),
        ps=_table("ps.json"),
        intervals=_read("intervals.json"),
        embodiments=_embodiments(),
        basic_grounding=_read("basic_grounding.json"),
        datasets=_read("datasets.json"),
        assets=_read("assets.json"),
        budget_source=models["source"],
    )
