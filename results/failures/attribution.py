"""The root of a failure in a long-horizon task: the first mistake that was not put right.

Events are read in order. Each may be a mistake, tied to the subtasks whose completion would put it
right; one that is tied to none is put right by any new progress. Plain mistakes (a drop, a grasp
out of turn) count before traces (an object was reached or lifted, and nothing came of it).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from robospa.results.records.trial_record import EventRow, TrialRecord

ORDERED = ("OCE", "MIP")
"""Categories whose steps have to be done in the order of their subtasks."""
MEMORY = "MIP"
"""There a step out of turn means that what the cue showed is not known any more."""


PRESSES = ("subtask_done", "wrong_order", "repeated")
"""Events that a press can cause."""
LATE = 1.0
"""A closing is reported up to this long [s] after what it did."""


@dataclass(frozen=True)
class Cause:
    """A kind of failure, the event that shows it, and the sentence that says so."""

    kind: str
    event: EventRow
    evidence: str


@dataclass(frozen=True)
class _Mistake:
    """`needs`: subtasks that all have to hold at the end for it to be forgiven; () any progress."""

    cause: Cause
    needs: tuple[int, ...]
    plain: bool


def roles_of(record: TrialRecord) -> dict[str, tuple[int, ...]]:
    """Subtasks by object name; what is named without any was not asked for."""
    known = record.diagnostics.get("roles")
    if known is not None:
        return {name: tuple(subtasks) for name, subtasks in known.items()}
    found: dict[str, tuple[int, ...]] = {}
    for event in record.events:
        if event["object"] and event["index"] >= 0:
            before = found.get(event["object"], ())
            found[event["object"]] = tuple(sorted({*before, event["index"]}))
    return found


def took(event: EventRow) -> bool:
    """Whether a gripper lifted an object or closed on it."""
    closed = event["kind"] == "closed" and event.get("note") == "touching"
    return closed or event["kind"] == "grasped"


def _worked(events: Sequence[EventRow]) -> set[int]:
    """Closings, by the identity of their events, that led to a lift of their object before the next
    closing on it."""
    found: set[int] = set()
    for i, event in enumerate(events):
        if event["kind"] != "closed":
            continue
        for other in events[max(0, i - 8) :]:
            if other["object"] != event["object"] or other["time"] < event["time"] - LATE:
                continue
            if other["kind"] == "grasped":
                found.add(id(event))
            elif other["kind"] == "closed" and other["time"] > event["time"]:
                break
    return found


class _Reader:
    """Walks through a trial's events and gathers what went wrong."""

    def __init__(self, record: TrialRecord) -> None:
        self.category, self.total, self.roles = record.category, record.total, roles_of(record)
        self.pressed = tuple(record.diagnostics.get("pressed", ()))
        self.done: set[int] = set()
        self.idle: set[int] = set()
        """Subtasks that held before anything moved."""
        self.ever: set[int] = set()
        self.tried: set[int] = set()
        self.undone: dict[int, float] = {}
        self.miss: _Mistake | None = None
        """The last closing, if it was beside something."""
        self.worked = _worked(record.events)
        self.progress = -1.0
        self.mistakes: list[_Mistake] = []
        for event in record.events:
            self.read(event)

    def read(self, event: EventRow) -> None:
        kind = str(event["kind"])
        if event["object"] in self.pressed and kind in PRESSES and self.miss is not None:
            self.mistakes.remove(self.miss)  # it only made the gripper ready to press
            self.miss = None
        getattr(self, f"_{kind}", lambda _: None)(event)

    def _add(
        self,
        kind: str,
        event: EventRow,
        evidence: str,
        needs: tuple[int, ...] = (),
        plain: bool = True,
    ) -> None:
        self.mistakes.append(_Mistake(Cause(kind, event, evidence), needs, plain))

    # -- progress ------------------------------------------------------------------------------

    def _subtask_done(self, event: EventRow) -> None:
        index = event["index"]
        self.done.add(index)
        self.tried.add(index)
        if event["time"] <= 0.0:
            self.idle.add(index)
        if index not in self.ever:
            self.ever.add(index)
            self.progress = event["time"]

    def _subtask_undone(self, event: EventRow) -> None:
        index = event["index"]
        self.done.discard(index)
        self.undone[index] = event["time"]
        self._add("manipulation", event, f"subtask {index + 1} was undone", (index,))

    # -- attempts ------------------------------------------------------------------------------

    def _grasped(self, event: EventRow) -> None:
        self._taken(event, "lifted")

    def _closed(self, event: EventRow) -> None:
        self.miss = None
        name = event["object"]
        if took(event):
            self._taken(event, "closed on")
        else:
            # the open subtasks of the object beside which it closed, else what was due
            due = next((i for i in range(self.total) if i not in self.done), -1)
            needs = tuple(i for i in self.roles.get(name, ()) if i not in self.done) or (due,)
            self.tried.update(needs)
            self._add("manipulation", event, f"closed beside {name} and touched nothing", needs)
            self.miss = self.mistakes[-1]

    def _taken(self, event: EventRow, did: str) -> None:
        """A gripper has an object between its fingers: was it its turn?"""
        name = event["object"]
        subtasks = self.roles.get(name, ())
        if not subtasks:
            self._add("target_grounding", event, f"{did} {name}, which was not asked for")
            return
        index = next((i for i in subtasks if i not in self.done), subtasks[0])
        early = self._out_of_turn(index)
        self.tried.add(index)
        # Whether it held until a gripper closed on its object now or just before.
        held = index in self.done or event["time"] - self.undone.get(index, -LATE) < LATE
        if held and index not in self.idle:
            for mistake in [m for m in self.mistakes if self._undoing(m, index, event["time"])]:
                self.mistakes.remove(mistake)
            self._add("redundant_repetition", event, f"{did} {name} again, which was done")
        elif early:
            kind = "memory" if self.category == MEMORY else "temporal_ordering"
            needs = tuple(range(max(self.tried) + 1))
            self._add(kind, event, f"{did} {name} before it was its turn", needs)
        elif did == "closed on" and id(event) not in self.worked:
            self._add("manipulation", event, f"closed on {name} but did not lift it", subtasks)
        else:
            evidence = f"lifted {name}, did not bring it where it belongs"
            self._add("manipulation", event, evidence, subtasks, plain=False)

    def _out_of_turn(self, index: int) -> bool:
        """Whether something else had to be tried before subtask `index`, or this one was."""
        if self.category == MEMORY:
            return any(i not in self.done for i in range(index))
        if self.category not in ORDERED or index in self.tried - self.idle:
            return False
        if any(i not in self.tried for i in range(index)):
            return True
        return any(i > index and i not in self.ever for i in self.tried)

    def _undoing(self, mistake: _Mistake, index: int, time: float) -> bool:
        """Whether a mistake is only that subtask `index` was undone by what happens at `time`."""
        event = mistake.cause.event
        at, kind = event["time"], event["kind"]
        return bool(kind == "subtask_undone" and event["index"] == index and time - at < LATE)

    def _dropped(self, event: EventRow) -> None:
        name = event["object"]
        needs = self.roles.get(name, ())
        kind = "manipulation" if needs else "target_grounding"
        self._add(kind, event, f"dropped {name}", needs)

    def _approached(self, event: EventRow) -> None:
        needs = self.roles.get(event["object"], ())
        if needs and any(i not in self.done for i in needs):
            evidence = f"reached {event['object']}, but nothing came of it"
            self._add("manipulation", event, evidence, plain=False)

    # -- what goals say ------------------------------------------------------------------------

    def _wrong_order(self, event: EventRow) -> None:
        name = event["object"]
        kind = "memory" if self.category == MEMORY else "temporal_ordering"
        evidence = f"{name} was done before it was its turn"
        if any(i in self.ever and i != event["index"] for i in self.roles.get(name, ())):
            kind = "redundant_repetition"
            evidence = f"{name} was done again instead of what was due"
        needs = tuple(range(event["index"] + 1))
        self._add(kind, event, evidence, needs, plain=self.category in ORDERED)

    def _repeated(self, event: EventRow) -> None:
        evidence = f"{event['object']} was done once more than asked"
        self._add("redundant_repetition", event, evidence)

    def _failed(self, event: EventRow) -> None:
        note = event.get("note", "")
        if not event["object"]:
            self._add("temporal_ordering", event, note or "acted too soon", (-1,))
        elif "taken again" in note:
            self._add("redundant_repetition", event, f"{event['object']}: {note}", (-1,))
        elif "too early" not in note:  # that is a wrong_order event's second half
            self._add("manipulation", event, f"{event['object']}: {note}", (-1,))

    # -- the verdict ---------------------------------------------------------------------------

    def root(self) -> Cause | None:
        """The first plain mistake that was not put right, else the first trace of one."""
        left = [m for m in self.mistakes if not self._forgiven(m)]
        plain = [m for m in left if m.plain]
        return self._worst(plain or left) if left else None

    def _forgiven(self, mistake: _Mistake) -> bool:
        if mistake.needs:
            return all(i in self.done for i in mistake.needs)
        return bool(mistake.cause.event["time"] < self.progress)

    def _worst(self, mistakes: list[_Mistake]) -> Cause:
        """The first; of a failed grasp, its end: the drop is what a viewer wants to see."""
        first = mistakes[0]
        if first.cause.kind == "manipulation" and first.needs:
            same = (m.cause for m in mistakes if m.needs == first.needs)
            return next((c for c in same if c.event["kind"] == "dropped"), first.cause)
        return first.cause


def root_of(record: TrialRecord) -> Cause | None:
    """The cause of failure of a long-horizon trial; None if nothing was tried."""
    return _Reader(record).root()


def mistakes_of(record: TrialRecord) -> list[Cause]:
    """All mistakes of a long-horizon trial, also those that were put right."""
    return [mistake.cause for mistake in _Reader(record).mistakes]
