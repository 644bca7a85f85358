"""Lint of faults: trials that were repeated, and trials that ended in a policy error.

A repeated trial is one more chance, and a policy can bring it about, so many of them are an error:
no bundle is made of such a run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robospa.results.records.finding import Finding
from robospa.results.records.reasons import grouped
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.retried import (
    FEW,
    MOST_AT_LEVEL,
    MOST_REPEATED,
    NOTED,
    FaultRate,
    fault_rates,
)

MANY_ERRORS = 0.05
"""Share of policy errors that asks for a look."""


def lint_faults(results: Sequence[TrialRecord], name: str) -> Iterator[Finding]:
    """Findings in the `results` of the run called `name`."""
    whole, *levels = fault_rates(results)
    bad = [rate for rate in (whole, *levels) if rate.too_many]
    for rate in bad:
        most = MOST_AT_LEVEL if rate.level else MOST_REPEATED
        text = (
            f"{_counted(rate)}, more than {100 * most:g} % (or {FEW}): each had another chance "
            "after a fault that its policy may have caused"
        )
        yield Finding("repeated-trials", "error", name, text)
    if not bad and whole.repeated > NOTED * whole.results:
        text = f"{_counted(whole)}: each had another chance after a fault"
        yield Finding("repeated-trials", "warning", name, text)
    if whole.policy_errors > MANY_ERRORS * whole.results:
        errors = [record.message for record in results if record.end == "policy_error"]
        count, reason = grouped(errors)[0]
        text = (
            f"{len(errors)} of {len(results)} trials ended in a policy error, {count} of them: "
            f"{reason}"
        )
        yield Finding("policy-errors", "warning", name, text)


def _counted(rate: FaultRate) -> str:
    where = f" at level {rate.level}" if rate.level else ""
    return f"{rate.repeated} of {rate.results} trials{where} were repeated"
