"""One side of a comparison: a run or a published model, as samples by variant.

A side that mixes embodiments, scene modes or instruction splits is refused, and so are two sides
that differ in them: their means would be of different things.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robospa.categories import BASIC, CATEGORIES, DIMENSIONS, PROCEDURAL, SPATIAL
from robospa.results.paper.published import load, title
from robospa.results.records.run_io import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.statistics.bootstrap import Sample, progress, rate

Variant = tuple[str, int]
COMPARED = {"sr": CATEGORIES + BASIC, "onta": SPATIAL, "ps": PROCEDURAL}
"""Metric -> the categories that have it."""


class CompareError(Exception):
    """The two sides cannot be compared; the message says why and what to do."""


@dataclass(frozen=True)
class Side:
    """One of the two. Published numbers have samples only; runs have the trials themselves.

    `setting` is (embodiment, scene mode, instruction split), an empty part matching anything;
    `step_scale` multiplied the step limits, None if that is not known.
    """

    name: str
    setting: tuple[str, str, str]
    category: Mapping[str, str]
    samples: Mapping[Variant, Sample]
    trials: Mapping[Variant, Mapping[int, TrialRecord]]
    listed: Mapping[Variant, int]
    versions: Mapping[str, str]
    seeded: bool = True
    step_scale: float | None = None


def side_of_run(run: Run, name: str = "", metric: str = "sr") -> Side:
    """`run` as one side; raises CompareError if it mixes settings or has no result."""
    label = name or run.folder.name
    settings = {(k.embodiment, k.mode, k.split) for k in run.keys}
    for part, what in enumerate(("embodiments", "scene modes", "instruction splits")):
        if len(mixed := sorted({s[part] for s in settings})) > 1:
            raise CompareError(
                f"{label} mixes the {what} {' and '.join(mixed)}, whose mean means nothing: "
                "run them apart"
            )
    category = dict(run.info.categories)
    trials: dict[Variant, dict[int, TrialRecord]] = {}
    listed: dict[Variant, int] = {}
    for key in run.keys:
        listed[key.variant] = listed.get(key.variant, 0) + 1
        record = run.records.get(key)
        if record is not None and finished(record):
            trials.setdefault(key.variant, {})[key.seed] = record
            category.setdefault(key.task, record.category)
    if not trials:
        raise CompareError(f"{label} holds no result yet: finish it with robospa eval --resume")
    samples = {}
    for v, found in trials.items():
        if category.get(v[0]) in COMPARED[metric]:
            samples[v] = sample_of(list(found.values()), metric, f"{label}, {v[0]} L{v[1]}")
    versions = {**run.info.versions, "code": run.info.code}
    seeded = run.info.seeded is not False
    scale = run.info.step_scale
    return Side(label, settings.pop(), category, samples, trials, listed, versions, seeded, scale)


def side_of_published(model: str, metric: str = "sr") -> Side:
    """The printed numbers of `model` as one side; only success rates can be compared exactly."""
    published = load()
    if model not in published.models:
        known = ", ".join(published.models)
        raise CompareError(f"no published model is called {model!r}; there are {known}")
    if metric == "ps":
        raise CompareError(
            "of published progress only the mean is known, without the trials: compare sr or onta"
        )
    samples, n = {}, published.trials
    for task, values in published.per_task[model, "sr"].rows.items():
        for level, value in enumerate(values, 1):
            info = published.tasks[task]
            if info.category in COMPARED[metric]:
                candidates = info.counts[level - 1] if metric == "onta" else 0
                samples[task, level] = rate(round(value * n / 100), n, candidates)
    category = {task: info.category for task, info in published.tasks.items()}
    setting = (published.embodiment, published.mode, "")
    listed = dict.fromkeys(samples, n)
    return Side(title(model), setting, category, samples, {}, listed, {})


def sample_of(records: Sequence[TrialRecord], metric: str, where: str) -> Sample:
    """The results of one variant by `metric`; `where` names it in errors."""
    if metric == "ps":
        return progress([(r.done, r.total) for r in records])
    candidates = 0
    if metric == "onta":
        if len(counts := {r.candidates for r in records}) > 1:
            raise CompareError(f"{where}: trials differ in their number of candidates: no ONTA")
        candidates = counts.pop()
    return rate(sum(r.success for r in records), len(records), candidates)


def common_seeds(first: Side, second: Side, variant: Variant) -> list[int]:
    """Seeds of `variant` that both have a result of, in the order of the first."""
    other = second.trials.get(variant, {})
    return [seed for seed in first.trials.get(variant, {}) if seed in other]


def extremes(side: Side, variants: Sequence[Variant]) -> tuple[float, float]:
    """Mean success rate or progress over `variants` if all that `side` lists and has no result of
    had achieved nothing, and if it had achieved everything."""
    low = high = 0.0
    for variant, share in zip(variants, weights_of(variants, side.category), strict=True):
        sample, listed = side.samples.get(variant), side.listed[variant]
        held = sample.value * sample.trials if sample is not None else 0.0
        missing = listed - (sample.trials if sample is not None else 0)
        low += share * held / listed
        high += share * (held + missing) / listed
    return low, high


def check_settings(first: Side, second: Side) -> None:
    """Raises CompareError if the two were asked different things."""
    for what, a, b in zip(
        ("embodiment", "scene mode", "instruction split"),
        first.setting,
        second.setting,
        strict=True,
    ):
        if a and b and a != b:
            raise CompareError(
                f"{first.name} ran with {what} {a} and {second.name} with {b}: "
                "they were asked different things and cannot be compared"
            )
    if None not in (first.step_scale, second.step_scale) and first.step_scale != second.step_scale:
        raise CompareError(
            f"{first.name} ran with {first.step_scale:g} times the official step limits and "
            f"{second.name} with {second.step_scale:g}: they had different chances and cannot be "
            "compared"
        )


def collections(category: Mapping[str, str]) -> list[tuple[str, str, tuple[str, ...]]]:
    """(label, kind, categories) of all that is averaged, present or not."""
    present = [c for c in CATEGORIES + BASIC if c in category.values()]
    found: list[tuple[str, str, tuple[str, ...]]] = [(c, "category", (c,)) for c in present]
    found += [(name, "dimension", members) for name, members in DIMENSIONS.items()]
    return [*found, ("overall", "overall", CATEGORIES)]


def weights_of(variants: Sequence[Variant], category: Mapping[str, str]) -> list[float]:
    """Categories count the same, in them tasks, in them levels."""
    tasks: dict[str, int] = {}
    for task, _ in variants:
        tasks[task] = tasks.get(task, 0) + 1
    sizes: dict[str, int] = {}
    for task in tasks:
        sizes[category[task]] = sizes.get(category[task], 0) + 1
    return [1 / (len(sizes) * sizes[category[t]] * tasks[t]) for t, _ in variants]
