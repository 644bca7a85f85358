"""Workers that do not advance are replaced; those that wait for a server, or compute, are not."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from run_fakes import FakePolicy, KeyedPolicy

from robospa.harness.running.executor import Activity, Heartbeat
from robospa.harness.running.heartbeat import HeartbeatMonitor, HeartbeatSender, MonitoredPolicy
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.protocol.errors import PolicyError
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEYS = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(3)]


def after(*beats: tuple[float, int, Activity]) -> float:
    """The deadline of a monitor of 10 s that began at 0 and received `beats`."""
    monitor = HeartbeatMonitor(0.0, 10.0)
    for when, count, activity in beats:
        monitor.receive(Heartbeat(count, activity), when)
    return monitor.deadline


@pytest.mark.parametrize(
    ("beats", "deadline"),
    [
        ([], 10.0),
        ([(3.0, 1, "simulating")], 13.0),
        ([(3.0, 1, "simulating"), (9.0, 1, "simulating")], 13.0),
        ([(3.0, 1, "simulating"), (9.0, 2, "simulating")], 19.0),
        ([(3.0, 1, "waiting"), (9.0, 1, "waiting")], 19.0),
        ([(3.0, 1, "in_policy")], float("inf")),
        ([(3.0, 1, "in_policy"), (99.0, 2, "simulating")], 109.0),
    ],
)
def test_what_counts_as_advancing(
    beats: list[tuple[float, int, Activity]], deadline: float
) -> None:
    assert after(*beats) == deadline


def test_a_call_of_the_policy_is_announced_only_where_it_could_stop_the_heartbeats() -> None:
    sent: list[Heartbeat] = []
    for target, states in (("ws://h:1", []), ("hold", ["in_policy", "simulating"])):
        sent.clear()
        MonitoredPolicy(FakePolicy(), target, HeartbeatSender(sent.append)).infer({})
        assert [beat.activity for beat in sent] == states


class Telling(FakePolicy):
    """Has what a policy may have beside its three calls."""

    def __init__(self) -> None:
        super().__init__()
        self.hello = {"dialect": "fake"}
        self.last_timing = {"infer_ms": 2.0}

    def end(self, outcome: Mapping[str, Any]) -> None:
        self.seen.append(dict(outcome))


def test_what_a_policy_may_have_is_passed_on_and_what_it_lacks_does_nothing() -> None:
    policy = Telling()
    monitored = MonitoredPolicy(policy, "hold", HeartbeatSender())
    monitored.end({"success": True})
    assert (monitored.spec, monitored.hello) == (policy.spec, policy.hello)
    assert (monitored.last_timing, policy.seen) == (policy.last_timing, [{"success": True}])
    plain = MonitoredPolicy(FakePolicy(), "hold", HeartbeatSender())
    plain.end({})
    plain.reconnect()
    plain.close()
    assert (plain.hello, plain.last_timing) == ({}, {})


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
    assert len(notes) == 1 and "did not advance for 2.5 s and was killed; trying again" in notes[0]


class Thoughtful(KeyedPolicy):
    """Takes longer over one answer than a worker may be stuck."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        assert self.trial is not None
        if self.seed == 100001 and observation["step"] == 0:
            time.sleep(3.5)
        return super().infer(observation)


def test_a_policy_inside_the_worker_may_think_for_longer(tmp_path: Path) -> None:
    records, notes = go(tmp_path, "test_heartbeat:Thoughtful", "run_fakes:FakeWorld")
    assert sorted(r.key for r in records) == KEYS and notes == []


def test_an_exception_of_a_policy_in_this_process_is_the_policys_error() -> None:
    class Wrong(FakePolicy):
        def infer(self, observation: object) -> None:
            raise ValueError("no camera")

    monitored = MonitoredPolicy(Wrong(), "hold", HeartbeatSender())
    with pytest.raises(PolicyError, match=r"^ValueError: no camera \(test_heartbeat\.py:"):
        monitored.infer({})
    assert monitored.failed
    remote = MonitoredPolicy(Wrong(), "ws://h:1", HeartbeatSender())
    with pytest.raises(ValueError, match="no camera"):  # of our client: no error of the policy
        remote.infer({})
    assert not remote.failed
