"""One worker process: one world, one policy connection, one trial at a time, one record file.

The driver sends ("run", key, attempt, policy) or ("stop",); the worker answers ("ready", file),
then per trial ("done", record) once the record is on disk, ("lost", key, message, retry, fault) if
it could not be run (`fault`: see `harness.servers`), or ("fatal", message) if no trial could ever
be run. After a loss the world is rebuilt and the policy reconnected before the next trial, never
within one. In between a thread sends ("beat", number, state): see `harness.watchdog`. A worker
whose driver has died ends at once, even if it is stopped or stuck in native code (on Linux, where
the kernel sees to it).
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robospa.harness.factory import load_function, open_policy
from robospa.harness.running.policies import over_budget
from robospa.harness.running.store import RecordWriter, StorageError, storing, write_actions
from robospa.harness.running.watchdog import Attended, Pulse
from robospa.protocol.errors import printable
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.tasks.task import Task

LOGS = "logs"
PR_SET_PDEATHSIG = 1
Targets = str | tuple[str, ...]
"""A policy's URL or name, or several that are one as good as the other."""
SENTENCE = 1000
"""Characters that an error may have in a record."""
VIDEO = ("none", "failures", "first", "all")

TASK_PARTS = "robospa.harness.trial:task_parts"


def task_finder(parts: str) -> Callable[[TrialKey], Task]:
    """What finds the task of a trial: the catalog, unless `parts` puts something in its place.

    The catalog is asked directly because `parts` build the scene as well, and the first scene of a
    variant may take a second.
    """
    if parts == TASK_PARTS:
        from robospa.tasks.catalog import task

        return lambda key: task(key.task)
    find = load_function(parts)
    return lambda key: find(key).task


@dataclass(frozen=True)
class WorkerConfig:
    """What a worker needs to know; picklable.

    `policy` is a server's URL, several equal ones or a policy's name, unless `policies` has that
    for every task; `options` go to the client, and `expects` has the spec that each of them must
    have. `world` and `parts` are `module:function` paths of a world factory and of what finds a
    trial's scene and goal. `video` is one of VIDEO; "first" films the trials in `samples`.
    `step_scale` multiplies the step limits.
    """

    folder: Path
    policy: Targets
    options: Mapping[str, Any] = field(default_factory=dict)
    world: str = "robospa.harness.sim.sapien_world:SapienWorld"
    world_arguments: Mapping[str, Any] = field(default_factory=dict)
    parts: str = TASK_PARTS
    run_seed: int = 0
    video: str = "none"
    samples: frozenset[TrialKey] = frozenset()
    policies: Mapping[str, Targets] = field(default_factory=dict)
    expects: Mapping[str, PolicySpec] = field(default_factory=dict)
    step_scale: float = 1.0

    def targets(self, task: str) -> tuple[str, ...]:
        """URLs or names of the policies that can do `task`."""
        found = self.policies[task] if self.policies else self.policy
        return (found,) if isinstance(found, str) else tuple(found)

    @property
    def alone(self) -> bool:
        """Whether there is one policy for all trials."""
        found = self.policies.values() if self.policies else (self.policy,)
        return len({t for f in found for t in ((f,) if isinstance(f, str) else f)}) == 1

    def filmed(self, key: TrialKey) -> bool:
        """Whether a video of `key` may be wanted."""
        return self.video in ("failures", "all") or (self.video == "first" and key in self.samples)


