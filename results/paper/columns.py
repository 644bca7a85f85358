"""One column of a paper's table: a model's results with the values as the paper computes them.

A run covers what it covers. A variant that was not run, or lost every trial, leaves open all
averages above it, unless the run is in progress, whose averages are over what it has so far; one
that lost some trials keeps its rate, and everything above it knows how many are missing. Columns of
one table must have been measured alike: `check_columns` says where not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from robospa.results.paper import rounding
from robospa.results.paper.published import LEVELS, Published, find_model, load, title
from robospa.results.records.manifest import Departure, departures
from robospa.results.records.runs import Run
from robospa.results.scoring import models
from robospa.results.scoring.scores import IDLE, AverageScore, Scores, VariantScore, combine
from robospa.results.statistics import intervals
from robospa.results.statistics.samples import Sample, onta_of_percent, rate
from robospa.results.tables import MISSING, TableCell
from robospa.trial import BASIC, CATEGORIES, METRIC_CATEGORIES, RATES, SPATIAL


def published_cell(published: Published, model: str, task: str, level: int) -> VariantScore:
    """A published variant as if it had been run: counts from SR, progress as a bare mean."""
    about = published.tasks[task]
    trials, count = published.trials, about.counts[level - 1]
    sr = published.value(model, "sr", task, level)
    assert sr is not None, f"no SR of {task}"
    successes = round(sr * trials / 100)
    found = intervals.wilson(successes, trials)
    values: dict[str, intervals.Estimate | None] = {"sr": found}
    samples = {"sr": rate(successes, trials)}
    if about.category in SPATIAL:
        values["onta"] = intervals.chance_corrected(found, count)
        samples["onta"] = rate(successes, trials, count)
    else:
        printed = published.value(model, "ps", task, level)
        assert printed is not None, f"no PS of {task}"
        progress = rounding.exact_progress(printed, count, trials)
        values["ps"], count = intervals.bounded_mean(progress / 100, trials), 0
    shown = (about.category, trials, trials, successes, values, count, samples)
    return VariantScore(task, level, *shown)


def results_beside_runs(model: str, ci: str = intervals.METHODS[0]) -> models.ModelResults:
    """A published model whose name says that its numbers are the paper's."""
    found = published_results(model, ci)
    return replace(found, name=f"{found.name} (paper)")


def published_results(model: str, ci: str = intervals.METHODS[0]) -> models.ModelResults:
    """A published model, computed from its per-task tables."""
    data, model = load(), find_model(model)
    cells = {
        (task, level): published_cell(data, model, task, level)
        for task in data.tasks
        for level in LEVELS
    }
    setting = models.Setting((data.embodiment,), (data.mode,), (data.split,), (data.suite,))
    return models.ModelResults(title(model), combine(cells, ci), setting, published=model)


Values = Mapping[str, Mapping[tuple[str, int], float | None]]
"""Percent by metric and (row, level)."""


