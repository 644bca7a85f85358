"""What a driver notices: a policy that always fails alike, or speaks another language."""

from fake_runs import record, trial_record

from robospa.harness.running.attempts import FIRST, IN_A_ROW, ErrorVerdict, ErrorWatch, ProblemWatch
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey


def key(seed: int, task: str = "Pick_A") -> TrialKey:
    return TrialKey(task, 1, seed)


def error(seed: int, message: str = "no camera 'wrist'", task: str = "Pick_A") -> TrialRecord:
    return trial_record(key(seed, task), end="policy_error", message=message)


def watch(*records: TrialRecord, known: tuple[TrialRecord, ...] = ()) -> list[ErrorVerdict]:
    watching = ErrorWatch()
    watching.know(known)
    found = [watching.add(record, "ws://a") for record in records]
    return [verdict for verdict in found if verdict is not None]


def test_the_first_trials_of_a_task_stop_the_run_and_are_withdrawn() -> None:
    records = [
        error(n, f"the policy answered nan in action {n}, dimension 3") for n in range(FIRST)
    ]
    (verdict,) = watch(*records)
    assert verdict.withdrawn == tuple(records)
    assert verdict.text.startswith(f"the first {FIRST} trials of Pick_A all ended in the same")
    assert "nan in action 4" in verdict.text and "--policy-errors count" in verdict.text


def test_a_task_that_fails_after_others_that_work_stops_too() -> None:
    (verdict,) = watch(trial_record(key(99, "Pick_B")), *map(error, range(FIRST)))
    assert len(verdict.withdrawn) == FIRST


def test_one_trial_that_ends_otherwise_keeps_the_task_going() -> None:
    sound = trial_record(key(99))
    assert watch(sound, *map(error, range(IN_A_ROW - 1))) == []
    assert watch(*map(error, range(FIRST)), known=(sound,)) == []


def test_different_errors_are_no_pattern() -> None:
    assert watch(*(error(n, f"problem {'abcdefgh'[n]}") for n in range(8))) == []


def test_a_run_of_few_trials_a_task_stops_as_well() -> None:
    (verdict,) = watch(*(error(1, task=f"Pick_{n}") for n in range(FIRST)))
    assert verdict.text.startswith(f"the first {FIRST} trials all ended")
    assert len(verdict.withdrawn) == FIRST


def test_a_server_that_breaks_later_stops_the_run_and_its_failures_count() -> None:
    (verdict,) = watch(trial_record(key(99)), *map(error, range(IN_A_ROW)))
    assert verdict.withdrawn == ()


def test_lost_trials_say_nothing_of_the_policy() -> None:
    lost = trial_record(key(5), end="infrastructure")
    (verdict,) = watch(*(r for n in range(FIRST) for r in (error(n), lost)))
    assert len(verdict.withdrawn) == FIRST


def watched(actions: int, end: str = "step_limit") -> list[list[str]]:
    """What is said after each of seven trials of 130 actions, so many of them out of reach."""
    watch = ProblemWatch()
    found = {"unreachable_actions": actions, "first_unreachable": "action 1: left pose"}
    more = {"end": end, "steps": 130, "diagnostics": found}
    return [watch.add(record("Pick_Blocks_Size", 1, seed, 0, **more)) for seed in range(7)]


def test_many_unreachable_actions_are_said_once_after_five_trials() -> None:
    said = watched(128)
    assert [len(lines) for lines in said] == [0, 0, 0, 0, 1, 0, 0]
    assert said[4][0].startswith(
        "warning: in the first 5 trials 640 of 650 actions (98 %) ask for a pose out of reach"
    )
    assert "are poses in the world frame" in said[4][0] and "action 1: left pose" in said[4][0]
