"""Lint of repeated trials and policy errors: when to look at a run, and when it is refused."""

from __future__ import annotations

import pytest
from fake_runs import trial_record

from robospa.results.lint import lint_faults
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey

LOST = {"retries": (RetryRow("deadline"),), "attempts": 2}


def results(count: int, repeated: int, level: int = 1) -> list[TrialRecord]:
    return [
        trial_record(TrialKey("Pick_Fake", level, n), **(LOST if n < repeated else {}))
        for n in range(count)
    ]


def severities(records: list[TrialRecord]) -> list[str]:
    return [finding.severity for finding in lint_faults(records, "run")]


@pytest.mark.parametrize(
    ("count", "repeated", "found"),
    [
        (1000, 2, []),
        (1000, 3, ["warning"]),
        (1000, 10, ["warning"]),
        (1000, 11, ["error"]),
        (24, 2, ["warning"]),
        (24, 3, ["error", "error"]),  # of the run and of the level
    ],
)
def test_repeated_trials_are_bounded(count: int, repeated: int, found: list[str]) -> None:
    assert severities(results(count, repeated)) == found


def test_one_crash_of_a_server_is_no_error_of_its_level() -> None:
    sound = [r for level in (2, 3, 4, 5) for r in results(560, 0, level)]
    assert severities([*results(560, 16), *sound]) == ["warning"]
    assert severities([*results(560, 18), *sound]) == ["error"]


def test_many_policy_errors_ask_for_a_look_and_name_the_reason() -> None:
    broken = [
        trial_record(TrialKey("Pick_Fake", 1, n), end="policy_error", message=f"nan in {n}")
        for n in range(3)
    ]
    (finding,) = lint_faults([*results(50, 0)[10:], *broken], "run")
    assert str(finding) == (
        "warning: run: 3 of 43 trials ended in a policy error, 3 of them: nan in 0 [policy-errors]"
    )
    assert severities([*results(100, 0)[10:], *broken]) == []


def test_nothing_is_found_in_an_empty_run() -> None:
    assert severities([]) == []
