"""A worker that holds several trials: one computes while the others wait for their servers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_runs import trial_record
from numpy.typing import NDArray
from run_fakes import SPEC, FakePolicy, FakeWorld, fake_config, parts, trial_keys

from robospa.harness.policy_calls import Stopwatch
from robospa.harness.running.executor import (
    Activity,
    Command,
    Executor,
    Heartbeat,
    Message,
    RunTrial,
    TrialDone,
    WorkerHandle,
    WorkerReady,
)
from robospa.harness.running.heartbeat import (
    ComputeLock,
    HeartbeatMonitor,
    HeartbeatSender,
    MonitoredPolicy,
)
from robospa.harness.running.record_store import RecordWriter
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig, _hold
from robospa.harness.trial import run_trial
from robospa.harness.world import Poll, StepResult
from robospa.protocol.connection_limits import ServerOptions
from robospa.protocol.errors import PolicyError
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Timeouts
from robospa.results.records.runs import differences, read_records
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEYS = trial_keys(6)


# --- workers without processes: real ones in threads, and scripted ones that die when told to


class LoneWorld(FakeWorld):
    """Lets other threads run within a step, and fails if one of them is within a step too."""

    busy = False

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        assert not LoneWorld.busy, "two worlds of one worker computed at once"
        LoneWorld.busy = True
        time.sleep(0)
        done = super().step(action, space, poll)
        LoneWorld.busy = False
        return done


@dataclass
class ThreadPlace(WorkerHandle):
    """A place for a trial in a thread of this process."""

    name: str
    pipe: Connection
    spare: list[Connection] = field(default_factory=list)

    def another_trial(self) -> ThreadPlace | None:
        return ThreadPlace(self.name, self.spare.pop()) if self.spare else None

    def send(self, command: Command) -> None:
        self.pipe.send(command)

    def messages(self) -> list[Message]:
        found = []
        while self.pipe.poll():
            found.append(self.pipe.recv())
        return found

    def exit_status(self) -> str | None:
        return None

    def kill(self) -> None: ...

    def join(self, seconds: float) -> None: ...

    def close(self) -> None:
        for pipe in (self.pipe, *self.spare):
            pipe.close()


class ThreadExecutor(Executor):
    """One worker whose places are threads; `ended` of them have ended when it is closed."""

    def __init__(self, config: WorkerConfig, concurrent_trials: int) -> None:
        self.config, self.concurrent_trials = config, concurrent_trials
        self.threads: list[threading.Thread] = []
        self.ended = 0

    def capacity(self) -> int:
        return 1

    def start(self, name: str) -> ThreadPlace:
        lock, writer = threading.Lock(), RecordWriter(self.config.folder)
        pipes = []
        for _ in range(self.concurrent_trials):
            ours, theirs = Pipe()
            pipes.append(ours)
            turn = ComputeLock(lock) if self.concurrent_trials > 1 else None
            arguments = (theirs, self.config, writer, turn)
            self.threads.append(threading.Thread(target=_hold, args=arguments, daemon=True))
            self.threads[-1].start()
        return ThreadPlace(name, pipes[0], pipes[1:])

    def wait(self, workers: Sequence[Any], seconds: float) -> None:
        wait([worker.pipe for worker in workers], timeout=seconds)

    def close(self) -> None:
        for thread in self.threads:
            thread.join(10.0)
            self.ended += not thread.is_alive()


@dataclass
class ScriptedWorker:
    """A worker of the driver's: what its places run, and whether it has died."""

    running: dict[int, TrialKey] = field(default_factory=dict)
    """Trials by place."""
    dead: bool = False


@dataclass
class ScriptedPlace(WorkerHandle):
    name: str
    worker: ScriptedWorker
    number: int
    most: int
    inbox: list[Message] = field(default_factory=lambda: [WorkerReady(None)])
    used: list[int] = field(default_factory=lambda: [1])

    def another_trial(self) -> ScriptedPlace | None:
        if self.used[0] == self.most:
            return None
        self.used[0] += 1
        return ScriptedPlace(self.name, self.worker, self.used[0] - 1, self.most)

    def send(self, command: Command) -> None:
        if isinstance(command, RunTrial):
            self.worker.running[self.number] = command.key

    def messages(self) -> list[Message]:
        found, self.inbox = self.inbox, []
        return found

    def exit_status(self) -> str | None:
        return "signal 11" if self.worker.dead else None

    def kill(self) -> None:
        self.worker.dead = True

    def join(self, seconds: float) -> None: ...

    def close(self) -> None: ...


