"""One column of a paper's table: a published model or a run, with the same arithmetic for both.

A run covers what it covers. A variant that was not run, or lost every trial, leaves open all
averages above it; one that lost some trials keeps its rate, and everything above it knows how many
are missing. Columns of one table must have been measured alike: `check_columns` says where not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robospa.categories import BASIC, DIMENSIONS, METRIC_CATEGORIES, SPATIAL
from robospa.results.paper import rounding
from robospa.results.paper.published import LEVELS, Published, load, title
from robospa.results.records.run_io import Run
from robospa.results.scoring.scores import Average, Cell, Scores, combine, score_run
from robospa.results.statistics.bootstrap import Sample, rate
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    bounded_mean,
    chance_corrected,
    wilson,
)
from robospa.results.tables.table import MISSING


class TableError(ValueError):
    """Columns that cannot stand in one table, or a run that fits none."""


@dataclass(frozen=True)
class Column:
    """A model's values in percent by metric and (row, level); None where something is missing.

    A row is a task, a category, a dimension or `overall`. `scores` has the same with intervals as
    fractions. `suite` is "" where it is not known. `trials` is the most that any variant lists. A
    `privileged` policy saw the exact state: it is shown, but competes with nobody.
    """

    title: str
    scores: Scores
    values: Mapping[str, Mapping[tuple[str, int], float | None]]
    embodiment: str
    mode: str
    suite: str = ""
    split: str = ""
    trials: int = 0
    published: str = ""
    privileged: bool = False

    def value(self, metric: str, row: str, level: int) -> float | None:
        """Percent, unrounded."""
        return self.values[metric].get((row, level))

    def part(self, row: str, level: int) -> Cell | Average | None:
        """What the run knows of a row, which for averages is only what was run."""
        if row == rounding.OVERALL:
            return self.scores.overall.get(level)
        found = self.scores.cells.get((row, level)) or self.scores.categories.get((row, level))
        return found or self.scores.dimensions.get((row, level))

    def estimate(self, metric: str, row: str, level: int) -> Estimate | None:
        """The value with its interval, as fractions; None where the value is missing."""
        part = self.part(row, level)
        if part is None or self.value(metric, row, level) is None:
            return None
        if metric == "sr" or isinstance(part, Cell) or row in METRIC_CATEGORIES[metric]:
            return part.values.get(metric)
        dimension = "spatial" if metric == "onta" else "procedural"
        return part.values.get(metric) if row == dimension else None

    def sample(self, metric: str, row: str, level: int) -> Sample | Estimate | None:
        """What a test compares: counts of a variant's success rate, else value and interval."""
        part = self.part(row, level)
        if metric == "sr" and isinstance(part, Cell) and part.trials:
            return rate(part.successes, part.trials)
        return self.estimate(metric, row, level)

    def samples(self, row: str, level: int) -> tuple[list[Sample], list[float]]:
        """Success counts of all variants below a row, and each one's share of its mean.

        Empty where the column has no value of the row.
        """
        if self.value("sr", row, level) is None:
            return [], []
        members = load().members
        categories = DIMENSIONS.get(row, METRIC_CATEGORIES["sr"])
        samples, shares = [], []
        for category in (row,) if row in members else categories:
            for task in members[category]:
                cell = self.scores.cells[task, level]
                samples.append(rate(cell.successes, cell.trials))
                shares.append(1 / len(members[category]))
        return samples, [share / sum(shares) for share in shares]

    def missing(self, row: str, level: int) -> int:
        """Listed trials below this row that have no result."""
        part = self.part(row, level)
        return 0 if part is None else part.missing

    def lacks(self, metric: str, row: str, level: int) -> dict[str, Any]:
        """What an entry of a table says of missing trials."""
        part = self.part(row, level)
        if part is None or not part.missing:
            return {}
        ends = part.bounds(metric)
        bounds = None if ends is None else (100 * ends[0], 100 * ends[1])
        return {"sign": MISSING, "missing": part.missing, "bounds": bounds}

    @property
    def covers_benchmark(self) -> bool:
        """Whether it lists any of the benchmark's 56 tasks."""
        return any(task in load().tasks for task, _ in self.scores.cells)

    @property
    def covers_basic(self) -> bool:
        """Whether it lists any basic grounding task."""
        return any(cell.category in BASIC for cell in self.scores.cells.values())

    def not_run(self, level: int) -> int:
        """Tasks that the benchmark has and this column does not list at `level`."""
        return sum((task, level) not in self.scores.cells for task in load().tasks)


def cell_percent(cell: Cell | None, metric: str) -> float | None:
    """A variant's value in percent, from its counts where it has them."""
    estimate = None if cell is None else cell.values.get(metric)
    if cell is None or estimate is None:
        return None
    if metric == "ps":
        return 100 * estimate.value
    success = 100 * cell.successes / cell.trials
    return success if metric == "sr" else rounding.onta(success, cell.candidates)


