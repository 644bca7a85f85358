"""Sentences on the policy errors and the repeated trials of a run, with the reasons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from robospa.results.records.reasons import grouped
from robospa.results.records.run_io import Run, finished
from robospa.results.scoring.retried import (
    fault_rates,
    reached_policy,
    was_repeated,
    worst_case,
)

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
    failed = sum(cell.successes for cell in cells)
    results = sum(cell.trials for cell in cells)
    now = sum(r.success for r in run.records.values())
    return [
        f"repeated after a fault {text}; if all of them had failed, {failed} of {results} trials "
        f"would be successes instead of {now}"
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
        f"{whole.policy_errors} of {whole.results} trials ended in a policy error: these numbers "
        "say more about the policy's server or its options than about the policy"
    )
