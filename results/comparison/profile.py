"""What each axis costs: the trials of a run under an axis against its clean ones on the same seeds.

A *cost* is the paired difference of success under an axis, over all trials, with Tango's interval
and McNemar's p; Holm's correction over a table keeps the chance of any false alarm in it at 5 %.
Where the sentence was changed on purpose, what counts is which object was taken: with another
target the right one is that, without a sentence guessing is right, and of a thing that is not
there nothing is to be taken. `docs/profile.md` has the axes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from robospa.results.failures.attribution import roles_of
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.grounding import Grounding, Tally, choices_of, summed, tally_of
from robospa.results.scoring.scores import succeeded
from robospa.results.statistics.intervals import Estimate, paired_difference
from robospa.results.statistics.significance import ALPHA, holm, mcnemar_mid_p
from robospa.results.tables import (
    DASH,
    PRINTED_OTHERWISE,
    Table,
    TableCell,
    TableRow,
    estimate_cell,
)
from robospa.trial import CATEGORY_NAMES, METRIC_NAMES, PROCEDURAL, TrialKey

CLEAN, PARTS = "clean", "randomized:"
NO_COST = ("no-sentence", "nothing-here")
"""Axes under which a policy that reads does not succeed."""
Pair = tuple[TrialRecord, TrialRecord]
"""A trial in the clean scene, and on the same seed under an axis."""
BY: Mapping[str, Callable[[TrialKey, str], str]] = {
    "all": lambda key, category: "",
    "category": lambda key, category: category,
    "level": lambda key, category: f"L{key.level}",
    "task": lambda key, category: key.task,
}
"""What costs may be told by."""


@dataclass(frozen=True)
class Cost:
    """What `axis` costs in `place`, "" for all of them: rates of success in clean scenes and under
    it, and their paired difference, whose p is corrected over its table (`holm`).

    `lost` pairs succeeded in the clean scene alone, `won` under the axis alone. `grounding` is of
    what was chosen under the axis.
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
    holm: float = 1.0

    @property
    def found(self) -> bool:
        """Whether the axis is shown to change success."""
        return self.holm < ALPHA


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


@dataclass(frozen=True)
class Profile:
    """The costs of all axes of a run by `metric`, in the run's order; `print` shows the tables."""

    metric: str
    by: str
    control: Mapping[str, Grounding]
    """What was chosen in clean scenes, by place."""
    costs: tuple[Cost, ...]
    readings: tuple[Reading, ...]
    missing: int = 0

    def table(self) -> Table:
        """Costs in percentage points."""
        rows = []
        places = dict.fromkeys(cost.place for cost in self.costs)
        for place in sorted(places):
            listed = [cost for cost in self.costs if cost.place == place]
            rows += [TableRow(CATEGORY_NAMES.get(place, place), kind="section")] * bool(place)
            own = self.control[place]
            cells = (DASH,) * 6 + (*_hands(own), TableCell(str(own.trials)))
            rows.append(TableRow(CLEAN, cells, "average"))
            rows += [_row(cost) for cost in listed]
        heads = ("clean", "here", "difference [95 %]", "p", "Holm", "lost/won", *HANDS)
        notes = [NOTE] + [f"{self.missing} trials have no result: left out."] * bool(self.missing)
        title = f"What each axis costs: {METRIC_NAMES[self.metric]} on equal seeds"
        return Table("profile", title, "axis", heads, tuple(rows), notes=tuple(notes))

    def reading_table(self) -> Table | None:
        """What was taken when sentences had been changed; None where none were."""
        if not self.readings:
            return None
        rows = [
            TableRow(
                r.axis,
                (*map(estimate_cell, (r.taken, r.asked, r.before)), TableCell(str(r.trials))),
            )
            for r in self.readings
        ]
        heads = ("took something", "what is asked for", "what the clean sentence asks", "trials")
        title = "Does it read? What was taken, in percent"
        return Table("reading", title, "sentence", heads, tuple(rows), notes=(READING_NOTE,))

    @property
    def tables(self) -> list[Table]:
        """Both."""
        return [table for table in (self.table(), self.reading_table()) if table is not None]

    def to_json(self) -> dict[str, object]:
        """Plain JSON values; rates are fractions."""
        return asdict(self)

    def __str__(self) -> str:
        return "\n\n".join(map(str, self.tables))

    def _repr_html_(self) -> str:
        return "\n".join(table._repr_html_() for table in self.tables)


HANDS = ("grounding", "execution", "trials")
NOTE = (
    "Difference: under the axis minus clean, paired by seed; Holm: p corrected over this table, * "
    f"below {ALPHA:g}. Lost and won: pairs that succeeded in the clean scene alone, and under the "
    "axis alone. Grounding and execution: right choices, 0 for guessing, and how many of them were "
    "carried out."
)
READING_NOTE = (
    "Spatial and basic tasks. Where something was taken, how often it was what the trial asks for, "
    "and what the sentence of the clean scene asks for; 0 is guessing. Who reads follows the first "
    "under other-target, is at 0 without a sentence, and takes nothing that is not there."
)


