"""Failure types of trials, decided from their events by the rules below.

The types are the paper's (its authors labelled videos by hand) and two of ours for trials that none
of those describes: nothing was tried, and an answer that cannot be executed. The rules look for the
*root*: the first thing that went wrong and was not put right. `docs/failures.md` has them in words.

A trial lost to infrastructure is no failure of the policy and gets no type.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import SupportsIndex, overload

from robospa.results.failures.attribution import Cause, roles_of, root_of, took
from robospa.results.records.action_problems import described, problem_counts
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.tables import Table, TableCell, TableRow, html_fragment
from robospa.text import plain
from robospa.trial import BASIC, SPATIAL, TrialKey

NAMES = {
    "target_grounding": "target grounding",
    "target_execution": "target execution",
    "no_contact_grasp": "no-contact grasp",
    "manipulation": "manipulation",
    "memory": "memory",
    "temporal_ordering": "temporal ordering",
    "redundant_repetition": "redundant repetition",
    "no_attempt": "no attempt",
    "invalid_action": "invalid action",
}
"""Kinds of failure and how people read them."""

KINDS = tuple(NAMES)
OURS = ("no_attempt", "invalid_action")
"""Kinds that the paper does not have."""

SIMULATED_PER_FILM = 2.0
"""Simulated seconds in a second of video: a frame every 0.2 s, ten frames a second."""


@dataclass(frozen=True)
class Failure:
    """The type of a trial's failure. `evidence` describes in one sentence what was seen.

    `time` [s, simulated] and `step` (actions started by then, the failing one included) say when;
    `video_seconds` is that moment in the trial's video. Each is None where it is not known.
    """

    kind: str
    evidence: str
    time: float | None = None
    step: int | None = None
    video_seconds: float | None = None


def label(record: TrialRecord) -> Failure | None:
    """The one type of a failed trial; None for a success and for a trial that was not run."""
    if record.success or record.end == "infrastructure":
        return None
    if record.end == "policy_error":
        return _at_end(record, "invalid_action", record.message or "the answer was refused")
    events = tuple(event for event in record.events if event["kind"] != "clutter_moved")
    record = replace(record, events=events)
    spatial = record.category in (*SPATIAL, *BASIC)
    cause = _spatial(record) if spatial else root_of(record)
    if cause is None:
        evidence = "; ".join([_idle(record), *(one.sentence for one in problem_counts([record]))])
        return _at_end(record, "no_attempt", evidence)
    time = float(cause.event["time"])
    film = round(time / SIMULATED_PER_FILM, 1) if record.video else None
    return Failure(cause.kind, cause.evidence, time, cause.event.get("step"), film)


def failures_of(records: Iterable[TrialRecord]) -> dict[TrialKey, Failure]:
    """The type of every failed trial among `records`."""
    return {r.key: failure for r in records if (failure := label(r)) is not None}


def distribution(
    records: Iterable[TrialRecord],
    by: str = "task",
    failures: Mapping[TrialKey, Failure] | None = None,
) -> dict[str, dict[str, int]]:
    """Occurrences of each kind, by "task", "category" or "variant"; kinds in their order.

    Groups without a failure are left out. `failures` are those of the records, where they are known
    already. ValueError for another grouping.
    """
    if by not in _GROUPS:
        raise ValueError(f"failures are grouped by {', '.join(_GROUPS)}, not by {by!r}")
    known = list(records)
    found = failures_of(known) if failures is None else failures
    counts: dict[str, dict[str, int]] = {}
    for record in known:
        if failure := found.get(record.key):
            row = counts.setdefault(_GROUPS[by](record), dict.fromkeys(KINDS, 0))
            row[failure.kind] += 1
    return {
        name: {kind: count for kind, count in row.items() if count}
        for name, row in sorted(counts.items())
    }


_GROUPS: Mapping[str, Callable[[TrialRecord], str]] = {
    "task": lambda record: record.key.task,
    "category": lambda record: record.category,
    "variant": lambda record: f"{record.key.task} L{record.key.level}",
}


def _at_end(record: TrialRecord, kind: str, evidence: str) -> Failure:
    """A failure that no event shows: the trial's last action is where it stands."""
    return Failure(kind, evidence, None, record.steps, None)


def _idle(record: TrialRecord) -> str:
    if "roles" not in record.diagnostics:
        return "the record does not tell what the grippers tried: an older version wrote it"
    if record.done:
        return (
            f"{record.done} of {record.total} subtasks hold at the end; "
            "nothing was tried at the others after the last of them"
        )
    return "no gripper came near anything that was asked for"