class Worker:
    """Runs trials; builds its world and policy when first needed and again after a loss."""

    def __init__(
        self, config: WorkerConfig, writer: RecordWriter, pulse: Pulse | None = None
    ) -> None:
        self.config = config
        self.writer = writer
        self.pulse = pulse or Pulse()
        self.parts: Callable[[TrialKey], Any] = load_function(config.parts)
        self._world: Any = None
        self._policy: Any = None
        self._target = ""
        self._stale = False

    def run(self, key: TrialKey, attempt: int, target: str) -> TrialRecord:
        """Run one trial with the policy `target`; its record, trace and video are then on disk."""
        from robospa.harness.pictures.video import TrialRecorder
        from robospa.harness.trial import policy_seed, run_trial

        self._prepare(target)
        recorder = TrialRecorder(video=self.config.filmed(key), on_step=self.pulse.on)
        seed = policy_seed(key, self.config.run_seed)
        record = run_trial(
            self._world,
            self._policy,
            key,
            policy_seed=seed,
            recorder=recorder,
            parts=self.parts,
            step_scale=self.config.step_scale,
        )
        cut = over_budget(getattr(self._policy, "hello", None), record.instruction)
        record = replace(
            record, attempts=attempt, diagnostics={**record.diagnostics, **(cut or {})}
        )
        write_actions(self.config.folder, key, recorder.actions, self._policy.spec.action)
        if self.config.video != "failures" or not record.success:
            record = replace(record, video=recorder.write_video(self.config.folder, key))
        self.writer.write(record)
        self._say_goodbye(record)
        return record

    def _say_goodbye(self, record: TrialRecord) -> None:
        """Tell the policy's server how it went; the record is safe whatever comes of it."""
        end = getattr(self._policy, "end", None)
        if end is not None:
            try:
                end({"end": record.end, "success": record.success})
            except Exception:  # the next trial starts on a new connection
                self._stale = True

    def _prepare(self, target: str) -> None:
        if self._world is None:
            self._world = load_function(self.config.world)(**self.config.world_arguments)
        if self._policy is not None and self._target != target:
            self._leave()
        if self._policy is None:
            options = dict(self.config.options)
            if target in self.config.expects:
                options["expect"] = self.config.expects[target]
            if "timeouts" in options and not self.config.alone:
                # The driver has other work for this worker until the server is back.
                options["timeouts"] = replace(options["timeouts"], wait=0.0)
            with self.pulse.policy(target):
                opened = open_policy(target, options)
            self._policy, self._target = Attended(opened, target, self.pulse), target
        elif self._stale:
            reconnect = getattr(self._policy, "reconnect", None)
            if reconnect is not None:
                reconnect()
        self._stale = False

    def _leave(self) -> None:
        """Close the connection to the policy of the task before, whatever comes of it."""
        policy, self._policy = self._policy, None
        shut = getattr(policy, "close", None)
        if shut is not None:
            with contextlib.suppress(Exception):
                shut()

    def recover(self) -> None:
        """After a loss: nothing of the world survives, and the connection is not trusted."""
        world, self._world = self._world, None
        self._stale = True
        if world is not None:
            world.close()

    def close(self) -> None:
        """Say goodbye to the policy's server and free the world."""
        for part in (self._policy, self._world):
            shut = getattr(part, "close", None)
            if shut is not None:
                shut()


def die_with_driver() -> None:
    """End this process as soon as its parent is gone, however it went."""
    if sys.platform == "linux":
        # The thread below never runs if this process is stopped, or stuck holding the interpreter.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            wait([parent.sentinel])
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


def _log_to(path: Path) -> None:
    """Send whatever libraries print, and the stack of a crash, to a file instead of the screen."""
    with storing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(file, sys.stdout.fileno())
    os.dup2(file, sys.stderr.fileno())
    faulthandler.enable()


def describe(error: BaseException) -> str:
    """One line about `error`, naming its class where the text alone would not be understood."""
    text = printable(str(error), SENTENCE)
    module = type(error).__module__
    return text if text and module.startswith("robospa.") else f"{type(error).__name__}: {text}"


def _attempt(worker: Worker, key: TrialKey, attempt: int, target: str) -> tuple[Any, ...]:
    """The message that tells how this attempt went. Errors are sorted here, once."""
    from robospa.harness.running.servers import fault_of
    from robospa.harness.world import SceneUnstable
    from robospa.protocol.errors import ServerError
    from robospa.registry import UnknownName

    try:
        return ("done", worker.run(key, attempt, target))
    except SceneUnstable as error:
        return ("lost", key, describe(error), False, "")
    except (UnknownName, StorageError) as error:
        return ("fatal", describe(error))
    except Exception as error:  # the driver decides: retry, then report as missing
        with contextlib.suppress(OSError):  # the log's disk may be full
            traceback.print_exc()
        worker.recover()
        retry = not isinstance(error, ServerError) or error.retriable
        return ("lost", key, describe(error), retry, fault_of(error))


def _serve(pipe: Connection, send: Callable[[Any], None], worker: Worker) -> None:
    while True:
        message = pipe.recv()
        if message[0] == "stop":
            return
        send(_attempt(worker, *message[1:]))


def main(pipe: Connection, config: WorkerConfig, name: str) -> None:
    """Entry point of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    die_with_driver()
    speaking = threading.Lock()

    def send(message: Any) -> None:
        with speaking:
            pipe.send(message)

    try:
        _log_to(config.folder / LOGS / f"{name}.log")
        writer = RecordWriter(config.folder)
    except StorageError as error:
        send(("fatal", describe(error)))
        return
    pulse = Pulse(send)
    worker = Worker(config, writer, pulse)
    pulse.start()
    try:
        send(("ready", writer.path))
        _serve(pipe, send, worker)
    except (EOFError, BrokenPipeError):
        return
    finally:
        writer.close()
        worker.close()
