"""Is a worker still getting on with its trial? Both ends of the answer.

A thread of the worker tells the driver about once a second how often something has got on (a scene
loaded, an action polled or executed, an answer received) and whether a policy is waited for.
A worker that is stopped, or stuck inside native code that never lets another thread run, says
nothing; one that is stuck elsewhere says the same number for ever. Waiting for a server is no fault
as long as the worker says so: the client has deadlines of its own. A policy inside the worker may
keep all of it busy for long (loading weights), so that is announced, and then only the trial's own
deadline counts.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from robospa.harness.factory import is_url
from robospa.protocol.policy import PolicySpec, TrialInfo

BEAT_SECONDS = 1.0
WORKING, ASKING, INSIDE = "working", "asking", "inside"
"""In the simulator; waiting for a server; inside a policy of this process."""

Beat = tuple[str, int, str]


class Pulse:
    """The worker's end. `send` gets ("beat", number, state) and may block or raise OSError."""

    def __init__(self, send: Callable[[Beat], None] = lambda beat: None) -> None:
        self._send = send
        self.number = 0
        self.state = WORKING

    def start(self) -> None:
        """Beat until the process ends or the driver is gone."""
        threading.Thread(target=self._run, name="pulse", daemon=True).start()

    def _run(self) -> None:
        pause = threading.Event()
        while not pause.wait(BEAT_SECONDS):
            try:
                self._send(("beat", self.number, self.state))
            except OSError:
                return

    def on(self, *_: object) -> None:
        """Something has got on."""
        self.number += 1

    @contextmanager
    def policy(self, target: str) -> Iterator[None]:
        """While the policy at `target` is doing something."""
        self.number += 1
        if is_url(target):
            self.state = ASKING
        else:
            self.state = INSIDE
            self._send(("beat", self.number, INSIDE))
        try:
            yield
        finally:
            self.state = WORKING
            self.number += 1
            if not is_url(target):
                self._send(("beat", self.number, WORKING))


class Attended:
    """A policy whose calls the `pulse` knows about; everything else is the policy's own."""

    def __init__(self, policy: Any, target: str, pulse: Pulse) -> None:
        self._policy = policy
        self._target = target
        self._pulse = pulse

    @property
    def spec(self) -> PolicySpec:
        """The policy's."""
        spec: PolicySpec = self._policy.spec
        return spec

    def reset(self, trial: TrialInfo) -> None:
        """The policy's."""
        with self._pulse.policy(self._target):
            self._policy.reset(trial)

    def infer(self, observation: Mapping[str, Any]) -> Any:
        """The policy's."""
        with self._pulse.policy(self._target):
            return self._policy.infer(observation)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._policy, name)
        if name not in ("end", "reconnect", "close"):
            return found

        def attended(*arguments: Any) -> Any:
            with self._pulse.policy(self._target):
                return found(*arguments)

        return attended


class Watch:
    """The driver's end: watches one attempt at a trial, on the driver's own monotonic clock."""

    def __init__(self, now: float, seconds: float) -> None:
        """`seconds` without getting on are too many."""
        self.seconds = seconds
        self._since = now
        self._number = -1
        self._state = WORKING

    def heard(self, beat: Beat, now: float) -> None:
        """The worker has sent `beat`."""
        _, number, state = beat
        if number != self._number or state == ASKING:
            self._since = now
        self._number, self._state = number, state

    def forgive(self, seconds: float) -> None:
        """The driver itself was stopped for `seconds`: they do not count."""
        self._since += seconds

    @property
    def deadline(self) -> float:
        """When it is too late; infinite inside a policy of the worker's own."""
        return float("inf") if self._state == INSIDE else self._since + self.seconds