def _spatial(record: TrialRecord) -> Cause | None:
    """The selection is the first object that a gripper touched in closing, or lifted."""
    roles = roles_of(record)
    first: dict[str, EventRow] = {}
    for event in record.events:
        kind = "chosen" if took(event) else event["kind"]
        first.setdefault("approached" if kind == "wrong_object" else kind, event)
    chosen, lost, beside, reached = map(first.get, ("chosen", "dropped", "closed", "approached"))
    if chosen is not None:
        name = chosen["object"]
        if not roles.get(name):
            return Cause("target_grounding", chosen, f"took {name}, which was not asked for")
        if lost is not None and lost["object"] == name:
            return Cause("target_execution", lost, f"took the target, {name}, and dropped it")
        text = f"closed on the target, {name}, but did not lift it"
        return Cause("target_execution", chosen, text)
    if beside is not None:
        text = f"closed beside {beside['object']} and touched nothing"
        return Cause("no_contact_grasp", beside, text)
    if reached is None:
        return None
    name = reached["object"]
    if roles.get(name):
        return Cause(
            "target_execution", reached, f"reached the target, {name}, but never closed on it"
        )
    return Cause("target_grounding", reached, f"reached {name}, which was not asked for")


SHOWN = 100
"""Failures that are printed before the others are only counted."""


def counts_table(rows: Mapping[str, Mapping[str, int]], by: str) -> Table:
    """A `distribution` as a table."""
    kinds = [k for k in KINDS if any(k in row for row in rows.values())]
    heads = ("failed", *(NAMES[k] + " *" * (k in OURS) for k in kinds))
    body = tuple(
        TableRow(name, tuple(TableCell(str(n)) for n in counts))
        for name, row in rows.items()
        for counts in [(sum(row.values()), *(row.get(k, 0) for k in kinds))]
    )
    notes = ("* not one of the paper's types",) if any(k in OURS for k in kinds) else ()
    return Table("failures", "", by, heads, body, notes=notes)


@dataclass(frozen=True)
class FailedTrial:
    """A trial that failed, why, and when; objects are named as they look."""

    task: str
    level: int
    seed: int
    embodiment: str
    mode: str
    split: str
    type: str
    """The type of failure, of `labels.NAMES`."""
    evidence: str
    """What was seen, in a sentence."""
    time: float | None
    """Of the failure [s, simulated]; None where it is not known."""
    step: int | None
    """Actions begun by then, the failing one included."""
    video: str
    """Path of the film in the run's folder; empty for none."""
    video_seconds: float | None
    """That moment in the film [s]."""

    @property
    def trial(self) -> str:
        """Its name, as `robospa view RUN TRIAL` takes it."""
        return TrialKey(**{f.name: getattr(self, f.name) for f in fields(TrialKey)}).slug


class FailedTrials(list[FailedTrial]):
    """A list that `print` and a notebook show as a table, one line a failure."""

    @overload
    def __getitem__(self, at: SupportsIndex) -> FailedTrial: ...
    @overload
    def __getitem__(self, at: slice) -> FailedTrials: ...
    def __getitem__(self, at: SupportsIndex | slice) -> FailedTrial | FailedTrials:
        found = super().__getitem__(at)
        return FailedTrials(found) if isinstance(found, list) else found

    def _title(self) -> str:
        return f"{len(self)} failed trial{'s' * (len(self) != 1)}"

    def _more(self) -> tuple[str, ...]:
        more = len(self) - SHOWN
        return (f"and {more} more: a slice, such as [{SHOWN}:], shows them",) if more > 0 else ()

    def __str__(self) -> str:
        rows = [(f.trial, f.type, plain(f.evidence)) for f in self[:SHOWN]]
        first, second = (max((len(row[i]) for row in rows), default=0) for i in (0, 1))
        lines = [f"{trial:{first}}  {kind:{second}}  {text}" for trial, kind, text in rows]
        return "\n".join([self._title(), *lines, *self._more()])

    __repr__ = __str__

    def table(self, most: int = SHOWN) -> Table:
        """The first `most` failures, a row each."""
        rows = tuple(
            TableRow(f.trial, (TableCell(f.type), TableCell(f.evidence))) for f in self[:most]
        )
        more = self._more() if most < len(self) else ()
        heads = ("type", "evidence")
        return Table("failures", self._title(), "trial", heads, rows, notes=more, words=True)

    def _repr_html_(self) -> str:
        return html_fragment(self.table())


def failed_trials(records: Iterable[TrialRecord]) -> FailedTrials:
    """Every failed trial among `records`, in the order of their keys."""
    found = FailedTrials()
    for record in sorted(records, key=lambda r: r.key):
        if (failure := label(record)) is not None:
            found.append(
                FailedTrial(
                    **asdict(record.key),
                    type=NAMES[failure.kind],
                    evidence=described(failure.evidence, record),
                    time=failure.time,
                    step=failure.step,
                    video=record.video,
                    video_seconds=failure.video_seconds,
                )
            )
    return found
