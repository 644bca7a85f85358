"""One worker process: one record file, and one trial at a time or several that take turns.

Every trial that it may hold at once has a pipe to the driver, a world and a policy connection of
its own; one computes while the others wait for their servers (`ComputeLock`). Commands are answered
with the messages of `harness.running.executor`: WorkerReady, then for each trial TrialBegins before
the policy has it, and TrialDone once its record is on disk or TrialLost if it could not be run, or
Fatal if no trial could ever be run. After a loss the world is rebuilt and the policy reconnected
before the next trial, never within one. Threads send heartbeats.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robospa.harness.clock.policy_clock import PolicyClock
from robospa.harness.factory import is_url, load_function, open_policy
from robospa.harness.pool import Child
from robospa.harness.running import executor
from robospa.harness.running.atomic_file import LOGS, StorageError, log_to
from robospa.harness.running.heartbeat import ComputeLock, HeartbeatSender, MonitoredPolicy
from robospa.harness.running.manifest import this_processor
from robospa.harness.running.policy_probe import over_budget
from robospa.harness.running.record_store import ActionRecorder, RecordWriter, write_actions
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS, open_world
from robospa.protocol.client import Identity
from robospa.protocol.errors import printable
from robospa.protocol.policy import PolicySpec
from robospa.results.records.runs import film_name
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.trial import TrialSetup
    from robospa.harness.world import World
    from robospa.tasks.task import Task

Targets = str | tuple[str, ...]
"""A policy's URL or name, or those of several equal servers."""
SENTENCE = 1000
"""Characters that an error may have in a record."""
SWITCH_SECONDS = 0.0005
"""How long a thread that sends or reads an answer waits for one that computes (Python: 0.005): it
gets the interpreter several times for each."""


def each(targets: Targets) -> tuple[str, ...]:
    return (targets,) if isinstance(targets, str) else tuple(targets)


def task_finder(parts: str) -> Callable[[TrialKey], Task]:
    """What finds the task of a trial: the catalog, unless `parts` are not ours.

    The catalog is asked directly because `parts` build the scene as well, and the first scene of a
    variant may take a second.
    """
    if parts.startswith("robospa."):
        from robospa.tasks.catalog import task

        return lambda key: task(key.task)
    find = load_function(parts)
    return lambda key: find(key).task


@dataclass(frozen=True)
class WorkerConfig:
    """What a worker needs to know; picklable.

    `policy` is a server's URL, several equal ones or a policy's name, unless `policies` has that
    for every task; `options` go to the client. Of every server `expects` has the spec, and
    `identities` who it is: what answers there must be the same. `world` names a kind of world, and
    `parts` (`module:function`) what finds a trial's scene and goal, each with what else it is
    called with. `video` is one of VIDEO; "first" films the trials in `samples`; films show
    `cameras` side by side. `one_trial` has the host:port of every policy whose server may do one
    trial at a time. `step_scale` multiplies the step limits. `salt` is the secret of hidden
    scenes; `run_seed` that from which ids and policy seeds follow. `clock`: a real one, None for
    the paused one.
    """

    folder: Path
    policy: Targets
    options: Mapping[str, Any] = field(default_factory=dict)
    world: str = SAPIEN_NAME
    world_arguments: Mapping[str, Any] = field(default_factory=dict)
    parts: str = TASK_PARTS
    parts_arguments: Mapping[str, Any] = field(default_factory=dict, repr=False)
    run_seed: str = ""
    video: str = "none"
    cameras: tuple[str, ...] = ("head",)
    samples: frozenset[TrialKey] = frozenset()
    policies: Mapping[str, Targets] = field(default_factory=dict)
    expects: Mapping[str, PolicySpec] = field(default_factory=dict)
    one_trial: Mapping[str, str] = field(default_factory=dict)
    identities: Mapping[str, Identity] = field(default_factory=dict)
    step_scale: float = 1.0
    salt: str = field(default="", repr=False)
    clock: PolicyClock | None = None

    def targets(self, task: str) -> tuple[str, ...]:
        return each(self.policies[task] if self.policies else self.policy)

    @property
    def alone(self) -> bool:
        """Whether there is one policy for all trials."""
        found = self.policies.values() if self.policies else (self.policy,)
        return len({target for targets in found for target in each(targets)}) == 1

    def films(self, key: TrialKey, success: bool) -> bool:
        """Whether a film is to be made of `key`, which has ended in `success`."""
        if self.video == "first":
            return key in self.samples
        return self.video == "all" or (self.video == "failures" and not success)


def load_parts(config: WorkerConfig) -> Callable[[TrialKey], TrialSetup]:
    """What finds a trial's scene, goal and instruction."""
    found = load_function(config.parts)
    arguments = {**config.parts_arguments, **({"salt": config.salt} if config.salt else {})}
    return partial(found, **arguments) if arguments else found


