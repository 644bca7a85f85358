"""Success against latency: one policy at several declared latencies, paired by seed.

The same trials at every latency, so a point is held against the first one pair by pair. The
latency at which half of the success is gone is where the line between the points first falls to
half of what it is at the lowest latency; its interval comes from drawing the seeds of every
variant anew, for all latencies together.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.results.comparison.pairs import check_comparable, paired_variants
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.models import IncomparableError, ModelResults, results_of_records
from robospa.results.scoring.scores import Variant, weights_of
from robospa.results.statistics.intervals import LEVEL, Estimate, interval_of, paired_mean
from robospa.results.statistics.significance import p_of_interval
from robospa.results.tables import Table, TableCell, TableRow, estimate_cell

ENTRY = "real_time"
"""What records keep of real time, in their diagnostics."""
RESAMPLES = 2000
SEED = 20_261_123


@dataclass(frozen=True)
class LatencyPoint:
    """One latency [ms]: success rate, difference to the lowest latency with its p (None at the
    lowest), and means over trials: shares of periods held and of actions blind, share of trials
    whose time was over, and jerks [rad/s^3] over seams and elsewhere (None without any)."""

    latency: float
    success: Estimate
    gap: Estimate | None
    p: float | None
    held: float
    blind: float
    timed_out: float
    seam_jerk: float | None
    other_jerk: float | None


@dataclass(frozen=True)
class LatencyCurve:
    """`half`: the latency [ms] at which half of the success is gone, infinite if it is beyond the
    last point; None where there is no success to lose."""

    policy: str
    clock: str
    trials: int
    points: tuple[LatencyPoint, ...]
    half: Estimate | None

    def to_json(self) -> dict[str, object]:
        """Plain JSON values; an end of `half` that is beyond the last point is None."""
        data = asdict(self)
        if self.half is not None:
            data["half"] |= {
                name: value if math.isfinite(value := getattr(self.half, name)) else None
                for name in ("value", "low", "high")
            }
        return {**data, "half_text": self.half_text}

    @property
    def half_text(self) -> str:
        """`half` in words."""
        if self.half is None:
            return "there is no success to lose"
        last = self.points[-1].latency
        ends = (self.half.value, self.half.low, self.half.high)
        value, low, high = (f"{v:.0f}" if math.isfinite(v) else f"> {last:g}" for v in ends)
        return f"half of the success is gone at {value} ms [{low}, {high}]"


def latency_curve(models: Sequence[ModelResults]) -> LatencyCurve:
    """The curve of runs of one policy that differ in a constant latency alone.

    Raises IncomparableError for others, and for runs that share no seeds.
    """
    if len(models) < 2:
        raise IncomparableError("a curve needs runs at two latencies or more")
    for model in models:
        if model.manifest.latency_ms is None:
            raise IncomparableError(
                f"{model.name} has no constant latency: run it with --clock real:200ms, say"
            )
    models = sorted(models, key=lambda model: model.manifest.latency_ms or 0.0)
    latencies = [model.manifest.latency_ms or 0.0 for model in models]
    policies = {model.manifest.policy.name for model in models}
    rules = {model.manifest.clock.partition(" ")[2] for model in models}
    if len(policies) > 1 or len(rules) > 1 or len(set(latencies)) < len(latencies):
        raise IncomparableError(
            "a curve is of one policy and one way to switch between chunks, with one run a latency"
        )
    for model in models[1:]:
        check_comparable(models[0], model)
    shared = {
        v: sorted(set.intersection(*(set(model.trials.get(v, ())) for model in models)))
        for v in models[0].trials
    }
    seeds = {variant: found for variant, found in shared.items() if found}
    if not seeds:
        raise IncomparableError("these runs share no seed: run them on the same ones")
    models = [_cut(model, seeds) for model in models]
    first, variants = models[0], list(seeds)
    weights = weights_of(variants, first.categories)
    outcomes = [
        np.array([[m.trials[v][seed].success for seed in seeds[v]] for m in models])
        for v in variants
    ]
    points = tuple(
        _point(model, first, latency, variants, weights, outcomes, row)
        for row, (model, latency) in enumerate(zip(models, latencies, strict=True))
    )
    return LatencyCurve(
        first.manifest.policy.name,
        next(iter(rules)) or "wait",
        sum(map(len, seeds.values())),
        points,
        _half(np.array(latencies), outcomes, weights),
    )


def _cut(model: ModelResults, seeds: Mapping[Variant, Sequence[int]]) -> ModelResults:
    """`model` as if only these trials had been run."""
    known = [model.trials[v][seed] for v, found in seeds.items() for seed in found]
    records = {record.key: record for record in known}
    return results_of_records(model.name, [*records], records, model.manifest)


def _point(
    model: ModelResults,
    first: ModelResults,
    latency: float,
    variants: Sequence[Variant],
    weights: Sequence[float],
    outcomes: Sequence[NDArray[np.bool_]],
    row: int,
) -> LatencyPoint:
    samples = model.samples("sr")
    gap = p = None
    if row:
        pairs = {pair.variant: pair for pair in paired_variants(model, first, "sr")[0]}
        gaps = [found.gap for v in variants if (found := pairs[v]).gap is not None]
        gap = paired_mean(gaps, weights)
        p = p_of_interval(gap)
    records = [record for v in variants for record in model.trials[v].values()]
    return LatencyPoint(
        latency,
        interval_of([samples[v] for v in variants], weights),
        gap,
        p,
        _share(records, "held"),
        _share(records, "blind"),
        sum(record.end == "time_limit" for record in records) / len(records),
        _mean(records, "seam_jerk"),
        _mean(records, "other_jerk"),
    )


def _numbers(records: Sequence[TrialRecord], name: str) -> list[float]:
    told = [record.diagnostics.get(ENTRY) for record in records]
    values = [found.get(name) for found in told if isinstance(found, dict)]
    return [float(v) for v in values if isinstance(v, (int, float))]


def _share(records: Sequence[TrialRecord], name: str) -> float:
    total = sum(_numbers(records, "periods"))
    return sum(_numbers(records, name)) / total if total else 0.0


def _mean(records: Sequence[TrialRecord], name: str) -> float | None:
    values = _numbers(records, name)
    return sum(values) / len(values) if values else None


def crossing(latencies: NDArray[np.float64], rates: NDArray[np.float64]) -> float:
    """Where the line through (latency, rate) first falls to half of its first rate: infinite if it
    does not, not a number if the first rate is 0."""
    half = rates[0] / 2.0
    if rates[0] <= 0.0:
        return math.nan
    below = np.flatnonzero(rates <= half)
    if not len(below):
        return math.inf
    i = int(below[0])
    share = (rates[i - 1] - half) / (rates[i - 1] - rates[i])
    return float(latencies[i - 1] + share * (latencies[i] - latencies[i - 1]))


def _half(
    latencies: NDArray[np.float64],
    outcomes: Sequence[NDArray[np.bool_]],
    weights: Sequence[float],
) -> Estimate | None:
    rates = sum(w * one.mean(axis=1) for w, one in zip(weights, outcomes, strict=True))
    value = crossing(latencies, np.asarray(rates))
    if math.isnan(value):
        return None
    rng = np.random.default_rng(SEED)
    drawn = np.zeros((len(latencies), RESAMPLES))
    for weight, one in zip(weights, outcomes, strict=True):
        chosen = rng.integers(0, one.shape[1], (RESAMPLES, one.shape[1]))
        drawn += weight * one[:, chosen].mean(axis=2)
    found = np.array([crossing(latencies, column) for column in drawn.T])
    tail = 50.0 * (1.0 - LEVEL)
    ends = np.percentile(found[~np.isnan(found)], [tail, 100.0 - tail], method="inverted_cdf")
    return Estimate(value, float(ends[0]), float(ends[1]), f"bootstrap, {RESAMPLES} resamples")


def curve_table(curve: LatencyCurve) -> Table:
    """The curve as a table."""
    first = f"minus {curve.points[0].latency:g} ms"
    heads = ("SR [95 %]", first, "p", "held", "blind", "time over", "seam jerk", "other jerk")
    rows = [TableRow(f"{p.latency:g} ms", _cells(p)) for p in curve.points]
    return Table(
        "success-latency",
        f"{curve.policy}: success against latency, switching {curve.clock}",
        "Latency",
        heads,
        tuple(rows),
        notes=(
            f"{curve.half_text[0].upper()}{curve.half_text[1:]}.",
            f"{curve.trials} trials at each latency, paired by seed; rates and differences in "
            "percent, with 95 % intervals. Held: share of periods without an action left; blind: "
            "with one executed while an answer was under way; time over: share of trials; jerks in "
            "rad/s^3, means over trials.",
        ),
    )


def _cells(point: LatencyPoint) -> tuple[TableCell, ...]:
    gap = TableCell() if point.gap is None else estimate_cell(point.gap, "+z.1f")
    p = TableCell() if point.p is None else TableCell(f"{point.p:.2g}", point.p)
    shares = [TableCell(f"{100 * v:.1f}", 100 * v) for v in (point.held, point.blind)]
    over = TableCell(f"{100 * point.timed_out:.1f}", 100 * point.timed_out)
    jerks = [
        TableCell() if v is None else TableCell(f"{v:.0f}", v)
        for v in (point.seam_jerk, point.other_jerk)
    ]
    return (estimate_cell(point.success), gap, p, *shares, over, *jerks)
