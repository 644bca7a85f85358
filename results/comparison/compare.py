"""Two runs, or a run and published numbers, side by side: differences with intervals and tests.

Runs on equal seeds are paired: a trial of one is held against the same scene of the other, which
tells differences apart with far fewer trials. Published numbers and runs on other seeds are
compared as unrelated. Variants that only one side has are left out and counted; nothing is averaged
over them silently. Every difference has an interval, a p, and a q corrected for how many there are.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

from robospa.results.comparison.pairs import (
    VariantPair,
    banner_of,
    discordant,
    notes,
    paired_variants,
    worst_and_best,
)
from robospa.results.comparison.sample_size import MARGIN, judged
from robospa.results.paper.columns import published_results
from robospa.results.paper.rounding import shown
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import MARK, Run, by_setting, read_part, setting_name
from robospa.results.scoring.grounding import differences
from robospa.results.scoring.models import (
    FREE,
    IncomparableError,
    ModelResults,
    categories_of,
    one_policy,
    restricted,
    results_of_run,
)
from robospa.results.scoring.scores import Variant, weights_of
from robospa.results.statistics.intervals import (
    METHODS,
    Estimate,
    difference,
    interval_of,
    over_tasks,
    paired_mean,
)
from robospa.results.statistics.significance import (
    anytime_p,
    benjamini_hochberg,
    boschloo,
    mcnemar_mid_p,
    p_of_interval,
)
from robospa.results.tables import Table, TableCell, TableRow, estimate_cell
from robospa.text import counted
from robospa.trial import BASIC, CATEGORIES, DIMENSIONS, METRIC_NAMES


def collections(category: Mapping[str, str]) -> list[tuple[str, str, tuple[str, ...]]]:
    """(label, kind, categories) of all that is averaged, present or not."""
    present = [c for c in CATEGORIES + BASIC if c in category.values()]
    found: list[tuple[str, str, tuple[str, ...]]] = [(c, "category", (c,)) for c in present]
    found += [(name, "dimension", members) for name, members in DIMENSIONS.items()]
    return [*found, ("overall", "overall", CATEGORIES)]


@dataclass(frozen=True)
class Difference:
    """First minus second: of a variant, or the mean over `variants` of the `listed` variants.

    `level` 0 is the mean over levels. `only_first` and `only_second` count the pairs that one
    alone won, None where nothing is paired. `q` is p corrected for all of its kind. `over_tasks`
    is how the difference would move with other tasks, where there are several at one level.
    """

    label: str
    kind: str
    level: int
    variants: int
    listed: int
    trials: int
    first: float
    second: float
    estimate: Estimate
    p: float
    only_first: int | None = None
    only_second: int | None = None
    q: float = 1.0
    over_tasks: Estimate | None = None


@dataclass(frozen=True)
class RunComparison:
    """All differences of two sides; `notes` is what a reader has to know before using them, and
    `banner` is not empty where the two are of different suites."""

    first: str
    second: str
    metric: str
    paired: bool
    cells: tuple[Difference, ...]
    groups: tuple[Difference, ...]
    notes: tuple[str, ...]
    banner: str = ""
    margin: float = MARGIN
    outcome: str = ""
    """Of the first: better, worse, equal (within `margin`) or underpowered."""
    needed: int = 0
    """Trials that would show a difference of `margin` with a power of 80 %."""

    @property
    def verdict(self) -> str:
        """What came out, in one sentence; "" if nothing is common."""
        if not self.groups:
            return ""
        row = self.groups[-1]
        e = row.estimate
        first, second, gap, low, high = (
            shown(100 * x) for x in (row.first, row.second, e.value, e.low, e.high)
        )
        within = counted(100 * self.margin, "point")
        said = {
            "better": f"{self.first} is better",
            "worse": f"{self.first} is worse",
            "equal": f"they are equal within {within}",
        }.get(self.outcome, f"underpowered: {self.needed:,} would tell {within} apart")
        same = "the same" if self.paired else "as many"
        return (
            f"{METRIC_NAMES[self.metric]}: {self.first} {first:.1f}, {self.second} {second:.1f} "
            f"on {same} {counted(row.trials, 'trial')}; {said} "
            f"(difference {gap:+.1f}, 95 %: {low:+.1f} to {high:+.1f})."
        )

    def table(self, variants: bool = False) -> Table:
        """The averages, or all `variants`, as a table: `print` shows it as text, a notebook as
        HTML."""
        title = f"{METRIC_NAMES[self.metric]} of {self.first} minus {self.second}, points"
        return difference_table(self, self.cells if variants else self.groups, title)

    def _repr_html_(self) -> str:
        texts = (self.banner, self.verdict, *self.notes)
        said = "<br>".join(escape(text) for text in texts if text)
        return f"<p>{said}</p>\n{self.table()._repr_html_()}"


def compare_results(
    first: ModelResults,
    second: ModelResults,
    metric: str = "sr",
    method: str = "wilson",
    margin: float = MARGIN,
) -> RunComparison:
    """All differences `first - second`; IncomparableError if they are of different things."""
    pairs, paired = paired_variants(first, second, metric)
    if not pairs:
        raise IncomparableError(f"{first.name} and {second.name} have no variant in common")
    category = {**second.categories, **first.categories}
    listed = {
        v for v in {**first.listed, **second.listed} if category[v[0]] in categories_of(metric)
    }
    rows = [
        _group_row(pair.variant[0], "variant", pair.variant[1], [pair], 1, category, method)
        for pair in pairs
    ]
    runs = not first.published and not second.published
    groups = _groups(pairs, listed, category, method)
    now = chance(anytime_p([pair.gap for pair in pairs if pair.gap is not None]))
    always = f"If you look again and again while trials come in: p {now}, all pairs alike."
    return RunComparison(
        first.name,
        second.name,
        metric,
        paired,
        _corrected(rows),
        _corrected([g for g in groups if g.kind == "category"])
        + tuple(replace(g, q=g.p) for g in groups if g.kind != "category"),
        tuple(notes(first, second, [pair.variant for pair in pairs], listed, paired))
        + (always,) * paired
        + tuple(_by_first_choice(first, second, method) if runs and metric == "sr" else ())
        + (differences(first, second) if runs and metric == "sr" else ())
        + (tuple(worst_and_best(first, second, metric)) if metric not in ("onta", "onta1") else ()),
        banner_of(first, second),
        margin,
        *(judged(groups[-1].estimate, groups[-1].trials, margin) if groups else ("", 0)),
    )


def _by_first_choice(first: ModelResults, second: ModelResults, method: str) -> list[str]:
    """The whole difference of two runs in SR@1, as a note beside that in SR."""
    found = compare_results(first, second, "sr1", method).groups[-1:]
    return [
        f"By the first choice: SR@1 {estimate_cell(row.estimate, '+z.1f').text} over all, "
        f"p {chance(row.p)} (--metric sr1)."
        for row in found
        if row.label == "overall"
    ]


def over_levels(
    first: ModelResults, second: ModelResults, metric: str = "sr", method: str = "wilson"
) -> tuple[Difference, ...]:
    """The differences of single tasks, each the mean over the levels that both have."""
    category = {**second.categories, **first.categories}
    by_task: dict[str, list[VariantPair]] = {}
    for pair in paired_variants(first, second, metric)[0]:
        by_task.setdefault(pair.variant[0], []).append(pair)
    return _corrected(
        [
            _group_row(task, "task", 0, own, len(own), category, method)
            for task, own in by_task.items()
        ]
    )


def _estimate(pairs: Sequence[VariantPair], weights: Sequence[float], method: str) -> Estimate:
    gaps = [c.gap for c in pairs if c.gap is not None]
    if len(gaps) < len(pairs):
        a = interval_of([c.first for c in pairs], weights, method)
        return difference(a, interval_of([c.second for c in pairs], weights, method, seed=1))
    if method == "bootstrap":
        return interval_of(gaps, weights, method)
    return paired_mean(gaps, weights)


def _groups(
    pairs: Sequence[VariantPair], listed: set[Variant], category: Mapping[str, str], method: str
) -> list[Difference]:
    levels = sorted({pair.variant[1] for pair in pairs})
    found = []
    for label, kind, chosen in collections(category):
        for level in (*levels, 0):
            own = {v for v in listed if category.get(v[0]) in chosen and level in (0, v[1])}
            members = [pair for pair in pairs if pair.variant in own]
            if members:
                found.append(_group_row(label, kind, level, members, len(own), category, method))
    return found


def _group_row(
    label: str,
    kind: str,
    level: int,
    pairs: Sequence[VariantPair],
    listed: int,
    category: Mapping[str, str],
    method: str,
) -> Difference:
    weights = weights_of([c.variant for c in pairs], category)
    first = sum(w * c.first.value for w, c in zip(weights, pairs, strict=True))
    second = sum(w * c.second.value for w, c in zip(weights, pairs, strict=True))
    tested = METHODS[0] if method == "bootstrap" else method  # the bootstrap's can be a point
    estimate, honest = (_estimate(pairs, weights, m) for m in (method, tested))
    paired = pairs[0].gap is not None
    trials = sum(c.first.trials + (0 if paired else c.second.trials) for c in pairs)
    row = (label, kind, level, len(pairs), listed, trials, first, second, estimate)
    other = _over_tasks(pairs, category, honest) if level and len(pairs) > 1 else None
    rates = all(x.first.binary and x.second.binary for x in pairs)
    if not paired:
        exact = kind == "variant" and rates
        p = boschloo(pairs[0].first, pairs[0].second) if exact else p_of_interval(honest)
        return Difference(*row, p, over_tasks=other)
    b, c = discordant(pairs)
    # Inside a category every pair weighs the same, unless variants lack some; elsewhere only the
    # interval is fair.
    shares = {round(w / x.first.trials, 12) for w, x in zip(weights, pairs, strict=True)}
    pooled = kind in ("variant", "task", "category") and rates and len(shares) == 1
    p = mcnemar_mid_p(b, c) if pooled else p_of_interval(honest)
    return Difference(*row, p, b, c, over_tasks=other)


def _over_tasks(
    pairs: Sequence[VariantPair], category: Mapping[str, str], at_least: Estimate
) -> Estimate:
    """The same difference if tasks were drawn anew from what they were drawn from."""
    groups: dict[str, list[VariantPair]] = {}
    for pair in pairs:
        groups.setdefault(category[pair.variant[0]], []).append(pair)
    gaps = [[c.gap for c in group if c.gap is not None] for group in groups.values()]
    if all(gaps):
        return over_tasks(gaps, at_least=at_least)
    return over_tasks(
        [[c.first for c in group] for group in groups.values()],
        against=[[c.second for c in group] for group in groups.values()],
        at_least=at_least,
    )


def _corrected(rows: Sequence[Difference]) -> tuple[Difference, ...]:
    qs = benjamini_hochberg([row.p for row in rows])
    return tuple(replace(row, q=q) for row, q in zip(rows, qs, strict=True))


HEAD = 18
"""Letters of a side's name over a column."""