class Worker:
    """Runs trials; builds its world and policy when first needed and again after a loss."""

    def __init__(
        self,
        config: WorkerConfig,
        writer: RecordWriter,
        heartbeat: HeartbeatSender | None = None,
        announce: Callable[[], None] = lambda: None,
    ) -> None:
        self.config = config
        self.writer, self.announce = writer, announce
        self.heartbeat = heartbeat or HeartbeatSender()
        self.parts = load_parts(config)
        self._world: World | None = None
        self._policy: MonitoredPolicy | None = None
        self._stale = False
        self._recorder: ActionRecorder | None = None

    def run(self, key: TrialKey, target: str, retries: tuple[RetryRow, ...] = ()) -> TrialRecord:
        """Run one trial with the policy `target` after the attempts `retries`; its record and
        trace are then on disk."""
        from robospa.harness.trial import policy_seed, run_trial, trial_id

        self._recorder = None
        if self._world is None:
            self._world = open_world(self.config.world, self.config.world_arguments)
        world, policy = self._world, self._open_policy(target)
        policy.begin()
        self._recorder = recorder = ActionRecorder(self.heartbeat.advance)
        record = run_trial(
            world,
            policy,
            key,
            policy_seed=policy_seed(key, self.config.run_seed),
            trial_id=trial_id(key, self.config.run_seed),
            recorder=recorder,
            parts=self.parts,
            step_scale=self.config.step_scale,
            clock=self.config.clock,
            processor=self.heartbeat.processor,
        )
        cut = over_budget(policy.spec, record.instruction)
        record = replace(
            record,
            attempts=len(retries) + 1,
            retries=retries,
            diagnostics={**record.diagnostics, **(cut or {})},
            video=film_name(key) if self.config.films(key, record.success) else "",
        )
        self.writer.check()
        space = policy.spec.executed
        write_actions(self.config.folder, key, recorder.actions, space, recorder.joints)
        self.writer.write(record)
        try:
            policy.end({"end": record.end, "success": record.success})
        except Exception:  # the record is safe; the next trial starts on a new connection
            self._stale = True
        if policy.failed and is_url(target):
            self._stale = True
        elif policy.failed:
            self._close_policy()
        return record

    @property
    def in_trial(self) -> bool:
        """Whether the policy was sent the trial of the last attempt."""
        return self._recorder is not None and self._policy is not None and self._policy.in_trial

    @property
    def steps(self) -> int:
        """Actions that the last attempt executed."""
        return 0 if self._recorder is None else len(self._recorder.actions)

    def _open_policy(self, target: str) -> MonitoredPolicy:
        """The policy at `target`, on a connection that can be trusted."""
        if self._policy is not None and self._policy.target != target:
            self._close_policy()
        if self._policy is None:
            options = dict(self.config.options)
            if target in self.config.identities:
                options["identity"] = self.config.identities[target]
            if "timeouts" in options and not self.config.alone:
                # The driver has other work for this worker until the server is back.
                options["timeouts"] = replace(options["timeouts"], wait=0.0)
            with self.heartbeat.policy(target):
                opened = open_policy(target, options)
            self._policy = MonitoredPolicy(opened, target, self.heartbeat, self.announce)
        elif self._stale:
            self._policy.reconnect()
        self._stale = False
        return self._policy

    def _close_policy(self) -> None:
        """Close the connection to the policy of the task before, whether or not that works."""
        policy, self._policy = self._policy, None
        if policy is not None:
            with contextlib.suppress(Exception):
                policy.close()

    def recover(self) -> None:
        """After a loss: nothing of the world survives, and the connection is not trusted."""
        world, self._world = self._world, None
        self._stale = True
        if world is not None:
            world.close()

    def close(self) -> None:
        for part in (self._policy, self._world):
            if part is not None:
                part.close()


def describe(error: BaseException) -> str:
    """One line about `error`, naming its class where the text alone would not be understood."""
    text = printable(str(error), SENTENCE)
    module = type(error).__module__
    return text if text and module.startswith("robospa.") else f"{type(error).__name__}: {text}"


def _attempt(worker: Worker, command: executor.RunTrial) -> executor.Message:
    from robospa.harness.running.status import connection_fault, retry_cause
    from robospa.harness.world import SceneUnstable
    from robospa.registry import UnknownName
    from robospa.tasks.packs import PackError

    key = command.key
    try:
        return executor.TrialDone(worker.run(key, command.target, command.retries))
    except (SceneUnstable, PackError) as error:
        if isinstance(error, PackError):  # the world may hold a part of the scene
            worker.recover()
        return executor.TrialLost(key, RetryRow("harness_error", describe(error), 0), retry=False)
    except (UnknownName, StorageError) as error:
        return executor.Fatal(describe(error))
    except Exception as error:  # the driver decides: retry, then report as missing
        with contextlib.suppress(OSError):  # the log's disk may be full
            traceback.print_exc()
        row = RetryRow(retry_cause(error, worker.in_trial), describe(error), worker.steps)
        fault = connection_fault(error, worker.in_trial)
        worker.recover()
        return executor.TrialLost(key, row, fault=fault)