@dataclass(frozen=True)
class Column:
    """A model's values in percent by metric, row and level; None where something is missing.

    A row is a task, a category, a dimension or `overall`. A privileged policy is shown, but
    competes with nobody.
    """

    results: models.ModelResults
    idle: bool = False
    """Whether it is what holds on a run's scenes before the first action, as progress."""

    @property
    def title(self) -> str:
        """The head of the column, with the run's departures from the benchmark."""
        return self.results.name + "".join(f" ({one.name})" for one in self.departures)

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """Those of its run; none of a published model."""
        return () if self.idle else departures(self.results.manifest)

    @property
    def scores(self) -> Scores:
        """The same values with intervals, as fractions."""
        return self.results.scores

    @property
    def published(self) -> str:
        """The published model's name; "" of a run."""
        return self.results.published

    @property
    def ranked(self) -> bool:
        """Whether it is marked and ranked among others."""
        return not self.idle and all(one.ranked for one in self.departures)

    @property
    def embodiment(self) -> str:
        """The robot, "" where it is not known."""
        return next(iter(self.results.setting.embodiment), "")

    @property
    def trials(self) -> int:
        """The most trials that any variant lists."""
        return max((cell.listed for cell in self.scores.cells.values()), default=0)

    @cached_property
    def values(self) -> Values:
        """Percent, unrounded, by metric and (row, level)."""
        values = table_values(self.scores.cells, bool(self.results.to_run))
        return _untied(values, self.published) if self.published else values

    def value(self, metric: str, row: str, level: int) -> float | None:
        return self.values[metric].get((row, level))

    def estimate(self, metric: str, row: str, level: int) -> intervals.Estimate | None:
        """The value with its interval, as fractions; None where the value is missing."""
        part = self.scores.part(row, level)
        if part is None or self.value(metric, row, level) is None:
            return None
        if row == rounding.OVERALL and METRIC_CATEGORIES[metric] != CATEGORIES:
            return None
        return part.values.get(metric)

    def sample(self, metric: str, row: str, level: int) -> Sample | intervals.Estimate | None:
        """The input of a test: counts of a variant's success rate, else value and interval, which
        is not the bootstrap's: that can be a point."""
        part = self.scores.part(row, level)
        if metric in ("sr", "sr1") and isinstance(part, VariantScore):
            return part.samples.get(metric)
        found = self.estimate(metric, row, level)
        if found is None or part is None or self.scores.ci != "bootstrap":
            return found
        below = part.samples.get(metric)
        if isinstance(below, Sample):
            return below
        samples, weights = zip(*below, strict=True) if below else ((), ())
        return intervals.interval_of(samples, weights) if samples else found

    def samples(self, row: str, level: int) -> tuple[list[Sample], list[float]]:
        """Success counts of all variants below a row, and each one's share of its mean.

        Empty where the column has no value of the row.
        """
        part = self.scores.part(row, level)
        if not isinstance(part, AverageScore) or self.value("sr", row, level) is None:
            return [], []
        below = part.samples.get("sr", ())
        return [sample for sample, _ in below], [share for _, share in below]

    def with_missing(self, entry: TableCell, metric: str, row: str, level: int) -> TableCell:
        """`entry` with what it has to say of missing trials."""
        part = self.scores.part(row, level)
        if part is None or not part.missing:
            return entry
        ends = part.bounds(metric)
        bounds = None if ends is None else (100 * ends[0], 100 * ends[1])
        return replace(entry, sign=MISSING, missing=part.missing, bounds=bounds)

    @property
    def covers_benchmark(self) -> bool:
        """Whether it lists any of the benchmark's 56 tasks."""
        return any(task in load().tasks for task, _ in self.scores.cells)

    @property
    def covers_basic(self) -> bool:
        return any(cell.category in BASIC for cell in self.scores.cells.values())

    def not_run(self, level: int) -> int:
        """Tasks that the benchmark has and this column does not list at `level`."""
        return sum((task, level) not in self.scores.cells for task in load().tasks)


def cell_percent(cell: VariantScore | None, metric: str) -> float | None:
    """A variant's value in percent, from its counts where it has them."""
    estimate = None if cell is None else cell.values.get(metric)
    if cell is None or estimate is None:
        return None
    count = cell.count(metric) if metric in RATES else None
    if count is None:
        return 100 * estimate.value
    success = 100 * count / cell.trials
    return success if metric == RATES[metric] else onta_of_percent(success, cell.candidates)


def table_values(
    cells: Mapping[tuple[str, int], VariantScore], so_far: bool = False
) -> dict[str, dict[tuple[str, int], float | None]]:
    """Percent by metric and (task, category, dimension or overall; level).

    An average over a variant without a value is None, or if `so_far` that of the others.
    """
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
            found = {**tasks, **rounding.summary(tasks, _known(below, tasks) if so_far else below)}
            made[metric].update({(row, level): value for row, value in found.items()})
    return made