def difference_table(found: RunComparison, rows: Sequence[Difference], title: str) -> Table:
    """`rows` of the comparison `found`, in percentage points."""
    several = any(row.over_tasks for row in rows)
    # The ends of long names, which is where names of runs differ.
    names = [n if len(n) <= HEAD else "…" + n[1 - HEAD :] for n in (found.first, found.second)]
    names = names if names[0] != names[1] else ["first", "second"]
    heads = ("level", *names, "difference [95 %]", "p", "q", "trials")
    heads += ("other tasks",) * several
    heads += tuple(f"only {name}" for name in names) * found.paired
    made = tuple(_table_row(row, several, found.paired) for row in rows)
    return Table("differences", title, "", heads, made)


def _table_row(row: Difference, several: bool, paired: bool) -> TableRow:
    partly = f" ({row.variants} of {row.listed})" if row.variants < row.listed else ""
    cells = [
        f"L{row.level}" if row.level else "mean",
        *(f"{shown(100 * rate):.1f}" for rate in (row.first, row.second)),
        estimate_cell(row.estimate, "+z.1f").text,
        chance(row.p),
        chance(row.q) if row.kind in ("variant", "category") else "",
        str(row.trials),
    ]
    if several:
        o = row.over_tasks
        cells.append(f"[{shown(100 * o.low):+.1f}, {shown(100 * o.high):+.1f}]" if o else "")
    if paired:
        cells += [str(row.only_first), str(row.only_second)]
    return TableRow(f"{row.label}{partly}", tuple(map(TableCell, cells)))


