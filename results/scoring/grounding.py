"""Reason and hand told apart: what was chosen, and what came of the right choice, from events.

A *choice* is a gripper's first contact with an object, or a press. A spatial or basic trial counts
by its first one; a procedure has one for every step that was begun, right if it was that object's
turn. So of a spatial category SR@1 is the share of trials with a choice, times that of right ones
(before chance is taken out), times the execution rate. `docs/statistics.md` has the limits.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

from robospa.results.failures.attribution import LATE, MEMORY, ORDERED, roles_of, took
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.scoring.first_choice import ANY_ORDER, first_choice, held_at_start, in_passing
from robospa.results.scoring.models import ModelResults, restricted
from robospa.results.scoring.scores import level_name
from robospa.results.statistics.intervals import Estimate, clustered, difference, rescaled
from robospa.results.statistics.samples import scale_of_chance
from robospa.results.tables import DASH, Table, TableCell, TableRow, estimate_cell
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, PROCEDURAL


@dataclass
class Choice:
    """An object that was chosen. `open`: the subtasks that it was still to do something for."""

    object: str
    right: bool
    done: bool = False
    open: frozenset[int] = frozenset()


def choices_of(record: TrialRecord) -> list[Choice]:
    """The choices of a trial in order; of a spatial or basic one the first alone."""
    if record.category in PROCEDURAL:
        return _Steps(record).choices
    roles = roles_of(record)
    for event in record.events:
        if took(event) or event["kind"] in ("wrong_object", "subtask_done"):
            name = event["object"]
            right = event["kind"] != "wrong_object" and bool(roles.get(name))
            return [Choice(name, right, right and first_choice(record))]
    return []


class _Steps:
    """Walks through the events of a procedure."""

    def __init__(self, record: TrialRecord) -> None:
        self.record = record
        self.choices: list[Choice] = []
        self.roles = roles_of(record)
        self.pressed = set(record.diagnostics.get("pressed", ()))
        self.strict = record.category in ORDERED and record.key.task not in ANY_ORDER
        self.idle: set[int] = set()
        self.held: set[int] = set()
        self.tried: set[int] = set()
        self.undone: dict[int, float] = {}
        self.near: dict[str, EventRow] = {}
        """Approaches to what is to be pressed, since the last choice."""
        self.last = -LATE
        for event in record.events:
            self._read(event)
        self._missed_presses("")

    def _read(self, event: EventRow) -> None:
        kind, name, index = event["kind"], event["object"], event["index"]
        if kind == "subtask_undone":
            self.held.discard(index)
            self.undone[index] = event["time"]
        elif kind == "subtask_done" and event["time"] <= 0.0:
            self.held.add(index)
            self.idle.add(index)
        elif kind == "approached":
            if name in self.pressed and event["time"] - self.last > LATE / 2:
                self.near.pop(name, None)  # the last time counts
                self.near[name] = event
        elif kind in ("subtask_done", "wrong_order") and not in_passing(event, self.record):
            self._missed_presses(name)
            self._done(event) if kind == "subtask_done" else self._choose(
                event, self._in_turn(index)
            )
        elif kind == "closed" and event.get("note") != "touching":
            self._take(event, reached=False)
        elif took(event):
            self._take(event, reached=True)
        elif kind == "wrong_object":
            left = self._open(name, event["time"])
            self._choose(event, bool(left) and self._in_turn(min(left)))
        elif kind == "repeated" or "taken again" in event.get("note", ""):
            self._choose(event, False)

    def _take(self, event: EventRow, reached: bool) -> None:
        """A gripper closed on something, or beside it."""
        name = event["object"]
        mine = self.roles.get(name, ())
        if not mine:  # a place; in a memory task something that was not asked for
            if reached and self.record.category == MEMORY:
                self._choose(event, False)
            return
        left = self._open(name, event["time"])
        if left:
            self._choose(event, not self.strict or self._in_turn(min(left)))
        elif reached and not self.idle.issuperset(mine):
            self._choose(event, False)

    def _open(self, name: str, time: float) -> set[int]:
        """What is still to be done with an object; what was undone by taking it counts as done."""
        late = {i for i, at in self.undone.items() if time - at < LATE and i not in self.idle}
        return {*self.roles.get(name, ())} - self.held - late

    def _in_turn(self, index: int) -> bool:
        """Whether all before subtask `index` is done, or was tried in its turn."""
        return all(i in self.held | self.tried for i in range(index))

    def _choose(self, event: EventRow, right: bool) -> None:
        """What was chosen last and is not done yet is not chosen anew, but may turn out wrong."""
        name = event["object"]
        self._missed_presses(name)
        self.last = event["time"]
        left = self._open(name, event["time"])
        if self.choices and (now := self.choices[-1]).object == name and not now.done:
            now.right = now.right and right
        else:
            self.choices.append(Choice(name, right, open=frozenset(left)))
        if right:
            self.tried.update(sorted(left)[:1])

    def _done(self, event: EventRow) -> None:
        """A subtask was done: by the latest choices of those objects that are in it."""
        index = event["index"]
        latest = {choice.object: choice for choice in self.choices}.values()
        made = [c for c in latest if index in c.open and not c.done]
        if not made:
            self._choose(event, not self.strict or self._in_turn(index))
            made = self.choices[-1:]
        for choice in made:
            choice.done = choice.right
        self.held.add(index)
        self.last = event["time"]

    def _missed_presses(self, other: str) -> None:
        """What was to be pressed and was only reached before `other` was chosen, or at the end, was
        chosen if it was its turn: a gripper on its way comes near things too."""
        near, self.near = self.near, {}
        near.pop(other, None)
        for event in near.values():
            left = self._open(event["object"], event["time"])
            if left and (not self.strict or self._in_turn(min(left))):
                self._choose(event, True)


@dataclass(frozen=True)
class Grounding:
    """The choices of some trials. An estimate is None where nothing was chosen, or chosen right."""

    trials: int
    due: int
    """Steps that were to be done: one a trial, of a procedure those that did not hold already."""
    chosen: int
    right: int
    done: int
    accuracy: Estimate | None
    """Share of right choices, 0 for one of the candidates taken blindly; a procedure's as it is."""
    execution: Estimate | None
    """Share of right choices whose step was done."""
    no_choice: Estimate | None
    """Share of the steps due for which nothing was chosen, neither right nor wrong."""


