"""Workers without processes: real ones in threads, and scripted ones that die when told to."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np
from fake_runs import trial_record
from numpy.typing import NDArray
from run_fakes import FakeWorld

from robospa.harness.running.executor import (
    Command,
    Executor,
    Message,
    RunTrial,
    TrialDone,
    WorkerHandle,
    WorkerReady,
)
from robospa.harness.running.heartbeat import ComputeLock
from robospa.harness.running.record_store import RecordWriter
from robospa.harness.running.worker import WorkerConfig, _hold
from robospa.harness.world import Poll, StepResult
from robospa.trial import TrialKey


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