def chance(p: float) -> str:
    """A p-value in a table."""
    return f"{p:.3f}" if p >= 0.0005 else "<.001"


AXES = {
    "embodiment": "robots",
    "mode": "scene modes",
    "split": "instruction splits",
    "clock": "clocks",
}
"""What the parts of a setting are called in the title."""


def by_axis(models: Sequence[ModelResults], metric: str = "sr") -> Table | None:
    """The table of runs that differ in robot, scene mode, split or clock; None if these are none.

    Rows are categories, dimensions and the whole, over all variants that every run has results of,
    and if these share seeds, over the trials on seeds that every run has results of.
    """
    axes = [part for part in FREE if len({getattr(m.setting, part) for m in models}) > 1]
    if len(models) < 2 or not axes or not one_policy(models):
        return None
    shared = [v for v in models[0].samples(metric) if all(v in m.trials for m in models)]
    if not shared:
        return None
    seeds = {v: set.intersection(*(set(m.trials[v]) for m in models)) for v in shared}
    alone = sum(len(m.trials[v]) - len(seeds[v]) for m in models for v in shared)
    if paired := all(seeds.values()):
        models = [
            replace(m, trials={v: {n: m.trials[v][n] for n in seeds[v]} for v in shared})
            for m in (restricted(model, shared) for model in models)
        ]
    names = [" ".join(value for part in axes for value in getattr(m.setting, part)) for m in models]
    pairs = [
        {pair.variant: pair for pair in paired_variants(model, models[0], metric)[0]}
        for model in models[1:]
    ]
    sides = [{v: pair.second for v, pair in pairs[0].items()}]
    sides += [{v: pair.first for v, pair in found.items()} for found in pairs]
    category = {name: c for model in models for name, c in model.categories.items()}
    rows = []
    for label, kind, chosen in collections(category):
        variants = [v for v in shared if category[v[0]] in chosen]
        if variants:
            weights = weights_of(variants, category)
            own = [interval_of([side[v] for v in variants], weights) for side in sides]
            gaps = [_estimate([found[v] for v in variants], weights, METHODS[0]) for found in pairs]
            cells = (*map(estimate_cell, own), *(estimate_cell(gap, "+z.1f") for gap in gaps))
            rows.append(TableRow(label, cells, "row" if kind == "category" else "average"))
    how = "paired by seed" if paired else "not paired: some variants share no seed"
    if paired and alone:
        how += f"; {counted(alone, 'trial')} on seeds that not all have results of: left out"
    note = (
        f"In percent, over the {len(shared)} variants that all have results of, with 95 % "
        f"intervals; differences in percentage points, {how}."
    )
    return Table(
        f"{metric}-by-{'-'.join(axes)}",
        f"{METRIC_NAMES[metric]} by {' and '.join(AXES[part] for part in axes)}",
        "",
        (*names, *(f"{name} minus {names[0]}" for name in names[1:])),
        tuple(rows),
        notes=(note,),
    )