class Tally(NamedTuple):
    """The steps due, choices, right ones and those carried out of a trial, and how many would be
    right by guessing."""

    due: int
    chosen: int
    right: int
    done: int
    guessed: float


def tally_of(record: TrialRecord) -> Tally:
    """The choices of `record` in numbers."""
    made = choices_of(record)
    right = [choice for choice in made if choice.right]
    steps = record.category in PROCEDURAL
    due = max(0, record.total - held_at_start(record)) if steps else 1
    guessed = 0.0 if steps or record.candidates < 2 else len(made) / record.candidates
    return Tally(due, len(made), len(right), sum(choice.done for choice in right), guessed)


def summed(tallies: Sequence[Tally]) -> Grounding:
    """The choices of some trials together."""
    due, chosen, right, done, guessed = (sum(column) for column in zip(*tallies, strict=True))
    accuracy = clustered([(t.right, t.chosen) for t in tallies])
    if accuracy is not None and guessed:
        accuracy = rescaled(accuracy, *scale_of_chance(guessed / chosen))
    return Grounding(
        *(len(tallies), int(due), int(chosen), int(right), int(done), accuracy),
        clustered([(t.done, t.right) for t in tallies]),
        clustered([(max(0, t.due - t.chosen), t.due) for t in tallies]),
    )


Place = tuple[str, int]
"""A task, a category or a dimension, and a level, 0 for all."""


def groundings(records: Iterable[TrialRecord]) -> dict[Place, Grounding]:
    """The choices of every task, category and dimension by level."""
    members: dict[Place, list[Tally]] = {}
    for record in records:
        tally = tally_of(record)
        names = [record.key.task, record.category]
        names += [d for d, categories in DIMENSIONS.items() if record.category in categories]
        for place in ((name, level) for name in names for level in (record.key.level, 0)):
            members.setdefault(place, []).append(tally)
    return {place: summed(found) for place, found in members.items()}


