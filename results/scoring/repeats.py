"""Trials that were run again, and what that may have done to the score.

A fault within a trial (a lost connection, a missed deadline, a dead worker) repeats the trial. That
is fair only as long as faults do not depend on how a trial goes, and a policy can bring about most
of them: it may drop the connection whenever it is about to fail. So rates are shown, and
`worst_case` says what is left if every repeated trial had failed in its first attempt.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from robospa.results.records.action_problems import grouped
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.scoring.first_choice import first_choice
from robospa.results.scoring.scores import Scores, score
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


def worst_case(run: Run) -> Scores:
    """The scores of `run` if every repeated trial had failed. What missing trials leave open is in
    their `bounds`, as always."""
    return score(run.keys, with_repeated_failed(run.records), run.manifest.categories)


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
    rates = []
    for level in (0, *levels):
        found = [record for record in results if level in (0, record.key.level)]
        errors = sum(record.end == "policy_error" for record in found)
        counts = (sum(map(was_repeated, found)), sum(map(repeats, found)), errors)
        rates.append(FaultRate(level, len(found), *counts))
    return rates


CAUSES = {"policy_error": "withdrawn policy error"}
"""Causes that are called something else in a sentence."""


def policy_errors(run: Run) -> list[tuple[int, str]]:
    """How many trials ended in a policy error for which reason, the most frequent first."""
    return grouped(r.message for r in run.records.values() if r.end == "policy_error")


def policy_error_lines(run: Run) -> list[str]:
    """How many trials ended in a policy error, at which levels; then one sentence a reason."""
    text = error_rates_text(run)
    lines = [f"policy error {count}: {reason}" for count, reason in policy_errors(run)]
    return [f"policy errors {text}", *lines] if text else []


def error_rates_text(run: Run) -> str:
    """`40 of 2800 (1.4 %; L3 7.1 %)`: trials that ended in a policy error; empty if none did."""
    rates = fault_rates(run.records.values())
    return rates_text([(r.level, r.policy_errors, r.results) for r in rates])


def repeats_text(run: Run) -> str:
    """How many trials were repeated after a fault, at which levels and why; empty if none was."""
    rates = fault_rates(run.records.values())
    text = rates_text([(r.level, r.repeated, r.results) for r in rates])
    return f"{text}: {causes_text(run)}" if text else ""


def repeat_lines(run: Run) -> list[str]:
    """The same as a sentence, with what it may hide."""
    text = repeats_text(run)
    if not text:
        return []
    cells = worst_case(run).cells.values()
    left, first = (sum(cell.count(m) or 0 for cell in cells) for m in ("sr", "sr1"))
    results, records = sum(cell.trials for cell in cells), run.records.values()
    return [
        f"repeated after a fault {text}; if all of them had failed, {left} of {results} trials "
        f"would be successes instead of {sum(r.success for r in records)}, {first} by the first "
        f"choice instead of {sum(map(first_choice, records))}"
    ]


def rates_text(rates: Sequence[tuple[int, int, int]]) -> str:
    """`16 of 2800 (0.6 %; L3 2.1 %, L5 0.7 %)` for rows of level, count and trials, the first of
    which is of all levels; empty if that counts none."""
    (_, count, trials), *levels = rates
    if not count:
        return ""
    parts = [f"L{level} {100 * n / of:.1f} %" for level, n, of in levels if n]
    return f"{count} of {trials} ({100 * count / trials:.1f} %; {', '.join(parts)})"


def causes_text(run: Run) -> str:
    """`12 connection lost, 4 deadline`: attempts of trials with a result that did not count."""
    counts = Counter(
        CAUSES.get(row.cause, row.cause.replace("_", " "))
        for record in run.records.values()
        if finished(record)
        for row in record.retries
        if reached_policy(row)
    )
    found = [f"{count} {cause}" for cause, count in counts.most_common()]
    unknown = sum(was_repeated(r) and not r.retries for r in run.records.values() if finished(r))
    if unknown:
        found.append(f"{unknown} unknown (an older version)")
    return ", ".join(found)


def many_policy_errors(run: Run) -> str:
    """A sentence if at least half of all results are policy errors; empty otherwise."""
    whole = fault_rates(run.records.values())[0]
    if not whole.results or 2 * whole.policy_errors < whole.results:
        return ""
    return (
        f"{whole.policy_errors} of {whole.results} trials ended in a policy error: check the "
        "policy's server and its options"
    )
