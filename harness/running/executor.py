"""Where workers live, as the driver of a run sees it: two small interfaces and nothing else.

A `Hand` is one worker that may be told something, may say something and may be gone. An `Executor`
makes them. What is said is the same everywhere (`harness.worker`): the driver sends
("run", key, attempt) and ("stop",), and hears ("ready", file), ("done", record),
("lost", key, message, retry) and ("fatal", message).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

Message = tuple[Any, ...]


class RunAborted(Exception):
    """The run cannot go on; what is finished is kept, and the run can be resumed."""


class Hand(Protocol):
    """One worker, from the moment that it was asked for."""

    name: str

    def send(self, message: Message) -> None:
        """Tell it something; nothing happens if it is gone."""

    def messages(self) -> list[Message]:
        """What it has said since the last call; also after it has gone."""

    def gone(self) -> str | None:
        """How it ended, in a few words; None while it lives."""

    def waiting(self) -> bool:
        """Whether it has no place yet, through no fault of its own: it need not be ready soon."""

    def kill(self) -> None:
        """End it now; `gone` is known when this returns."""

    def join(self, seconds: float) -> None:
        """Wait until it has gone, `seconds` at most."""

    def close(self) -> None:
        """Free what is left of it; it has gone."""


class Executor(Protocol):
    """Makes workers and waits for them."""

    def room(self) -> int:
        """How many workers there can be at this time; may change while a run goes on."""

    def hire(self, name: str) -> Hand:
        """Start one more worker."""

    def wait(self, hands: Sequence[Hand], seconds: float) -> None:
        """Return as soon as one of `hands` has spoken or gone, after `seconds` at most.

        Raises RunAborted if there will never be workers again.
        """

    def news(self) -> list[str]:
        """Lines for the user about the executor itself since the last call."""

    def close(self) -> None:
        """End everything that this executor started; all of its hands have gone."""
