"""A scripted policy that looks before every few actions: for evaluations in real time.

The oracle's plan, driven as a controller drives it. Actions of a fixed duration go along the
straight joint line to the plan's next stop, fast and then slower; only when the stop is seen to be
reached does the next one follow. So what it does depends on what it saw last, and a latency costs
it at every stop. With `feedback=no` it sends the way through all stops of a skill in one chunk,
without looking between them: the same motions, open loop.

Like the oracle it knows the scene and says so in its spec.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import quantize
from robospa.baselines.oracle import Oracle
from robospa.harness.clock.policy_clock import action_steps, rate_of
from robospa.observation import Observation
from robospa.protocol.policy import TrialInfo
from robospa.tasks.snapshot import Snapshot

Actions = NDArray[np.float32]

FASTEST = 1.5
"""[rad/s] of the joint that turns most."""
SHARE = 6.0
"""[1/s] Near a stop the speed falls with the distance: so much of it a second."""
SNAP = 0.01
"""[rad] A stop that is nearer is taken in one action."""
SETTLED = 0.02
"""[rad] Measured joints this near to a stop are there."""
PATIENCE = 0.6
"""[s] after which a stop counts as reached although something keeps the arm from it."""
REST = 0.2
"""[s] of a stop in which only a gripper moves, or nothing: what the official rule gives it."""
MOST = 200
"""Actions in a chunk."""


class Reactive(Oracle):
    """Goes from stop to stop of the oracle's plan in actions of a fixed duration."""

    def __init__(self, chunk: int, rate: float, feedback: bool, salt: str = "") -> None:
        """`chunk` actions at most in an answer, `rate` of them a second."""
        super().__init__(salt)
        self.chunk, self.feedback = chunk, feedback
        self.period = 1.0 / rate_of(action_steps(rate))
        name = "reactive" if feedback else "reactive:open-loop"
        self.spec = replace(Oracle.spec, name=name, horizon=chunk)
        self._stops: list[Actions] = []
        self._last: Actions | None = None
        self._arrived: float | None = None

    def reset(self, trial: TrialInfo) -> None:
        """Build the scene of `trial`; ValueError without its key."""
        super().reset(trial)
        self._stops, self._last, self._arrived = [], None, None

    def infer(self, observation: Observation) -> Actions:
        """The next actions, float32 (T, D)."""
        _, snapshot, robot = self._acting(observation)
        commanded = np.asarray(observation["state"], np.float32)
        if self._last is None:
            self._last = commanded
        bodies = robot.action_space("joint").bodies
        if self.feedback:
            return self._to_next_stop(commanded, snapshot, bodies)
        return self._through_all(commanded, snapshot, bodies)

    def _to_next_stop(self, commanded: Actions, snapshot: Snapshot, bodies: list[int]) -> Actions:
        """The way to the first stop that is not seen to be reached."""
        while True:
            stop = self._next_stop(snapshot)
            if not np.array_equal(stop, commanded):
                self._arrived = None
                return line(commanded, stop, bodies, self.period)[: self.chunk]
            if self._arrived is None:
                self._arrived = snapshot.time
            rested = snapshot.time - self._arrived
            measured = np.concatenate([np.array(arm) for arm in snapshot.measured])
            settled = np.abs(measured - stop[bodies]).max() < SETTLED or rested >= PATIENCE
            pause = self._pause(stop, bodies)
            if settled and rested >= pause - 1e-6:
                self._last, self._arrived = stop, None
                self._stops.pop(0)
                continue
            rows = max(1, math.ceil((pause - rested) / self.period - 1e-6))
            return np.repeat(stop[None], min(rows, self.chunk), axis=0)

    def _through_all(self, commanded: Actions, snapshot: Snapshot, bodies: list[int]) -> Actions:
        """The way through all stops of a skill, with its pauses, as far as a chunk goes."""
        rows: list[Actions] = []
        at = commanded
        while not rows or (self._stops and len(rows) < self.chunk):
            stop = self._next_stop(snapshot)
            way = line(at, stop, bodies, self.period)
            if len(rows) + len(way) > self.chunk:
                rows += list(way[: self.chunk - len(rows)])
                break
            pause = max(1, math.ceil(self._pause(stop, bodies) / self.period - 1e-6))
            rows += [*way, *[stop] * pause]
            self._last = at = self._stops.pop(0)
        return np.stack(rows[: self.chunk])

    def _next_stop(self, snapshot: Snapshot) -> Actions:
        """The stop (D,) to go to."""
        if not self._stops:
            assert self._expert is not None
            self._stops = list(quantize(self._expert.next(snapshot)))
        return self._stops[0]

    def _pause(self, stop: Actions, bodies: list[int]) -> float:
        """How long [s] to rest at `stop`."""
        assert self._last is not None
        return REST if np.array_equal(stop[bodies], self._last[bodies]) else 0.0


def line(start: Actions, stop: Actions, bodies: list[int], period: float) -> Actions:
    """Actions (T, D) of `period` [s] along the straight line, T >= 1; the last one is `stop`."""
    turn = (stop - start).astype(float)
    far = float(np.abs(turn[bodies]).max())
    left, shares = far, []
    while left > SNAP:
        left -= min(FASTEST, SHARE * left) * period
        shares.append(1.0 - left / far)
    rows = start + np.array([*shares[:-1], 1.0])[:, None] * turn
    rows[-1] = stop
    return quantize(rows.astype(np.float32))


def create(
    chunk: str = "8", rate: str = "16.67", feedback: str = "yes", salt: str = ""
) -> Reactive:
    """A new policy, one per connection.

    `chunk` actions at most in an answer, 1 to 200; `rate` of them a second, as in the evaluation;
    `feedback`: yes, or no for a whole skill at once. `salt` is the secret of hidden scenes.
    """
    if not chunk.isdecimal() or not 1 <= int(chunk) <= MOST:
        raise ValueError(f"chunk is {chunk!r}, and must be 1 to {MOST}")
    if feedback not in ("yes", "no"):
        raise ValueError(f"feedback is {feedback!r}, and must be yes or no")
    return Reactive(int(chunk), float(rate), feedback == "yes", salt)