def _serve(
    commands: Connection[Any, executor.RunTrial | executor.Stop],
    send: Callable[[executor.Message], None],
    worker: Worker,
) -> None:
    while True:
        command = commands.recv()
        if isinstance(command, executor.Stop):
            return
        with worker.heartbeat.computing():
            message = _attempt(worker, command)
        send(message)


def _hold(
    pipe: Connection, config: WorkerConfig, writer: RecordWriter, turn: ComputeLock | None
) -> None:
    """Run the trials that come through `pipe`, one after the other, until it says Stop."""
    sending = threading.Lock()

    def send(message: executor.Message) -> None:
        with sending:
            pipe.send(message)

    def announce() -> None:
        send(executor.TrialBegins())
        pipe.recv()  # Proceed; EOFError if the driver is gone

    worker = Worker(config, writer, HeartbeatSender(send, turn), announce)
    worker.heartbeat.start()
    try:
        send(executor.WorkerReady(writer.path, this_processor()))
        _serve(pipe, send, worker)
    except (EOFError, ConnectionError):
        return
    finally:
        with worker.heartbeat.computing():
            worker.close()


def _hold_beside(*arguments: Any) -> None:
    """The same in a thread, whose end by an error is the end of the process."""
    try:
        _hold(*arguments)
    except BaseException:
        with contextlib.suppress(OSError):
            traceback.print_exc()
        os._exit(1)


def main(pipes: Sequence[Connection], argument: tuple[WorkerConfig, str]) -> None:
    """All that a worker process does; it holds as many trials at once as there are pipes."""
    config, name = argument
    try:
        log_to(config.folder / LOGS / f"{name}.log")
        writer = RecordWriter(config.folder)
    except StorageError as error:
        pipes[0].send(executor.Fatal(describe(error)))
        return
    if len(pipes) > 1:
        sys.setswitchinterval(SWITCH_SECONDS)
    lock = threading.Lock()
    turns = [ComputeLock(lock) if len(pipes) > 1 else None for _ in pipes]
    first, *others = [(pipe, config, writer, turn) for pipe, turn in zip(pipes, turns, strict=True)]
    threads = [threading.Thread(target=_hold_beside, args=one, daemon=True) for one in others]
    for thread in threads:
        thread.start()
    try:
        _hold(*first)
        for thread in threads:
            thread.join()
    finally:
        writer.close()


@dataclass(eq=False)
class LocalWorker(executor.WorkerHandle):
    """One worker process and the pipe of one trial that it may hold; `spare` are those of more."""

    name: str
    process: Child
    pipe: Connection
    spare: list[Connection] = field(default_factory=list)

    def another_trial(self) -> LocalWorker | None:
        return LocalWorker(self.name, self.process, self.spare.pop()) if self.spare else None

    def send(self, command: executor.Command) -> None:
        """Send it a command; nothing happens if it has ended. To stop it stops unused places."""
        for pipe in [self.pipe, *(self.spare if isinstance(command, executor.Stop) else ())]:
            with contextlib.suppress(OSError):  # it has just died, which `exit_status` reports
                pipe.send(command)

    def messages(self) -> list[executor.Message]:
        received: list[executor.Message] = []
        try:
            while self.pipe.poll():
                received.append(self.pipe.recv())
        except (EOFError, OSError):
            self.process.join(0.1)  # closed: it is dying
        return received

    def exit_status(self) -> str | None:
        return self.process.exit_status()

    def kill(self) -> None:
        self.process.kill()

    def join(self, seconds: float) -> None:
        self.process.join(seconds)

    def close(self) -> None:
        self.process.close()


class LocalExecutor(executor.Executor):
    """At most `workers` processes on this machine, with up to `concurrent_trials` each."""

    def __init__(self, config: WorkerConfig, workers: int, concurrent_trials: int = 1) -> None:
        self._config, self._concurrent_trials = config, concurrent_trials
        self.workers = workers

    def capacity(self) -> int:
        return self.workers

    def start(self, name: str) -> LocalWorker:
        process = Child(main, (self._config, name), name, pipes=self._concurrent_trials)
        first, *spare = process.pipes
        return LocalWorker(name, process, first, spare)

    def wait(self, workers: Sequence[executor.WorkerHandle], seconds: float) -> None:
        wait([worker.pipe for worker in workers if isinstance(worker, LocalWorker)], seconds)
