"""What each axis costs: the trials of a run under an axis against its clean ones on the same seeds.

A *cost* is the paired difference of success, over all trials, with Tango's interval and McNemar's
p; Holm's correction keeps the chance of any false alarm in a table at 5 %. Where the sentence was
changed on purpose, what counts is which object was taken. `docs/profile.md` has the axes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest

from robospa.results.comparison.compare import chance
from robospa.results.failures.attribution import roles_of
from robospa.results.paper.rounding import shown
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import PROCESSOR, TrialRecord
from robospa.results.scoring.grounding import Grounding, Tally, choices_of, summed, tally_of
from robospa.results.scoring.scores import succeeded
from robospa.results.statistics.intervals import Estimate, paired_difference
from robospa.results.statistics.significance import ALPHA, holm, mcnemar_mid_p
from robospa.results.tables import (
    DASH,
    PRINTED_OTHERWISE,
    ShownAsTables,
    Table,
    TableCell,
    TableRow,
    estimate_cell,
)
from robospa.trial import CATEGORY_NAMES, METRIC_NAMES, PROCEDURAL

CLEAN, PARTS = "clean", "randomized:"
NO_COST = ("other-scene", "no-sentence", "nothing-here")
"""Axes under which a policy that reads does not succeed."""
MOST_SHOWN = 3
"""Pairs of an axis that are shown as films."""
Pair = tuple[TrialRecord, TrialRecord]
"""A trial in the clean scene, and on the same seed under an axis."""
BY: Mapping[str, Callable[[TrialRecord], str]] = {
    "all": lambda record: "",
    "category": lambda record: record.category,
    "level": lambda record: f"L{record.key.level}",
    "task": lambda record: record.key.task,
}
"""What costs may be told by."""


@dataclass(frozen=True)
class Cost:
    """What `axis` costs in `place`, "" for all of them: rates of success in clean scenes and under
    it, and their paired difference, whose p is corrected over its table (`holm`).

    `lost` pairs succeeded in the clean scene alone, `won` under the axis alone. `grounding` is of
    what was chosen under the axis, `seconds` the mean processor time of its trials.
    """

    axis: str
    place: str
    trials: int
    clean: float
    here: float
    difference: Estimate
    lost: int
    won: int
    p: float
    grounding: Grounding
    seconds: float
    holm: float = 1.0

    @property
    def found(self) -> bool:
        """Whether the axis is shown to change success."""
        return self.holm < ALPHA

    @property
    def row(self) -> TableRow:
        """As it stands in the table."""
        rates = [
            TableCell(f"{shown(100 * rate):.1f}", 100 * rate) for rate in (self.clean, self.here)
        ]
        tests = [DASH.text if self.axis in NO_COST else chance(p) for p in (self.p, self.holm)]
        gap = estimate_cell(self.difference, "+z.1f", PRINTED_OTHERWISE * self.found)
        texts = map(TableCell, (*tests, f"{self.lost}/{self.won}"))
        return TableRow(self.axis, (*rates, gap, *texts, *_hands(self.grounding, self.seconds)))


@dataclass(frozen=True)
class Reading:
    """What was taken when the sentence had been changed: of `trials`, and where something was, how
    often what the trial `asked` for (None where that is nothing), and how often what the sentence
    of the clean scene asks for; both 0 for guessing."""

    axis: str
    trials: int
    taken: Estimate
    asked: Estimate | None
    before: Estimate | None

    @property
    def row(self) -> TableRow:
        """As it stands in the table."""
        shares = map(estimate_cell, (self.taken, self.asked, self.before))
        return TableRow(self.axis, (*shares, _count(self.trials)))


@dataclass(frozen=True)
class Profile(ShownAsTables):
    """The costs of all axes of a run by `metric`, in the run's order; `print` shows the tables.
    `control` is what was chosen in clean scenes, `seconds` their processor time, by place."""

    metric: str
    control: Mapping[str, Grounding]
    seconds: Mapping[str, float]
    costs: tuple[Cost, ...]
    readings: tuple[Reading, ...]
    missing: int = 0

    @property
    def tables(self) -> list[Table]:
        """Costs in percentage points, and what was taken if sentences had been changed."""
        rows = []
        for place, own in self.control.items():
            rows += [TableRow(CATEGORY_NAMES.get(place, place), kind="section")] * bool(place)
            rows.append(TableRow(CLEAN, (DASH,) * 6 + _hands(own, self.seconds[place]), "average"))
            rows += [cost.row for cost in self.costs if cost.place == place]
        lost = [f"{self.missing} trials have no result: left out."] * bool(self.missing)
        title = f"What each axis costs: {METRIC_NAMES[self.metric]} on equal seeds"
        made = [Table("profile", title, "axis", HEADS, tuple(rows), notes=(NOTE, *lost))]
        title, notes = "Does it read? What was taken, in percent", (READING_NOTE,)
        if taken := tuple(reading.row for reading in self.readings):
            made.append(Table("reading", title, "sentence", READ, taken, notes=notes))
        return made

    def to_json(self) -> dict[str, object]:
        """Plain JSON values; rates are fractions."""
        return asdict(self)


HEADS = ("clean", "here", "difference [95 %]", "p", "Holm", "lost/won", "grounding", "execution",
         "processor [s]", "trials")  # fmt: skip
READ = ("took something", "what is asked for", "what the clean sentence asks", "trials")
NOTE = (
    "Difference: under the axis minus clean, paired by seed; Holm: p corrected over this table, * "
    f"below {ALPHA:g}. Lost and won: pairs that succeeded in the clean scene alone, and under the "
    "axis alone. Grounding and execution: right choices, 0 for guessing, and how many of them were "
    "carried out. Processor: time of a trial, the policy's own in its process left out."
)
READING_NOTE = (
    "Spatial and basic tasks. Where something was taken, how often it was what the trial asks for, "
    "and what the sentence of the clean scene asks for; 0 is guessing. Who reads follows the first "
    "under other-target, is at 0 without a sentence, and takes nothing that is not there."
)


def _hands(found: Grounding, seconds: float) -> tuple[TableCell, ...]:
    shares = estimate_cell(found.accuracy), estimate_cell(found.execution)
    return *shares, TableCell(f"{seconds:.2f}", seconds), _count(found.trials)


def _count(number: int) -> TableCell:
    return TableCell(str(number), number)


def pairs_of(run: Run) -> tuple[list[TrialRecord], dict[str, list[Pair]]]:
    """The clean trials of `run` that have a result, and by axis the pairs that have two.

    Raises RunError if there is nothing to hold against the clean trials.
    """
    modes = dict.fromkeys(key.mode for key in run.keys)
    if CLEAN not in modes or len(modes) < 2:
        raise RunError(
            f"{run.folder} has no trials of an axis beside clean ones: run it with --profile"
        )
    results = {key: record for key, record in run.records.items() if finished(record)}
    clean = [record for key, record in results.items() if key.mode == CLEAN]
    del modes[CLEAN]
    return clean, {
        mode.removeprefix(PARTS): [
            (r, other) for r in clean if (other := results.get(replace(r.key, mode=mode)))
        ]
        for mode in modes
    }


def flipped(run: Run) -> list[tuple[str, Pair]]:
    """Pairs of which one trial alone succeeded, with their axis: at most MOST_SHOWN of each, lost
    and won in turn. Axes under which nothing that reads succeeds have none."""
    found = []
    for axis, pairs in pairs_of(run)[1].items():
        lost, won = (
            [p for p in pairs if succeeded(p[n], "sr1") and not succeeded(p[1 - n], "sr1")]
            for n in (0, 1)
        )
        mixed = [pair for turn in zip_longest(lost, won) for pair in turn if pair is not None]
        found += [(axis, pair) for pair in mixed[:MOST_SHOWN] if axis not in NO_COST]
    return found


def profile_of(run: Run, metric: str = "sr1", by: str = "all") -> Profile:
    """The profile of a run that has clean trials and, on their seeds, others. `by`: "all",
    "category", "level" or "task".

    Raises RunError if there is nothing to hold against the clean trials, ValueError for `by`.
    """
    if by not in BY:
        raise ValueError(f"costs are told by {', '.join(BY)}, not by {by!r}")
    clean, pairs = pairs_of(run)
    places = list(dict.fromkeys(map(BY[by], clean)))
    costs = [
        _cost(axis, place, members, metric)
        for axis, found in pairs.items()
        for place in places
        if (members := [pair for pair in found if BY[by](pair[0]) == place])
    ]
    corrected = iter(holm([cost.p for cost in costs if cost.axis not in NO_COST]))
    return Profile(
        metric,
        {p: summed([tally_of(r) for r in clean if BY[by](r) == p]) for p in places},
        {p: _seconds([r for r in clean if BY[by](r) == p]) for p in places},
        tuple(c if c.axis in NO_COST else replace(c, holm=next(corrected)) for c in costs),
        tuple(_readings(clean, pairs)),
        len(run.without_result),
    )


def _seconds(records: Sequence[TrialRecord]) -> float:
    """Mean processor time [s] of a trial."""
    return sum(record.timing.get(PROCESSOR, 0.0) for record in records) / len(records)


def _cost(axis: str, place: str, pairs: Sequence[Pair], metric: str) -> Cost:
    outcomes = [(succeeded(a, metric), succeeded(b, metric)) for a, b in pairs]
    lost, won = outcomes.count((True, False)), outcomes.count((False, True))
    clean, here = (sum(side) / len(pairs) for side in zip(*outcomes, strict=True))
    gap, p = paired_difference(won, lost, len(pairs)), mcnemar_mid_p(won, lost)
    chosen = summed([tally_of(record) for _, record in pairs])
    seconds = _seconds([record for _, record in pairs])
    return Cost(axis, place, len(pairs), clean, here, gap, lost, won, p, chosen, seconds)


def _readings(
    clean: Iterable[TrialRecord], pairs: Mapping[str, Sequence[Pair]]
) -> Iterable[Reading]:
    """How sentences that were changed on purpose were followed, after the clean ones."""
    arms = {axis: pairs[axis] for axis in ("other-target", *NO_COST) if axis in pairs}
    for axis, found in ({CLEAN: [(r, r) for r in clean]} | arms if arms else {}).items():
        spatial = [pair for pair in found if pair[0].category not in PROCEDURAL]
        if spatial:
            asked = summed([tally_of(record) for _, record in spatial])
            before = summed([_as_before(*pair) for pair in spatial])
            none = asked.no_choice
            assert none is not None, "a spatial trial is due one choice"
            taken = Estimate(1 - none.value, 1 - none.high, 1 - none.low, none.method)
            right = None if axis in NO_COST else asked.accuracy
            yield Reading(axis, len(spatial), taken, right, before.accuracy)


def _as_before(clean: TrialRecord, record: TrialRecord) -> Tally:
    """The choice of `record` as if the sentence of the `clean` trial had been its own."""
    right = sum(bool(roles_of(clean).get(choice.object)) for choice in choices_of(record))
    return tally_of(record)._replace(right=right, done=0)
