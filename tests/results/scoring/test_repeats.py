"""Repeated trials are counted, and the worst that they may hide is bounded."""

from __future__ import annotations

from pathlib import Path

from fake_runs import trial_record

from robospa.results.records.manifest import RunManifest
from robospa.results.records.runs import Run, from_line, to_line
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.report.run_card import facts
from robospa.results.scoring.repeats import (
    FaultRate,
    fault_rates,
    many_policy_errors,
    policy_error_lines,
    repeat_lines,
    repeats_text,
    was_repeated,
    worst_case,
)
from robospa.trial import TrialKey

LOST = RetryRow("connection_lost", "the line went dead", 7)
AWAY = RetryRow("unreachable", "nobody listens")


def key(seed: int, level: int = 1) -> TrialKey:
    return TrialKey("Pick_Fake", level, seed)


def made(*records: TrialRecord) -> Run:
    return Run(
        Path("run"), RunManifest(), tuple(r.key for r in records), {r.key: r for r in records}
    )


def test_retries_survive_the_file_and_old_lines_have_none() -> None:
    record = trial_record(retries=(AWAY, LOST), attempts=3)
    assert from_line(to_line(record)) == record
    old = to_line(trial_record(attempts=3)).replace('"retries":[],', "")
    assert "retries" not in old
    assert from_line(old) == trial_record(attempts=3)


def test_a_trial_that_the_policy_never_got_was_not_repeated() -> None:
    assert was_repeated(trial_record(retries=(AWAY, LOST), attempts=3))
    assert not was_repeated(trial_record(retries=(AWAY,), attempts=2))
    assert was_repeated(trial_record(attempts=2))  # an older version: nobody knows why
    assert not was_repeated(trial_record())


def test_in_the_worst_case_every_repeated_trial_had_failed() -> None:
    run = made(
        trial_record(key(1), True),
        trial_record(key(2), True, retries=(LOST,), attempts=2),
        trial_record(key(3), True, retries=(AWAY,), attempts=2),
        trial_record(key(4), False, retries=(LOST,), attempts=2),
    )
    cell = worst_case(run).cells["Pick_Fake", 1]
    assert (cell.successes, cell.firsts) == (2, 2)


def test_rates_are_given_over_all_levels_and_for_each() -> None:
    run = made(
        trial_record(key(1), True, retries=(LOST, LOST), attempts=3),
        trial_record(key(2), end="policy_error"),
        trial_record(key(3, 2), True),
        trial_record(key(4, 2), end="infrastructure", retries=(LOST,)),
    )
    assert fault_rates(run.records.values()) == [
        FaultRate(0, 3, 1, 2, 1),
        FaultRate(1, 2, 1, 2, 1),
        FaultRate(2, 1, 0, 0, 0),
    ]


def test_policy_errors_are_grouped_without_their_numbers() -> None:
    errors = [
        trial_record(key(n), end="policy_error", message=f"nan in action {n}") for n in range(3)
    ]
    other = trial_record(key(9), end="policy_error", message="no camera")
    found = policy_error_lines(made(other, *errors))
    assert found == [
        "policy errors 4 of 4 (100.0 %; L1 100.0 %)",
        "policy error 3: nan in action 0",
        "policy error 1: no camera",
    ]
    card = dict(facts(made(other, *errors)))
    assert card["policy errors"].endswith("L1 100.0 %); 3 nan in action 0; 1 no camera")
    assert policy_error_lines(made(trial_record())) == []


def test_half_of_all_trials_in_policy_errors_is_a_failed_run() -> None:
    error, sound = trial_record(key(1), end="policy_error"), trial_record(key(2))
    assert "1 of 2 trials ended in a policy error" in many_policy_errors(made(error, sound))
    assert many_policy_errors(made(error, sound, trial_record(key(3)))) == ""
    assert many_policy_errors(made()) == ""


def test_repeated_trials_are_told_with_level_cause_and_worst_case() -> None:
    run = made(
        trial_record(key(1), True, retries=(LOST, LOST), attempts=3),
        trial_record(key(2), True),
        trial_record(key(3, 3)),
    )
    assert repeats_text(run) == "1 of 3 (33.3 %; L1 50.0 %): 2 connection lost"
    (line,) = repeat_lines(run)
    assert (
        "1 of 3 trials would be successes instead of 2, 1 by the first choice instead of 2" in line
    )
    assert repeat_lines(made(trial_record())) == []


def test_attempts_of_an_older_version_have_no_cause() -> None:
    assert repeats_text(made(trial_record(attempts=2))).endswith(": 1 unknown (an older version)")