class ScriptedExecutor(Executor):
    """One worker at a time, which dies of the trials that `deadly` names and does all others."""

    def __init__(self, concurrent_trials: int, deadly: Callable[[TrialKey], bool]) -> None:
        self.concurrent_trials, self.deadly = concurrent_trials, deadly
        self.together: list[set[int]] = []
        """Seeds that a worker had at once, whenever it was looked at."""

    def capacity(self) -> int:
        return 1

    def start(self, name: str) -> ScriptedPlace:
        return ScriptedPlace(name, ScriptedWorker(), 0, self.concurrent_trials)

    def wait(self, workers: Sequence[Any], seconds: float) -> None:
        """Whoever can take another trial has it by now: let the worker die or finish."""
        if not workers or any(place.inbox for place in workers):
            return
        worker: ScriptedWorker = workers[0].worker
        if (
            len(workers) < self.concurrent_trials
            and len(worker.running) == 1
            and len(self.together) == 0
        ):
            return  # its other places are still being made
        if not worker.running:
            time.sleep(min(seconds, 0.001))
            return
        self.together.append({key.seed for key in worker.running.values()})
        if any(map(self.deadly, worker.running.values())):
            worker.dead = True
            return
        for place in workers:
            if (key := worker.running.pop(place.number, None)) is not None:
                place.inbox.append(TrialDone(trial_record(key, True)))

    def close(self) -> None: ...


class Site(ServerThread):
    """A server with a policy object a connection; an answer waits until `meet` trials want one."""

    def __init__(self, meet: int = 1, **options: Any) -> None:
        self.calls: list[list[str]] = []
        """Of every connection, the calls in their order."""
        self.at_once = self.most = 0
        barrier = threading.Barrier(meet)
        met = threading.Event()
        site = self

        class Noting(FakePolicy):
            def __init__(self) -> None:
                super().__init__(SPEC, length=1)
                self.calls: list[str] = []
                site.calls.append(self.calls)

            def reset(self, trial: TrialInfo) -> None:
                super().reset(trial)
                self.calls.append(f"reset {trial.instruction[-1]}")

            def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
                self.calls.append(f"infer {observation['instruction'][-1]}")
                if not met.is_set():
                    barrier.wait(30.0)
                    met.set()
                return super().infer(observation)

        super().__init__(policy_factory=Noting, options=ServerOptions(threads=meet, **options))


def run(
    folder: Path, site: Site, concurrent_trials: int
) -> tuple[dict[TrialKey, TrialRecord], list[str], ThreadExecutor]:
    folder.mkdir()
    notes: list[str] = []
    options = {"timeouts": Timeouts(wait=0.0, connect=5.0)}
    config = fake_config(folder, site.url, options=options, world="test_held_trials:LoneWorld")
    executor = ThreadExecutor(config, concurrent_trials)
    limits = RunOptions(backoff=0.01, concurrent_trials=concurrent_trials)
    Runner(config, KEYS, limits, on_note=notes.append, executor=executor).run()
    return read_records(folder), notes, executor


def test_trials_of_one_worker_overlap_and_their_records_are_those_of_trials_alone(
    tmp_path: Path,
) -> None:
    """The first answer comes when two trials ask; worlds never compute at once."""
    with Site(meet=2) as site:
        records, notes, executor = run(tmp_path / "run", site, concurrent_trials=2)
    assert sorted(records) == KEYS and notes == []
    for key, record in records.items():
        alone = run_trial(FakeWorld(), FakePolicy(SPEC, 1), key, policy_seed=0, parts=parts)
        assert [x for x in differences(alone, record) if x != "policy_seed"] == []
        assert (record.attempts, record.latency["p50"] > 0) == (1, True)
        assert record.timing["queueing"] >= 0 and record.timing["processor"] > 0
    assert executor.ended == 2  # Stop came to both places


def test_a_server_with_room_for_one_connection_loses_no_trial(tmp_path: Path) -> None:
    """Nothing is charged to the trial that found no place, and nobody tries again."""
    with Site(max_connections=1, patience=0.05) as site:
        records, notes, _ = run(tmp_path / "run", site, concurrent_trials=3)
    assert sorted(records) == KEYS
    assert [(r.success, r.attempts, r.retries) for r in records.values()] == [(True, 1, ())] * 6
    assert len(notes) == 1
    assert notes[0].startswith("workers hold one trial each from now on, since one more could not")


