"""Whether a trial succeeded by its first choice.

The official rule lets a policy try one thing after the other until the right one comes. What else
it took, pressed, did too early or did once more is in the events of every record.
"""

from collections import Counter
from collections.abc import Sequence

from robospa.results.failures.attribution import MEMORY, mistakes_of, roles_of, took
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.statistics.significance import at_least
from robospa.text import some
from robospa.trial import BASIC, PROCEDURAL, SPATIAL

EARLY = ("temporal_ordering", "memory")
OF_CHOICE = ("redundant_repetition", *EARLY)
"""Kinds of mistakes of a procedure that are about what is done, not about how well."""
ANY_ORDER = ("Observe_Blocks_Move_Memory", "Remember_Orientation_Restore")
"""Memory tasks that are asked for in no order."""
PASSING = 1.0
"""Seconds between a press and the approach of what is due that make it a press in passing."""


def first_choice(record: TrialRecord) -> bool:
    """Whether the trial succeeded, and nothing shows that anything else was chosen before.

    Spatial tasks and basic grounding: no other object rose, was lifted, or had a gripper close on
    it. Procedures and memory: nothing was done that was not asked for, too early, or once more.
    """
    if not record.success or took_another(record):
        return False
    if record.category in (*SPATIAL, *BASIC):
        return True
    memory, free = record.category == MEMORY, record.key.task in ANY_ORDER
    if memory and not free and record.diagnostics.get("out_of_order", 0):
        return False
    wrong = set(OF_CHOICE) - (set(EARLY) if free else set())
    causes = mistakes_of(record)
    return not any(cause.kind in wrong and not in_passing(cause.event, record) for cause in causes)


def took_another(record: TrialRecord) -> bool:
    """Whether an object that was not asked for rose, was lifted, pressed, or closed on.

    Procedures but memory tasks have no such objects: what has no subtask there is a place, and a
    gripper that closes against it chooses nothing.
    """
    roles, places = roles_of(record), record.category in PROCEDURAL and record.category != MEMORY
    for event in record.events:
        strange = took(event) and not places and not roles.get(event["object"])
        if strange or event["kind"] == "wrong_object":
            return True
    return False


def in_passing(press: EventRow, record: TrialRecord) -> bool:
    """Whether an early press in a composite action came about on the way to what was due.

    A finger that flies past closely enough presses, by the official rule; it happens to the expert.
    """
    if record.category != "CAC" or press["kind"] != "wrong_order":
        return False
    if press["object"] not in record.diagnostics.get("pressed", ()):
        return False
    before = [e for e in record.events if e["time"] < press["time"]]
    done = {e["index"] for e in before if e["kind"] == "subtask_done"}
    due = next((i for i in range(record.total) if i not in done), -1)
    roles = roles_of(record)
    return any(
        event["kind"] == "approached"
        and abs(event["time"] - press["time"]) < PASSING
        and due in roles.get(event["object"], ())
        for event in record.events
    )


def held_at_start(record: TrialRecord) -> int:
    """How many subtasks held before the first action."""
    done = (e for e in record.events if e["kind"] == "subtask_done" and e["time"] <= 0)
    return len({event["index"] for event in done})


SHARE = 0.1
"""So many of a run's successes may come after another choice without a remark: a policy that reads
may miss, and try again."""
SURE = 0.01
"""The chance that one run whose share is no larger is remarked on all the same."""


def after_others(results: Sequence[TrialRecord]) -> str:
    """What a reader has to know where many successes of a run came after another choice; else "".

    Binomial tests of SHARE, of all successes and (Bonferroni) of each task's. The first choices of
    spatial trials are held against those of a blind policy, right once among the candidates.
    """
    won = [record for record in results if record.success]
    later = [record for record in won if not first_choice(record)]
    tasks, of_task = Counter(r.key.task for r in won), Counter(r.key.task for r in later)
    odd = [t for t, n in of_task.items() if at_least(n, {SHARE: tasks[t]}) < SURE / len(tasks)]
    if not odd and (not later or at_least(len(later), {SHARE: len(won)}) >= SURE):
        return ""
    text = (
        f"{len(later)} of {len(won)} successes came after something else was taken, pressed, done "
        f"too early or once more, which is more than {100 * SHARE:g} % by more than chance"
        + (f" (in {some(sorted(odd))} alone too)" if odd else "")
        + ": SR@1 says what the first choices were worth"
    )
    spatial = [r for r in results if r.category in SPATIAL and r.candidates > 1]
    right, by_chance = sum(map(first_choice, spatial)), Counter(1 / r.candidates for r in spatial)
    if spatial and at_least(right, by_chance) > SURE:
        guessed = sum(chance * n for chance, n in by_chance.items())
        text += (
            f". Of {len(spatial)} spatial trials {right} succeeded by the first choice, where "
            f"guessing gives {guessed:.0f}: nothing shows that the policy reads its instruction"
        )
    return text
