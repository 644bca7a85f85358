"""Events of a trial: the one source of success, progress and failure types.

A tracker emits events; everything else is derived from the list of them by `outcome`.
"""

from collections.abc import Iterable
from dataclasses import dataclass

KINDS = (
    "subtask_done",  # subtask `index` became true
    "subtask_undone",  # subtask `index` was true and is no longer (rules that do not latch)
    "success",  # the trial's goal is met; latches
    "failed",  # the goal can no longer be met (memory tasks); latches
    "wrong_object",  # an object that is not asked for was lifted, pressed or moved
    "wrong_order",  # the right thing at the wrong time
    "repeated",  # a subtask was done once more than asked
    "grasped",  # a gripper closed on `object` and lifted it
    "dropped",  # a lifted `object` fell
    "cue_hidden",  # what has to be remembered is no longer visible
    "closed",  # a gripper closed: `object` is what it touched (note "touching") or what was nearest
    "approached",  # a gripper came near `object`, touching or not
    "clutter_moved",  # `object`, which is none of the task's, was pushed, lifted or knocked over
    "began",  # demonstrations alone: the expert's call `note` on `object` begins
)


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened at `time` [s, simulated]. `index` counts subtasks from 0."""

    time: float
    kind: str
    object: str = ""
    index: int = -1
    note: str = ""


@dataclass(frozen=True)
class ObjectRole:
    """The subtasks that need an object; a distractor has none.

    A `pressed` object is touched with a closed gripper: closing near it is no grasp attempt.
    """

    subtasks: tuple[int, ...] = ()
    pressed: bool = False


@dataclass(frozen=True, slots=True)
class Outcome:
    """`done` counts the subtasks that hold at the end, `best` the most that ever held at once."""

    success: bool
    failed: bool
    done: int
    best: int


def outcome(events: Iterable[Event], total: int) -> Outcome:
    """Success and progress of a trial of `total` subtasks, from its events alone."""
    held: set[int] = set()
    best, success, failed = 0, False, False
    for event in events:
        if event.kind == "subtask_done":
            held.add(event.index)
            best = max(best, len(held))
        elif event.kind == "subtask_undone":
            held.discard(event.index)
        elif event.kind == "success":
            success = True
        elif event.kind == "failed":
            failed = True
    if success:
        return Outcome(True, False, total, total)
    return Outcome(False, failed, min(len(held), total), min(best, total))
