"""The trial record: the unit of everything that is counted. Its annotations are a line's schema."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Required, TypedDict

from robospa.schema import Count, Integer, Number, one_of
from robospa.trial import TrialKey

PROCESSOR = "processor"
"""Entry of `timing` with a trial's processor time [s]; the others share out its wall time."""

LEAD = "lead"
"""The diagnostic that says by how much [m] what is asked for is ahead of what comes closest."""
CHUNKS, LAST_QUERY = "chunks", "last_query"
"""The diagnostics of a trial's queries: how many were followed by so many actions until the next,
by that number, and how many actions had been begun at the last one."""
USAGE = "usage"
"""The diagnostic that says what a trial has used of what is paid for, in all its attempts."""

END_REASONS = (
    "success",
    "step_limit",
    "done",  # a policy of skills said that it is done, and the goal is not met
    "time_limit",  # under a real clock: its simulated time is over
    "policy_error",  # the policy raised an error or answered what cannot be executed: a failure
    "goal_lost",  # the goal can no longer be met (memory tasks)
    "infrastructure",  # the trial could not be run: missing, never scored as a failure
)
INTERRUPTED = "interrupted"
RETRY_CAUSES = (
    "unreachable",  # no connection could be made, so the policy never got the trial
    "connection_lost",  # the connection ended within the trial
    "deadline",  # an answer did not come in time
    "unreadable_answer",  # what came was no message of the protocol
    "worker_ended",  # the worker's process died
    "worker_stuck",  # the worker did not advance and was killed
    "harness_error",  # the simulator, or other code of ours, raised an error
    "policy_error",  # withdrawn, because the first trials of the task all ended so
    INTERRUPTED,  # the driver was killed or stopped before the trial ended
)
"""Why an attempt at a trial did not count. All but the first may be the policy's doing."""


class EventRow(TypedDict, total=False):
    """An event (`robospa.tasks.events`) as plain values: `time` in seconds since the trial's start,
    `step` the number of actions begun by then."""

    kind: Required[str]
    time: Number
    object: str
    index: Integer
    note: str
    step: Integer


@dataclass(frozen=True)
class RetryRow:
    """An attempt at a trial that did not count."""

    cause: Annotated[str, one_of(RETRY_CAUSES)]
    """`unreachable`, `connection_lost`, `deadline`, `unreadable_answer`, `worker_ended`,
    `worker_stuck`, `harness_error`, `policy_error` or `interrupted`."""
    message: str = ""
    """What happened, in a sentence."""
    steps: Count | None = None
    """Policy actions executed by then; None if that is not known."""


@dataclass(frozen=True)
class TrialRecord:
    """One finished trial."""

    key: TrialKey
    """Which trial it is."""
    category: str
    """Abbreviation of the task's category, such as `GAC`."""
    instruction: str
    """The sentence of the trial."""
    scene_digest: str
    """Hash of the scene at the start."""
    end: Annotated[str, one_of(END_REASONS)]
    """`success`, `step_limit`, `done`, `time_limit`, `goal_lost`, `policy_error` or
    `infrastructure`."""
    success: bool
    """Whether the goal was met."""
    done: Count
    """Subtasks that hold at the end."""
    best: Count
    """The most subtasks that ever held at once."""
    total: Count
    """Subtasks of the variant."""
    candidates: Count
    """The n of ONTA: objects that could be meant."""
    steps: Count
    """Policy actions executed; under a real clock the periods of one, also those in which the robot
    held."""
    physics_steps: Count
    """Steps of the simulation, of 1/250 s."""
    policy_calls: Count
    """Queries of the policy."""
    digest: str
    """Hash of the world's exact final state."""
    actions_digest: str
    """Hash of all executed actions."""
    wall_time: Number
    """Duration of the trial [s]."""
    policy_seed: Count = 0
    """Seed that the policy got."""
    message: str = ""
    """Why the trial ended, for errors."""
    attempts: Count = 1
    """How often the trial was started."""
    retries: tuple[RetryRow, ...] = ()
    """The attempts before the last that did not count; of a trial without a result, all of them.
    Records of older versions have none."""
    events: tuple[EventRow, ...] = ()
    """What happened, in order."""
    latency: Mapping[str, Number] = field(default_factory=dict)
    """`p50`, `p95`, `p99` and `max` of the round trip [ms]; where the server reports them also
    the means of `queue` (before its model ran), `infer` (in it) and `batch` (observations)."""
    timing: Mapping[str, Number] = field(default_factory=dict)
    """Seconds by purpose, and `processor`: processor time."""
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    """What the task measured besides success."""
    video: str = ""
    """Path of the video in the run's folder, which follows the record; empty for none."""


@dataclass(frozen=True)
class Roles:
    """The diagnostics that first choices follow from."""

    roles: Mapping[str, tuple[Integer, ...]] = field(default_factory=dict)
    """Subtasks by object name."""
    pressed: tuple[str, ...] = ()
    """Objects that are pressed."""


def query_entries(asked: Sequence[int], steps: int) -> dict[str, object]:
    """What a record of `steps` actions keeps of its queries: `asked` says how many actions had been
    begun at each."""
    if not asked:
        return {}
    lengths = Counter(after - before for before, after in pairwise((*asked, steps)))
    return {CHUNKS: {str(n): lengths[n] for n in sorted(lengths)}, LAST_QUERY: asked[-1]}
