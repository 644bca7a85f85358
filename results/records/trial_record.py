"""The trial record: the unit of everything that is counted. Imports nothing of ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from robospa.trial import TrialKey

PROCESSOR = "processor"
"""Entry of `timing` with a trial's processor time [s]; the others share out its wall time."""

END_REASONS = (
    "success",
    "step_limit",
    "policy_error",  # the policy answered something that cannot be executed: counts as a failure
    "goal_lost",  # the goal can no longer be met (memory tasks)
    "infrastructure",  # the trial could not be run: missing, never scored as a failure
)


@dataclass(frozen=True)
class TrialRecord:
    """One finished trial. Times in seconds, latencies in milliseconds.

    `end` is one of END_REASONS and `message` says why where that needs words. `done` of `total`
    subtasks hold at the end, `best` is the most that ever held at once. `events` are plain dicts
    (see `robospa.tasks.events`). `digest` is the world's final state, `scene_digest` the start's,
    `actions_digest` the hash of all executed actions. `latency` has p50, p95, p99 and max, and
    where the server reports them the means of `queue` (before its model ran), `infer` (in it) and
    `batch` (observations in one call).
    """

    key: TrialKey
    category: str
    instruction: str
    scene_digest: str
    end: str
    success: bool
    done: int
    best: int
    total: int
    candidates: int
    steps: int
    physics_steps: int
    policy_calls: int
    digest: str
    actions_digest: str
    wall_time: float
    policy_seed: int = 0
    message: str = ""
    attempts: int = 1
    events: tuple[Mapping[str, Any], ...] = ()
    latency: Mapping[str, float] = field(default_factory=dict)
    timing: Mapping[str, float] = field(default_factory=dict)
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    video: str = ""