def _row(cost: Cost) -> TableRow:
    rates = [TableCell(f"{100 * rate:.1f}", 100 * rate) for rate in (cost.clean, cost.here)]
    sign = PRINTED_OTHERWISE * cost.found
    tests = ["–", "–"] if cost.axis in NO_COST else [_chance(cost.p), _chance(cost.holm)]
    cells = (*rates, estimate_cell(cost.difference, "+z.1f", sign), *map(TableCell, tests))
    flips = TableCell(f"{cost.lost}/{cost.won}")
    return TableRow(
        cost.axis, (*cells, flips, *_hands(cost.grounding), TableCell(str(cost.trials)))
    )


def _hands(found: Grounding) -> list[TableCell]:
    return [estimate_cell(found.accuracy), estimate_cell(found.execution)]


def _chance(p: float) -> str:
    return f"{p:.3f}" if p >= 0.0005 else "<.001"


def profile_of(run: Run, metric: str = "sr1", by: str = "all") -> Profile:
    """The profile of a run that has clean trials and, on their seeds, others. `by`: "all",
    "category", "level" or "task".

    Raises RunError if there is nothing to hold against the clean trials, ValueError for `by`.
    """
    if by not in BY:
        raise ValueError(f"costs are told by {', '.join(BY)}, not by {by!r}")
    modes = list(dict.fromkeys(key.mode for key in run.keys))
    if CLEAN not in modes or len(modes) < 2:
        raise RunError(
            f"{run.folder} has no trials of an axis beside clean ones: run it with --profile"
        )
    clean = {_place(k): r for k, r in run.records.items() if k.mode == CLEAN and finished(r)}
    pairs: dict[str, list[Pair]] = {mode: [] for mode in modes if mode != CLEAN}
    for key, record in run.records.items():
        before = clean.get(_place(key))
        if key.mode != CLEAN and before is not None and finished(record):
            pairs[key.mode].append((before, record))
    costs = [
        cost
        for mode, found in pairs.items()
        for place, members in _grouped(found, by).items()
        for cost in [_cost(mode.removeprefix(PARTS), place, members, metric)]
    ]
    tested = [cost for cost in costs if cost.axis not in NO_COST]
    chances = iter(holm([cost.p for cost in tested]))
    costs = [cost if cost.axis in NO_COST else replace(cost, holm=next(chances)) for cost in costs]
    control: dict[str, list[Tally]] = {}
    for record in clean.values():
        control.setdefault(BY[by](record.key, record.category), []).append(tally_of(record))
    return Profile(
        metric,
        by,
        {place: summed(found) for place, found in control.items()},
        tuple(costs),
        tuple(_readings(clean.values(), pairs)),
        sum(not finished(run.records.get(key)) for key in run.keys),
    )


def _place(key: TrialKey) -> tuple[object, ...]:
    return key.task, key.level, key.seed, key.embodiment, key.split


def _grouped(pairs: Sequence[Pair], by: str) -> dict[str, list[Pair]]:
    found: dict[str, list[Pair]] = {}
    for pair in pairs:
        found.setdefault(BY[by](pair[0].key, pair[0].category), []).append(pair)
    return found


def _cost(axis: str, place: str, pairs: Sequence[Pair], metric: str) -> Cost:
    outcomes = [(succeeded(a, metric), succeeded(b, metric)) for a, b in pairs]
    lost, won = outcomes.count((True, False)), outcomes.count((False, True))
    clean, here = (sum(side) / len(pairs) for side in zip(*outcomes, strict=True))
    gap, p = paired_difference(won, lost, len(pairs)), mcnemar_mid_p(won, lost)
    chosen = summed([tally_of(record) for _, record in pairs])
    return Cost(axis, place, len(pairs), clean, here, gap, lost, won, p, chosen)


def _readings(clean: Iterable[TrialRecord], pairs: Mapping[str, Sequence[Pair]]) -> list[Reading]:
    """How sentences that were changed on purpose were followed, after the clean ones."""
    made = []
    own = [(record, record) for record in clean]
    changed = {m.removeprefix(PARTS): found for m, found in pairs.items()}
    arms = [(a, changed[a]) for a in ("other-target", *NO_COST) if a in changed]
    for axis, found in [(CLEAN, own), *arms] if arms else []:
        spatial = [pair for pair in found if pair[0].category not in PROCEDURAL]
        if not spatial:
            continue
        asked = summed([tally_of(record) for _, record in spatial])
        before = summed([_as_before(*pair) for pair in spatial])
        taken = asked.no_choice
        assert taken is not None, "a spatial trial is due one choice"
        some = Estimate(1 - taken.value, 1 - taken.high, 1 - taken.low, taken.method)
        right = None if axis in NO_COST else asked.accuracy
        made.append(Reading(axis, len(spatial), some, right, before.accuracy))
    return made


def _as_before(clean: TrialRecord, record: TrialRecord) -> Tally:
    """The choice of `record` as if the sentence of the `clean` trial had been its own."""
    made, roles = choices_of(record), roles_of(clean)
    right = sum(bool(roles.get(choice.object)) for choice in made)
    guessed = len(made) / record.candidates if record.candidates > 1 else 0.0
    return Tally(1, len(made), right, 0, guessed)
