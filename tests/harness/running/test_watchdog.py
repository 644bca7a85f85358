"""Workers that do not get on are replaced; those that wait for a server, or compute, are not."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from run_fakes import FakePolicy

from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.watchdog import ASKING, INSIDE, WORKING, Attended, Beat, Pulse, Watch
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEYS = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(3)]


def after(*beats: tuple[float, int, str]) -> float:
    """The deadline of a watch of 10 s that began at 0 and heard `beats`."""
    watch = Watch(0.0, 10.0)
    for when, number, state in beats:
        watch.heard(("beat", number, state), when)
    return watch.deadline


@pytest.mark.parametrize(
    ("beats", "deadline"),
    [
        ([], 10.0),
        ([(3.0, 1, WORKING)], 13.0),
        ([(3.0, 1, WORKING), (9.0, 1, WORKING)], 13.0),
        ([(3.0, 1, WORKING), (9.0, 2, WORKING)], 19.0),
        ([(3.0, 1, ASKING), (9.0, 1, ASKING)], 19.0),
        ([(3.0, 1, INSIDE)], float("inf")),
        ([(3.0, 1, INSIDE), (99.0, 2, WORKING)], 109.0),
    ],
)
def test_what_counts_as_getting_on(beats: list[tuple[float, int, str]], deadline: float) -> None:
    assert after(*beats) == deadline


def test_the_time_for_which_the_driver_was_stopped_does_not_count() -> None:
    watch = Watch(0.0, 10.0)
    watch.forgive(600.0)
    assert watch.deadline == 610.0


def test_a_call_of_the_policy_is_announced_only_where_it_could_keep_the_pulse_from_beating() -> (
    None
):
    sent: list[Beat] = []
    for target, states in (("ws://h:1", []), ("hold", [INSIDE, WORKING])):
        sent.clear()
        Attended(FakePolicy(), target, Pulse(sent.append)).infer({})
        assert [state for _, _, state in sent] == states


def test_an_attended_policy_is_the_policy_in_everything_else() -> None:
    policy = Attended(FakePolicy(), "hold", Pulse())
    assert policy.spec.name == "fake" and policy.length == 2
    assert getattr(policy, "reconnect", None) is None


def go(folder: Path, policy: str, world: str) -> tuple[list[TrialRecord], list[str]]:
    records: list[TrialRecord] = []
    notes: list[str] = []
    config = WorkerConfig(folder, policy, world=world, parts="run_fakes:parts")
    options = RunOptions(workers=1, backoff=0.01, stuck_seconds=2.5)
    Runner(config, KEYS, options, records.append, notes.append).run()
    return records, notes


def test_a_worker_stuck_in_native_code_is_ended_and_its_trial_handed_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = tmp_path / "mark"
    mark.touch()
    monkeypatch.setenv("SOAK_STUCK", str(mark))
    records, notes = go(tmp_path / "run", "run_fakes:FakePolicy", "soak_fakes:SoakWorld")
    assert sorted(r.key for r in records) == KEYS
    assert sorted(r.attempts for r in records) == [1, 1, 2]
    assert len(notes) == 1 and "did not get on for 2.5 s and was killed; trying again" in notes[0]


class Thoughtful(FakePolicy):
    """Takes longer over one answer than a worker may be stuck."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        assert self.trial is not None
        if self.trial.seed == 100001 and observation["step"] == 0:
            time.sleep(3.5)
        return super().infer(observation)


def test_a_policy_inside_the_worker_may_think_for_longer(tmp_path: Path) -> None:
    records, notes = go(tmp_path, "test_watchdog:Thoughtful", "run_fakes:FakeWorld")
    assert sorted(r.key for r in records) == KEYS and notes == []