def _known(
    below: Mapping[str, Sequence[str]], tasks: Mapping[str, float | None]
) -> dict[str, list[str]]:
    """`below` without the tasks that have no value, and without categories that have no task."""
    found = {c: [t for t in names if tasks[t] is not None] for c, names in below.items()}
    return {category: names for category, names in found.items() if names}


def _untied(values: Mapping[str, dict[tuple[str, int], float | None]], model: str) -> Values:
    """`values` with ties decided as printed.

    Where an average of progress falls exactly between two printable values, binary noise in the
    means of c/T decided what was printed, so the printed one is taken.
    """
    printed = load().ps
    for row, by_model in printed.rows.items():
        for column, printed_value in zip(printed.columns, by_model[model], strict=True):
            value = values["ps"][row, int(column[1])]
            if value is not None and rounding.is_tie(value) and abs(value - printed_value) < 0.051:
                values["ps"][row, int(column[1])] = value + (
                    1e-6 if printed_value > value else -1e-6
                )
    return values


def idle_column(runs: Sequence[Column]) -> Column | None:
    """The progress of a policy that does nothing, on the scenes of that of `runs` which has most
    variants; None if none has progress."""
    best = max(runs, key=lambda run: len(run.scores.cells))
    cells = {
        variant: replace(
            cell,
            listed=cell.trials,
            values={"ps": cell.values[IDLE]},
            samples={"ps": cell.samples[IDLE]},
        )
        for variant, cell in best.scores.cells.items()
        if IDLE in cell.samples
    }
    results = replace(best.results, name="doing nothing", scores=Scores(cells, best.scores.ci))
    return Column(results, idle=True) if cells else None


def published_column(model: str, name: str = "") -> Column:
    """A published model as a column, called `name` or as the paper writes it."""
    results = published_results(model)
    return Column(replace(results, name=name) if name else results)


def run_column(run: Run, name: str = "") -> Column:
    """`run` as a column, called `name` or as its policy; see `column_of`."""
    return column_of(models.results_of_run(run, name or run.manifest.policy.name))


def column_of(results: models.ModelResults) -> Column:
    """A run's results as a column; IncomparableError if a column cannot hold them all."""
    data, column = load(), Column(results)
    where, variants = f"the run {column.title}", results.scores.cells
    if not variants:
        raise models.IncomparableError(f"{where} lists no trials; there is nothing to show")
    models.check_same([(where, results.setting)], models.TABLE)
    basic = {task for task, category in results.manifest.categories.items() if category in BASIC}
    unknown = sorted(
        f"{task} L{level}"
        for task, level in variants
        if not (level in LEVELS and (task in data.tasks or task in basic))
    )
    if unknown:
        raise models.IncomparableError(
            f"{where} has variants that the benchmark's tables do not know "
            f"({', '.join(unknown[:3])}{', ...' if len(unknown) > 3 else ''}); see `robospa tasks`"
        )
    return column


def check_worlds(columns: Sequence[Column]) -> None:
    """IncomparableError if runs of official worlds and of this benchmark's own suites are mixed."""
    runs = [column.results for column in columns if not column.published]
    official = [run for run in runs if models.in_official_world(run)]
    if 0 < len(official) < len(runs):
        ours = next(run for run in runs if not models.in_official_world(run))
        raise models.IncomparableError(
            f"{official[0].name} is of the suite {models.suite_of(official[0])} and stands beside "
            f"the paper, never beside {ours.name} of {models.suite_of(ours) or 'no stated suite'}: "
            "make a table of each"
        )


def check_columns(columns: Sequence[Column]) -> None:
    """IncomparableError unless all runs were measured on the same suite, embodiment, scenes and
    instructions, and published models beside them on the same embodiment and scenes."""
    models.check_alike([column.results for column in columns], models.TABLE)
    titles = [c.title for c in columns]
    twice = sorted({t for t in titles if titles.count(t) > 1})
    if twice:
        raise models.IncomparableError(
            f"two columns are called {twice[0]}; give one of them another name"
        )
    if not columns:
        raise models.IncomparableError("a table needs at least one published model or run")
