"""Where workers live, as the driver of a run sees it: a handle for each, and what starts them.

What a worker is sent and what it answers is the same everywhere, see below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from robospa.results.records.manifest import Processor
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey


class RunAborted(Exception):
    """The run cannot go on; what is finished is kept, and the run can be resumed."""


class WorkerHandle(Protocol):
    """One worker, from the moment that it was asked for, or its place for one more trial. `name` is
    the same for all places of a worker."""

    name: str

    def another_trial(self) -> WorkerHandle | None:
        """A place for one more trial in the same worker, which is ready; None if there is none."""
        return None

    def send(self, command: Command) -> None:
        """Send it a command; nothing happens if it has ended."""

    def messages(self) -> list[Message]:
        """What it has sent since the last call; also after it has ended."""

    def exit_status(self) -> str | None:
        """How it ended, in a few words; None while it runs."""

    def pending(self) -> bool:
        """Whether it waits for a node to run on, so that it need not be ready soon."""
        return False

    def kill(self) -> None:
        """End it now; `exit_status` is known when this returns."""

    def join(self, seconds: float) -> None:
        """Wait until it has ended, `seconds` at most."""

    def close(self) -> None:
        """Free what is left of it; it has ended."""


class Executor(Protocol):
    """Starts workers and waits for them."""

    def capacity(self) -> int:
        """How many workers there can be now; may change while a run goes on."""

    def start(self, name: str) -> WorkerHandle:
        """Start one more worker."""

    def wait(self, workers: Sequence[WorkerHandle], seconds: float) -> None:
        """Return as soon as one of `workers` has sent something or ended, after `seconds` at most.

        Raises RunAborted if there will never be workers again.
        """

    def notes(self) -> list[str]:
        """Lines for the user about the executor itself since the last call."""
        return []

    def close(self) -> None:
        """End everything that this executor started; all of its workers have ended."""
        return None


Activity = Literal["simulating", "waiting", "in_policy"]
"""In the simulator; waiting for a policy server; inside a policy of the worker's own process."""

Fault = Literal["", "unreachable", "disconnected", "incompatible"]
"""What is wrong with a policy server: nothing; nobody listens; the connection broke within a trial;
it is another server than the one that the run began with."""


@dataclass(frozen=True)
class RunTrial:
    """To a worker: run this trial with the policy at `target`, a URL or a name, after the attempts
    `retries` that did not count."""

    key: TrialKey
    target: str
    retries: tuple[RetryRow, ...] = ()


@dataclass(frozen=True)
class Proceed:
    """To a worker: the attempt that it announced is on disk, and its policy may have the trial."""


@dataclass(frozen=True)
class Stop:
    """To a worker: close the connection to the policy and end."""


Command = RunTrial | Proceed | Stop


@dataclass(frozen=True)
class WorkerReady:
    """The worker takes trials on its `processor` and writes to the file `records`; None if the
    driver writes them."""

    records: Path | None
    processor: Processor = Processor()


@dataclass(frozen=True)
class Heartbeat:
    """Sent about once a second; `progress` counts what has advanced (scenes, actions, answers).

    `answers`: of policies, since the worker's start; the last one took `answer_ms` [ms].
    """

    progress: int
    activity: Activity
    answers: int = 0
    answer_ms: float = 0.0


@dataclass(frozen=True)
class TrialBegins:
    """The policy is about to be sent the trial: an attempt, whatever ends it. The worker waits for
    Proceed."""


@dataclass(frozen=True)
class TrialDone:
    """A trial has its record, which is on disk."""

    record: TrialRecord


@dataclass(frozen=True)
class TrialLost:
    """An attempt at a trial did not count.

    `retry`: whether another may help. `row`: what a record keeps of this one. `fault`: what is
    wrong with the policy's server."""

    key: TrialKey
    row: RetryRow
    retry: bool = True
    fault: Fault = ""


@dataclass(frozen=True)
class Fatal:
    """No trial could ever be run."""

    message: str


Message = WorkerReady | Heartbeat | TrialBegins | TrialDone | TrialLost | Fatal
"""From a worker."""