def table_values(
    cells: Mapping[tuple[str, int], Cell],
) -> dict[str, dict[tuple[str, int], float | None]]:
    """Percent by metric and (task, category, dimension or overall; level)."""
    members = load().members
    made: dict[str, dict[tuple[str, int], float | None]] = {}
    for metric, categories in METRIC_CATEGORIES.items():
        below = {c: members[c] for c in categories}
        made[metric] = {}
        for level in LEVELS:
            tasks = {
                task: cell_percent(cells.get((task, level)), metric)
                for names in below.values()
                for task in names
            }
            found = {**tasks, **rounding.summary(tasks, below)}
            made[metric].update({(row, level): value for row, value in found.items()})
    return made


def published_cell(published: Published, model: str, task: str, level: int) -> Cell:
    """A published variant as if it had been run: counts from SR, progress as a bare mean."""
    about = published.tasks[task]
    trials, count = published.trials, about.counts[level - 1]
    sr = published.value(model, "sr", task, level)
    assert sr is not None, f"no SR of {task}"
    successes = round(sr * trials / 100)
    found = wilson(successes, trials)
    values: dict[str, Estimate | None] = {"sr": found}
    samples = {"sr": rate(successes, trials)}
    if about.category in SPATIAL:
        values["onta"] = chance_corrected(found, count)
        samples["onta"] = rate(successes, trials, count)
        return Cell(task, level, about.category, trials, trials, successes, values, count, samples)
    printed = published.value(model, "ps", task, level)
    assert printed is not None, f"no PS of {task}"
    progress = rounding.exact_progress(printed, count, trials)
    values["ps"] = bounded_mean(progress / 100, trials)
    return Cell(task, level, about.category, trials, trials, successes, values, samples=samples)


def published_column(model: str, name: str | None = None, ci: str = METHODS[0]) -> Column:
    """A published model, computed from its per-task tables.

    Where an average of progress falls exactly between two printable values, binary noise in the
    means of c/T decided what was printed, so the printed one is taken.
    """
    data = load()
    if model not in data.models:
        raise TableError(f"no published model is called {model!r}; there are {_names(data.models)}")
    cells = {
        (task, level): published_cell(data, model, task, level)
        for task in data.tasks
        for level in LEVELS
    }
    values = table_values(cells)
    for row, printed in data.ps.rows.items():
        for column, shown in zip(data.ps.columns, printed[model], strict=True):
            value = values["ps"][row, int(column[1])]
            if value is not None and rounding.is_tie(value) and abs(value - shown) < 0.051:
                values["ps"][row, int(column[1])] = value + (1e-6 if shown > value else -1e-6)
    return Column(
        name or title(model),
        combine(cells, ci),
        values,
        data.embodiment,
        data.mode,
        trials=data.trials,
        published=model,
    )


def run_column(run: Run, name: str | None = None, ci: str = METHODS[0]) -> Column:
    """A run as a column; TableError if it mixes what one column cannot hold, or fits no table."""
    data = load()
    label = (name or run.info.policy or run.folder.name) + " (privileged)" * run.info.privileged
    keys = run.keys
    if not keys:
        raise TableError(f"the run {label} lists no trials; there is nothing to show")
    for what in ("embodiment", "mode", "split"):
        several = sorted({str(getattr(key, what)) for key in keys})
        if len(several) > 1:
            raise TableError(
                f"the run {label} mixes {what}s ({_names(several)}); evaluate one at a time"
            )
    basic = {t for t, c in run.info.categories.items() if c in BASIC}
    unknown = sorted(
        {
            f"{k.task} L{k.level}"
            for k in keys
            if not (k.level in LEVELS and (k.task in data.tasks or k.task in basic))
        }
    )
    if unknown:
        raise TableError(
            f"the run {label} has variants that the benchmark's tables do not know "
            f"({_names(unknown[:3])}{', ...' if len(unknown) > 3 else ''}); see `robospa tasks`"
        )
    scores = score_run(run, ci)
    return Column(
        label,
        scores,
        table_values(scores.cells),
        keys[0].embodiment,
        keys[0].mode,
        suite=run.info.suite,
        split=keys[0].split,
        trials=max(cell.listed for cell in scores.cells.values()),
        privileged=run.info.privileged,
    )


def check_columns(columns: Sequence[Column]) -> None:
    """TableError unless all columns were measured on the same suite, embodiment and scenes."""
    for what in ("embodiment", "mode", "suite", "split"):
        found = {str(getattr(c, what)): c.title for c in columns if getattr(c, what)}
        if len(found) > 1:
            (first, one), (second, other), *_ = found.items()
            raise TableError(
                f"{one} and {other} cannot stand in one table: their {what} differs "
                f"({first}, {second})"
            )
    titles = [c.title for c in columns]
    twice = sorted({t for t in titles if titles.count(t) > 1})
    if twice:
        raise TableError(f"two columns are called {twice[0]}; give one of them another name")
    if not columns:
        raise TableError("a table needs at least one published model or run")


def _names(items: Iterable[str]) -> str:
    return ", ".join(items)