def test_after_the_death_of_a_worker_its_trials_have_the_next_one_to_themselves(
    tmp_path: Path,
) -> None:
    deadly = KEYS[0]
    executor = ScriptedExecutor(2, lambda key: key == deadly)
    records: dict[TrialKey, TrialRecord] = {}
    Runner(
        fake_config(tmp_path, "ws://h:1"),
        KEYS[:3],
        RunOptions(backoff=0.001, concurrent_trials=2),
        lambda record: records.update({record.key: record}),
        executor=executor,
    ).run()
    assert {0, 1} <= {seed - 100000 for seed in executor.together[0]}
    alone = [seeds for seeds in executor.together[1:] if deadly.seed in seeds]
    assert alone == [{deadly.seed}] * 2
    assert records[deadly].end == "infrastructure" and len(records[deadly].retries) == 3
    assert records[KEYS[1]].success and records[KEYS[2]].success


def test_the_wait_for_another_trial_is_no_time_of_the_policy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])

    class Slow:
        """A lock that another trial has for 5 s whenever it is asked for."""

        def acquire(self) -> None:
            now[0] += 5.0

        def release(self) -> None: ...

    class Remote(FakePolicy):
        def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
            now[0] += 1.0
            return super().infer(observation)

    heartbeat, watch = HeartbeatSender(turn=ComputeLock(Slow())), Stopwatch()  # type: ignore[arg-type]
    policy = MonitoredPolicy(Remote(), "ws://h:1", heartbeat)
    with heartbeat.computing():
        watch.ask(policy, policy.infer, {})
    assert watch.seconds == {"waiting": 1.0, "queueing": 5.0} and watch.last_call == 1.0
    assert heartbeat.answer_ms == 1000.0


def test_a_policy_in_the_worker_keeps_the_turn() -> None:
    lock = threading.Lock()
    heartbeat = HeartbeatSender(turn=ComputeLock(lock))
    seen: list[bool] = []

    class Here(FakePolicy):
        def reset(self, trial: TrialInfo) -> None:
            seen.append(lock.locked())

    for target in ("hold", "ws://h:1"):
        with heartbeat.computing():
            MonitoredPolicy(Here(), target, heartbeat).reset(TrialInfo("T", "aloha-agilex", "go"))
    assert seen == [True, False] and not lock.locked()


def test_one_waiting_for_its_turn_is_not_stuck() -> None:
    lock, seen = threading.Lock(), list[str]()
    heartbeat = HeartbeatSender(turn=ComputeLock(lock))
    lock.acquire()

    def hold() -> None:
        with heartbeat.computing():
            seen.append(heartbeat.activity)

    thread = threading.Thread(target=hold)
    thread.start()
    while heartbeat.activity != "waiting":
        time.sleep(0.001)
    lock.release()
    thread.join()
    assert seen == ["simulating"]


# ------ workers that do not advance are replaced; those that wait for a server, or compute, are not


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
    """The deadline of a monitor of 10 s that began at 0 and received `beats`."""
    monitor = HeartbeatMonitor(0.0, 10.0)
    for when, count, activity in beats:
        monitor.receive(Heartbeat(count, activity), when)
    assert monitor.deadline == deadline


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


def test_a_worker_stuck_in_native_code_is_ended_and_its_trial_handed_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = tmp_path / "mark"
    mark.touch()
    monkeypatch.setenv("SOAK_STUCK", str(mark))
    records: list[TrialRecord] = []
    notes: list[str] = []
    options = RunOptions(workers=1, backoff=0.01, stuck_seconds=2.5)
    config = fake_config(tmp_path / "run", world="soak_fakes:SoakWorld")
    Runner(config, KEYS[:3], options, records.append, notes.append).run()
    assert sorted(record.key for record in records) == KEYS[:3]
    assert sorted(r.attempts for r in records) == [1, 1, 2]
    assert len(notes) == 1 and "did not advance for 2.5 s and was killed; trying again" in notes[0]


def test_an_exception_of_a_policy_in_this_process_is_the_policys_error() -> None:
    class Wrong(FakePolicy):
        def infer(self, observation: object) -> None:
            raise ValueError("no camera")

    monitored = MonitoredPolicy(Wrong(), "hold", HeartbeatSender())
    with pytest.raises(PolicyError, match=r"^ValueError: no camera \(test_held_trials\.py:"):
        monitored.infer({})
    assert monitored.failed
    remote = MonitoredPolicy(Wrong(), "ws://h:1", HeartbeatSender())
    with pytest.raises(ValueError, match="no camera"):  # of our client: no error of the policy
        remote.infer({})
    assert not remote.failed
