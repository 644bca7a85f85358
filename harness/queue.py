"""The order of a run's trials: one base task after the other, the longest first.

Trials of one base task stay together so that a server loads each checkpoint once; long ones go
first so that no worker is left with a long one at the end. A retried trial goes before all others
once its pause is over.
"""

from __future__ import annotations

import heapq
from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from robospa.results.records import TrialKey


@dataclass(frozen=True)
class Pending:
    """A trial waiting to be run for the `attempt`-th time."""

    key: TrialKey
    attempt: int = 1


@dataclass(frozen=True)
class Facts:
    """What is known of a variant before any of its trials has run."""

    category: str = ""
    candidates: int = 0
    subtasks: int = 0
    steps: int = 0


class TrialQueue:
    """All trials of a run that are not settled yet. `parts` finds the task of a key."""

    def __init__(self, keys: Sequence[TrialKey], parts: Callable[[TrialKey], Any]) -> None:
        self._parts = parts
        self._facts: dict[tuple[str, int], Facts] = {}
        self._fresh = deque(Pending(key) for key in self._ordered(keys))
        self._retries: list[tuple[float, int, Pending]] = []
        self._count = 0
        self.unsettled = len(self._fresh)

    def facts(self, key: TrialKey) -> Facts:
        """Facts of the variant of `key`; all empty if its task cannot be found."""
        if key.variant not in self._facts:
            try:
                task = self._parts(key).task
                level = task.levels[key.level]
                found = Facts(task.category, level.candidates, level.subtasks, level.steps)
            except Exception:  # the worker will meet the same error and report it
                found = Facts()
            self._facts[key.variant] = found
        return self._facts[key.variant]

    def _ordered(self, keys: Sequence[TrialKey]) -> list[TrialKey]:
        cost: dict[str, int] = defaultdict(int)
        for key in keys:
            cost[key.task] += self.facts(key).steps
        return sorted(
            keys, key=lambda k: (-cost[k.task], k.task, -self.facts(k).steps, k.level, k.seed)
        )

    def take(self, now: float) -> Pending | None:
        """The next trial to run at time `now`; None if none is due."""
        if self._retries and self._retries[0][0] <= now:
            return heapq.heappop(self._retries)[2]
        return self._fresh.popleft() if self._fresh else None

    def again(self, work: Pending, due: float) -> None:
        """Run `work` once more, not before time `due`."""
        self._count += 1
        heapq.heappush(self._retries, (due, self._count, Pending(work.key, work.attempt + 1)))

    def next_due(self) -> float | None:
        """When the next retry is due; None if there is none."""
        return self._retries[0][0] if self._retries else None

    def settle(self) -> None:
        """One trial has its record."""
        self.unsettled -= 1


def expected_work(
    keys: Sequence[TrialKey], parts: Callable[[TrialKey], Any]
) -> dict[TrialKey, float]:
    """The most actions that each trial may take: what the time left is estimated from."""
    queue = TrialQueue(keys, parts)
    return {key: float(max(1, queue.facts(key).steps)) for key in keys}
