"""More workers than cores only as long as that helps."""

import pytest
from fake_runs import trial_record

from robospa.harness.running.status import Autoscaler, most_workers
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 1, 1)


def run_round(scaler: Autoscaler, waiting: float, trials: int | None = None) -> None:
    """A round of trials of 1 s each in which a process did nothing for `waiting`."""
    record = trial_record(KEY, True, timing={"processor": 1.0 - waiting})
    for _ in range(trials or scaler.target):
        scaler.add(record)


@pytest.mark.parametrize(
    ("waiting", "saturated", "more"),
    [(0.05, False, 0), (0.4, False, 1), (0.07, False, 0), (0.95, True, 0)],
)
def test_workers_that_wait_for_a_server_with_room_leave_room_for_others(
    waiting: float, saturated: bool, more: int
) -> None:
    scaler = Autoscaler(2, 16, cores=2)
    run_round(scaler, waiting)
    assert scaler.scale_up(saturated) == more


def test_they_come_in_steps_up_to_the_most() -> None:
    scaler = Autoscaler(2, 10, cores=2)
    grown = []
    for _ in range(5):
        run_round(scaler, 0.95)
        scaler.scale_up(saturated=False)
        grown.append(scaler.target)
    assert grown == [4, 8, 10, 10, 10]


def test_a_review_takes_a_whole_round() -> None:
    scaler = Autoscaler(4, 16, cores=4)
    run_round(scaler, 0.9, trials=3)
    assert scaler.scale_up(saturated=False) == 0
    run_round(scaler, 0.9, trials=1)
    assert scaler.scale_up(saturated=False) > 0


def test_memory_and_cores_bound_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robospa.harness.running.status.cores", lambda: 4)
    monkeypatch.setattr("pathlib.Path.read_text", lambda self: "MemAvailable: 8000000 kB\n")
    assert most_workers() == 10
    monkeypatch.setattr("pathlib.Path.read_text", lambda self: "MemAvailable: 900000000 kB\n")
    assert most_workers() == 32
    monkeypatch.setattr("pathlib.Path.read_text", lambda self: "MemAvailable: 1000 kB\n")
    assert most_workers() == 4
