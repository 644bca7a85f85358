"""The published results of RoboSPA as data, one JSON file a table or group of tables.

Every file names the label of the paper's table that it was read from. Numbers are percent exactly
as printed, misprints included: what does not follow is named by `robospa.results.paper.check`.
Tasks have the names of the environments; `PublishedTask.printed` is the name in the result tables.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from robospa.registry import did_you_mean
from robospa.schema import read

LEVELS = (1, 2, 3, 4, 5)
TITLES = {"pi0.5": "π0.5"}
"""Names of models that are written otherwise than their key."""


@dataclass(frozen=True)
class PublishedTask:
    """A base task: `counts` per level are candidates (the n of ONTA) or subtasks (the T of PS).

    `printed` is its name in the paper's result tables; pages use `title`, the environment's.
    """

    name: str
    printed: str
    category: str
    counts: tuple[int, ...]

    @property
    def title(self) -> str:
        """The name that people read, the same on every page."""
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class PrintedTable:
    """A table: values by row and model in the order of `columns`; `best` is its shading."""

    source: str
    metric: str
    columns: tuple[str, ...]
    rows: Mapping[str, Mapping[str, tuple[float, ...]]]
    best: Mapping[str, Mapping[str, tuple[str, ...]]]


@dataclass(frozen=True)
class PerTask:
    """A printed per-task table of one model: values at L1 to L5 by task."""

    metric: str
    model: str
    rows: Mapping[str, tuple[float, ...]]
    source: str


@dataclass(frozen=True)
class IntervalTable:
    """Success at `level` by model and row: value, lower and upper end of the 95 % interval."""

    source: str
    level: int
    rows: Mapping[str, Mapping[str, tuple[float, float, float]]]


@dataclass(frozen=True)
class Embodiments:
    """X-VLA on five robots: `rows[robot][short]` at `columns`, `tasks[short]` is the task."""

    source: Mapping[str, str]
    model: str
    columns: tuple[str, ...]
    tasks: Mapping[str, str]
    names: Mapping[str, str]
    rows: Mapping[str, Mapping[str, tuple[float, ...]]]


@dataclass(frozen=True)
class BasicGrounding:
    """Basic grounding by row at `columns`: means over `tasks` tasks of `trials` trials each."""

    source: str
    columns: tuple[str, ...]
    tasks: int
    trials: int
    rows: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class PublishedModel:
    """A model's size and its training per base task."""

    parameters: str
    gpus: int
    hours: float
    gpu_hours: float


@dataclass(frozen=True)
class Dataset:
    """A data set or benchmark (`kind`) that the paper compares with; counts are as printed."""

    name: str
    kind: str
    categories: str
    tasks: str
    trajectories: str
    embodiments: str
    spatial_reasoning: bool
    long_horizon: bool
    step_level: bool
    multi_difficulty: bool
    scene_diversity: bool


@dataclass(frozen=True)
class Datasets:
    """The table of data sets and benchmarks."""

    note: str
    rows: tuple[Dataset, ...]


@dataclass(frozen=True)
class Assets:
    """Number of variants by object category; `text` has the totals that the paper's text gives."""

    source: str
    text: Mapping[str, int]
    rows: Mapping[str, int]


@dataclass(frozen=True)
class Published:
    """Everything that the paper prints. `models` are in its order, with their training budget.

    Its scenes are a `suite` of their own, and its sentences a `split`.
    """

    trials: int
    suite: str
    embodiment: str
    mode: str
    split: str
    models: Mapping[str, PublishedModel]
    tasks: Mapping[str, PublishedTask]
    per_task: Mapping[tuple[str, str], PerTask]
    main: PrintedTable
    onta: PrintedTable
    ps: PrintedTable
    intervals: IntervalTable
    embodiments: Embodiments
    basic_grounding: BasicGrounding
    datasets: Datasets
    assets: Assets
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


def find_model(name: str) -> str:
    """The published model called `name`, however it is written ("pi05", "π0.5", "x_vla").

    Raises:
        ValueError: There is none; the message says which there are.
    """
    models = load().models
    known = {_letters(written): m for m in models for written in (m, title(m))}
    if found := known.get(_letters(name)):
        return found
    hint = did_you_mean(name, models)
    raise ValueError(f"no published model is called {name!r}; {hint}there are {', '.join(models)}")


def _letters(name: str) -> str:
    return "".join(c for c in name.lower().replace("π", "pi") if c.isalnum())


def row_title(row: str) -> str:
    """The name that pages use for `row` of a printed table: a task's own, or what is printed."""
    return next((task.title for task in load().tasks.values() if task.printed == row), row)


def title(model: str) -> str:
    """A model's name as it is written."""
    return TITLES.get(model, model)


TABLES = ("main", "onta", "ps", "intervals", "embodiments", "basic_grounding", "datasets", "assets")
"""Fields of `Published` that have a file each."""


def _content(name: str) -> Any:
    return json.loads(files(__name__).joinpath(name).read_text(encoding="utf-8"))


@cache
def load() -> Published:
    """The published results; read once."""
    models, per_task = _content("models.json"), _content("per_task.json")
    whole = {
        **models,
        "models": models["rows"],
        "budget_source": models["source"],
        "trials": per_task["trials"],
        "tasks": {
            name: {**row, "name": name, "counts": row.get("candidates") or row["subtasks"]}
            for name, row in _content("tasks.json")["tasks"].items()
        },
        "per_task": {
            (table["model"], table["metric"]): {**table, "source": source}
            for source, table in per_task["tables"].items()
        },
        **{name: _content(f"{name}.json") for name in TABLES},
    }
    return read(Published, whole, "the published results")
