"""What a summary says of policy errors and of repeated trials."""

from __future__ import annotations

from pathlib import Path

from fake_runs import trial_record

from robospa.results.records.manifest import RunManifest
from robospa.results.records.runs import Run
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.report.run_card import facts
from robospa.results.scoring.repeats import (
    many_policy_errors,
    policy_error_lines,
    repeat_lines,
    repeats_text,
)
from robospa.trial import TrialKey

LOST = RetryRow("connection_lost", "the line went dead")


def run_of(*records: TrialRecord) -> Run:
    return Run(
        Path("run"), RunManifest(), tuple(r.key for r in records), {r.key: r for r in records}
    )


def key(seed: int, level: int = 1) -> TrialKey:
    return TrialKey("Pick_Fake", level, seed)


def test_policy_errors_are_grouped_without_their_numbers() -> None:
    errors = [
        trial_record(key(n), end="policy_error", message=f"nan in action {n}") for n in range(3)
    ]
    other = trial_record(key(9), end="policy_error", message="no camera")
    found = policy_error_lines(run_of(other, *errors))
    assert found == [
        "policy errors 4 of 4 (100.0 %; L1 100.0 %)",
        "policy error 3: nan in action 0",
        "policy error 1: no camera",
    ]
    card = dict(facts(run_of(other, *errors)))
    assert card["policy errors"].endswith("L1 100.0 %); 3 nan in action 0; 1 no camera")
    assert policy_error_lines(run_of(trial_record())) == []


def test_half_of_all_trials_in_policy_errors_is_a_failed_run() -> None:
    error, sound = trial_record(key(1), end="policy_error"), trial_record(key(2))
    assert "1 of 2 trials ended in a policy error" in many_policy_errors(run_of(error, sound))
    assert many_policy_errors(run_of(error, sound, trial_record(key(3)))) == ""
    assert many_policy_errors(run_of()) == ""


def test_repeated_trials_are_told_with_level_cause_and_worst_case() -> None:
    run = run_of(
        trial_record(key(1), True, retries=(LOST, LOST), attempts=3),
        trial_record(key(2), True),
        trial_record(key(3, 3)),
    )
    assert repeats_text(run) == "1 of 3 (33.3 %; L1 50.0 %): 2 connection lost"
    (line,) = repeat_lines(run)
    assert line.endswith("if all of them had failed, 1 of 3 trials would be successes instead of 2")
    assert repeat_lines(run_of(trial_record())) == []


def test_attempts_of_an_older_version_have_no_cause() -> None:
    assert repeats_text(run_of(trial_record(attempts=2))).endswith(": 1 unknown (an older version)")
