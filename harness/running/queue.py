"""The trials of a run that still have to be done, by base task, the longest expected first.

What a trial is expected to take is its step limit until trials of its variant were measured in this
run. Long trials go first so that no worker is left with one at the end. Which task is next is the
scheduler's choice (`robospa.harness.running.scheduler`), because it depends on the servers.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from robospa.results.records.trial_record import RetryRow
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.tasks.task import Task


@dataclass(frozen=True)
class Pending:
    """A trial waiting to be run for the `attempt`-th time by this driver; `retries` are all
    attempts that did not count, those of earlier drivers first."""

    key: TrialKey
    attempt: int = 1
    retries: tuple[RetryRow, ...] = ()


@dataclass(frozen=True)
class VariantInfo:
    """What the catalog says of a variant, before any of its trials has run."""

    category: str = ""
    candidates: int = 0
    subtasks: int = 0
    steps: int = 0


class DurationEstimates:
    """Expected seconds of a trial. `steps` gives the step limit of a key's variant.

    The estimate for a variant is the mean of its measured trials and of one guess: its step limit
    times the seconds that the run's trials have taken for each step of theirs.
    """

    def __init__(self, steps: Callable[[TrialKey], int]) -> None:
        self._steps = steps
        self._measured: dict[tuple[str, int], tuple[float, int]] = {}
        self._seconds = self._limits = 0.0

    @property
    def known(self) -> bool:
        """Whether any trial was measured; until then `expect` is in steps, not seconds."""
        return self._limits > 0

    def add(self, key: TrialKey, seconds: float) -> None:
        """A trial of the variant of `key` took `seconds`."""
        total, count = self._measured.get(key.variant, (0.0, 0))
        self._measured[key.variant] = (total + seconds, count + 1)
        self._seconds += seconds
        self._limits += max(1, self._steps(key))

    def expect(self, key: TrialKey) -> float:
        """Seconds that a trial of the variant of `key` should take."""
        per_step = self._seconds / self._limits if self.known else 1.0
        total, count = self._measured.get(key.variant, (0.0, 0))
        return (total + per_step * max(1, self._steps(key))) / (count + 1)


@dataclass
class _Group:
    """What is left of one base task: fresh trials by level, retries by the time they are due."""

    fresh: dict[int, deque[Pending]] = field(default_factory=dict)
    retries: list[tuple[float, int, Pending]] = field(default_factory=list)

    def due(self, now: float) -> bool:
        return bool(self.fresh) or (bool(self.retries) and self.retries[0][0] <= now)


class TrialQueue:
    """All trials of a run that are not settled yet. `task_of` finds the task of a key, `retries`
    has the attempts of earlier drivers."""

    def __init__(
        self,
        keys: Sequence[TrialKey],
        task_of: Callable[[TrialKey], Task],
        retries: Mapping[TrialKey, tuple[RetryRow, ...]] | None = None,
    ) -> None:
        self._task_of = task_of
        self._info: dict[tuple[str, int], VariantInfo] = {}
        self._groups: dict[str, _Group] = {}
        self._count = 0
        self.durations = DurationEstimates(lambda key: self.info(key).steps)
        self.unsettled = 0
        self._retries = retries or {}
        for key in sorted(keys):
            by_level = self._groups.setdefault(key.task, _Group()).fresh
            pending = Pending(key, retries=self._retries.get(key, ()))
            by_level.setdefault(key.level, deque()).append(pending)
            self.unsettled += 1

    def info(self, key: TrialKey) -> VariantInfo:
        """The variant of `key`; all fields empty if its task cannot be found."""
        if key.variant not in self._info:
            try:
                task = self._task_of(key)
                level = task.levels[key.level]
                found = VariantInfo(task.category, level.candidates, level.subtasks, level.steps)
            except Exception:  # the worker will meet the same error and report it
                found = VariantInfo()
            self._info[key.variant] = found
        return self._info[key.variant]

    @property
    def tasks(self) -> tuple[str, ...]:
        """Every base task of the run."""
        return tuple(self._groups)

    def due(self, now: float) -> dict[str, float]:
        """Expected seconds of what waits, for every task that has something to run at `now`."""
        return {
            task: self._seconds_left(group)
            for task, group in self._groups.items()
            if group.due(now)
        }

    def waiting(self) -> tuple[str, ...]:
        """Every base task that still has a trial to start, now or after its pause."""
        return tuple(task for task, g in self._groups.items() if g.fresh or g.retries)

    def left(self) -> float:
        """Expected seconds of all trials that wait."""
        return sum(map(self._seconds_left, self._groups.values()))

    def _seconds_left(self, group: _Group) -> float:
        fresh = sum(len(q) * self.durations.expect(q[0].key) for q in group.fresh.values())
        return fresh + sum(self.durations.expect(work.key) for _, _, work in group.retries)

    def take(self, task: str, now: float) -> Pending | None:
        """The next trial of `task`: a retry whose pause is over, or the longest; None if none."""
        group = self._groups[task]
        if group.retries and group.retries[0][0] <= now:
            return heapq.heappop(group.retries)[2]
        if not group.fresh:
            return None
        level = max(group.fresh, key=lambda n: (self.durations.expect(group.fresh[n][0].key), -n))
        pending = group.fresh[level]
        work = pending.popleft()
        if not pending:
            del group.fresh[level]
        return work

    def requeue(self, work: Pending, due: float) -> None:
        """Run `work` (as it is: the caller counts attempts), not before time `due`."""
        self._count += 1
        heapq.heappush(self._groups[work.key.task].retries, (due, self._count, work))

    def next_due(self, now: float) -> float | None:
        """When the next retry after `now` is due; None if there is none."""
        dues = [due for g in self._groups.values() for due, _, _ in g.retries if due > now]
        return min(dues, default=None)

    def settle(self) -> None:
        """One trial has its record."""
        self.unsettled -= 1