Side = Run | str | Path
"""A run, its folder (`FOLDER@ROBOT` for a part of it), or the name of a published model."""


def compare(
    first: Side, second: Side, metric: str = "sr", ci: str = "wilson", margin: float = MARGIN
) -> RunComparison:
    """All differences `first - second`, with intervals and tests; paired where seeds are equal.

        found = robospa.compare("runs/mine", "runs/before")
        print(found.table())

    Args:
        first: A run, its folder, `FOLDER@ROBOT` for one robot of it, or a published model's name.
        second: What it is compared with.
        metric: "sr", "sr1", "onta", "onta1" or "ps".
        ci: How intervals of single rates are made: "wilson", "exact" or "bootstrap".
        margin: Differences within it, a share, count as equal.

    Raises:
        RunError: A folder holds no run, or one of several robots.
        ValueError: Nothing goes by a name; IncomparableError if the sides are of different things.
    """
    return compare_results(*both_sides(first, second), metric, ci, margin)


def both_sides(first: Side, second: Side) -> tuple[ModelResults, ModelResults]:
    """The results of both sides, under different names; raises what `compare` raises."""
    one, two = results_of(first), results_of(second)
    if one.name == two.name:
        names = [str(x.folder) if isinstance(x, Run) else str(x) for x in (first, second)]
        one, two = replace(one, name=names[0]), replace(two, name=names[1])
    return one, two


def results_of(side: Side) -> ModelResults:
    """The results of one side; raises what `compare` raises."""
    if isinstance(side, Run):
        parts = by_setting(side)
        if len(parts) > 1:
            names = "; ".join(map(setting_name, parts))
            raise RunError(f"{side.folder} holds trials of {names}: name one as FOLDER{MARK}ROBOT")
        return results_of_run(side)
    name = str(side)
    if Path(name).exists() or Path(name.rpartition(MARK)[0] or name).is_dir():
        return results_of_run(read_part(name), name.rpartition("/")[2] if MARK in name else "")
    try:
        return published_results(name)
    except ValueError as error:
        raise ValueError(f"there is no folder {name}, and {error}") from None
