"""Trials that were run again, and what that may have done to the score.

A fault within a trial (a lost connection, a missed deadline, a dead worker) repeats the trial. That
is fair only as long as faults do not depend on how a trial goes, and a policy can bring about most
of them: it may drop the connection whenever it is about to fail. So rates are shown, and
`worst_case` says what is left if every repeated trial had failed in its first attempt.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from robospa.results.records.run_io import Run, finished
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.scoring.scores import Scores, score
from robospa.results.statistics.intervals import METHODS
from robospa.trial import TrialKey


def reached_policy(row: RetryRow) -> bool:
    """Whether the policy may have had the trial in this attempt, and so may have ended it."""
    return row.cause != "unreachable"


def repeats(record: TrialRecord) -> int:
    """In how many attempts before its last the policy may have had the trial. Records of
    older versions give no causes: all their attempts count."""
    return sum(map(reached_policy, record.retries)) if record.retries else record.attempts - 1


def was_repeated(record: TrialRecord) -> bool:
    """Whether the policy may have had the trial more than once."""
    return repeats(record) > 0


def with_repeated_failed(
    records: Mapping[TrialKey, TrialRecord],
) -> dict[TrialKey, TrialRecord]:
    """`records`, but every result of a repeated trial is a failure without any progress."""
    return {
        key: replace(record, end="policy_error", success=False, done=0, best=0)
        if finished(record) and was_repeated(record)
        else record
        for key, record in records.items()
    }


def worst_case(run: Run, ci: str = METHODS[0]) -> Scores:
    """The scores of `run` if every repeated trial had failed. What missing trials leave open is in
    `VariantScore.worst` and `AverageScore.worst`, as always."""
    return score(run.keys, with_repeated_failed(run.records), run.manifest.categories, ci)


MOST_REPEATED = 0.01
"""More repeated trials of a run than this share are an error: as failures they would move its score
by more than a point, about the interval of a whole category."""
MOST_AT_LEVEL = 0.03
"""The same of a level. Higher, because workers are at one task at a time: a single crash of a
server repeats as many trials of one level as there are workers."""
NOTED = 0.002
"""A share that is worth a look."""
FEW = 2
"""So many never are an error: of few trials they are a large share."""


@dataclass(frozen=True)
class FaultRate:
    """Of `results` at `level` (0: at all levels), how many are of `repeated` trials and how many
    `policy_errors`; `attempts` did not count."""

    level: int
    results: int
    repeated: int
    attempts: int
    policy_errors: int

    @property
    def too_many(self) -> bool:
        """Whether so many trials were repeated that the score cannot be relied on."""
        share = MOST_AT_LEVEL if self.level else MOST_REPEATED
        return self.repeated > max(FEW, share * self.results)


def fault_rates(records: Iterable[TrialRecord]) -> list[FaultRate]:
    """The rate over all results in `records`, then that of every level."""
    results = [record for record in records if finished(record)]
    levels = sorted({record.key.level for record in results})
    return [_rate(0, results)] + [
        _rate(level, [r for r in results if r.key.level == level]) for level in levels
    ]


def _rate(level: int, results: list[TrialRecord]) -> FaultRate:
    return FaultRate(
        level,
        len(results),
        sum(map(was_repeated, results)),
        sum(map(repeats, results)),
        sum(record.end == "policy_error" for record in results),
    )