MEASURES = {"accuracy": "grounding", "execution": "execution", "no_choice": "no choice"}
"""Fields of a `Grounding` that are estimated, and their heads."""


def grounding_data(records: Iterable[TrialRecord]) -> dict[str, dict[str, dict[str, object]]]:
    """`groundings` as JSON values, by name and level."""
    made: dict[str, dict[str, dict[str, object]]] = {}
    for (name, level), found in groundings(records).items():
        counts = {n: getattr(found, n) for n in ("trials", "due", "chosen", "right", "done")}
        estimates = {n: getattr(found, n) for n in MEASURES}
        shares = {n: e and [e.value, e.low, e.high] for n, e in estimates.items()}
        made.setdefault(name, {})[level_name(level)] = {**counts, **shares}
    return made


ROWS = {c: f"{c} {CATEGORY_NAMES[c]}" for c in CATEGORIES}
ROWS |= {d: f"{d} categories" for d in DIMENSIONS}
ROWS |= {c: f"{c} {CATEGORY_NAMES[c]}" for c in BASIC}
NOTE = (
    "In percent with 95 % intervals, over all choices of all levels. Grounding: the share of right "
    "choices, scaled in spatial and basic tasks so that guessing is 0; execution: the share of "
    "right choices that were carried out; no choice: steps for which nothing was chosen."
)


def grounding_table(models: Sequence[ModelResults]) -> Table | None:
    """Grounding and execution of runs by category; None where nothing is known to be chosen."""
    return table_of([(m.name, groundings(m.records)) for m in models if m.trials])


def table_of(sides: Sequence[tuple[str, Mapping[Place, Grounding]]]) -> Table | None:
    """The same of what was found for each name."""
    if not any(one.chosen for _, found in sides for one in found.values()):
        return None
    heads = (*MEASURES.values(), "choices")
    rows = [
        TableRow(
            label,
            tuple(chain(*(_cells(found.get((name, 0))) for _, found in sides))),
            "row" if name in (*CATEGORIES, *BASIC) else "average",
        )
        for name, label in ROWS.items()
        if any((name, 0) in found for _, found in sides)
    ]
    groups = tuple((name, len(heads)) for name, _ in sides)
    title = "Grounding and execution"
    notes = (NOTE, *chain(*(finding(*side) for side in sides)))
    return Table("grounding", title, "", heads * len(sides), tuple(rows), groups, notes)


def _cells(found: Grounding | None) -> list[TableCell]:
    if found is None:
        return [DASH] * (len(MEASURES) + 1)
    count = TableCell(str(found.chosen), found.chosen)
    return [*(estimate_cell(getattr(found, name)) for name in MEASURES), count]


def differences(first: ModelResults, second: ModelResults) -> tuple[str, ...]:
    """How two runs differ in grounding and execution over all choices of the variants that both
    have, in sentences; trials are not paired, since not every one has a choice."""
    shared = first.trials.keys() & second.trials.keys()
    sides = [groundings(restricted(model, shared).records) for model in (first, second)]
    said = []
    for place in ((name, 0) for name in (*DIMENSIONS, *BASIC)):
        if all(place in side for side in sides):
            one, two = (side[place] for side in sides)
            texts = [
                f"{head} {estimate_cell(difference(a, b), '+z.1f').text}"
                for measure, head in MEASURES.items()
                if (a := getattr(one, measure)) and (b := getattr(two, measure))
            ]
            said += [f"{ROWS[place[0]]}: {', '.join(texts)} (not paired)"] * bool(texts)
    return tuple(said)


def finding(name: str, found: Mapping[Place, Grounding]) -> list[str]:
    """A sentence for each dimension: how many choices were right and carried out, and of how many
    steps nothing was chosen."""
    said = []
    for dimension in DIMENSIONS:
        one = found.get((dimension, 0))
        if one is not None and one.chosen:
            none = round(one.due * one.no_choice.value) if one.no_choice else 0
            said.append(
                f"{name}, {dimension}: {one.right} of {one.chosen} choices were right, and "
                f"{one.done} of these carried out; "
                f"for {none} of {one.due} steps nothing was chosen."
            )
    return said
