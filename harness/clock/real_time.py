"""The loop of a trial under a real clock: the world goes on while the policy thinks.

In every period, in this order: an answer that has arrived takes over; the policy is asked if it is
not being asked already and the rule of switching says so; one action is executed, or the robot
holds. An answer that takes no time takes over in the period of its question, so that without
latency the trial is that of the paused clock at the same rate, to the bit.

The policy computes when it is asked, as fast as it can; its answer is put aside until the declared
latency is over. Whatever it takes on the wall clock changes nothing. Actions are counted by those
that the robot executed, so a chunk goes on where the robot is: what was executed while the policy
thought is left out of it, and a time in which the robot held leaves out nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace, quantize
from robospa.harness.clock.policy_clock import PolicyClock, Switching
from robospa.harness.policy_calls import Committed, PolicyCaller
from robospa.harness.world import World
from robospa.protocol.policy import PolicySpec

if TYPE_CHECKING:
    from robospa.harness.trial import TrialState

Actions = NDArray[np.float32]
FORESEEN = 10
"""PolicyCaller that the delay of the next one is foretold from."""


DECAY = 0.01
"""Of an ensemble: a chunk that is i chunks younger than the oldest has the weight exp(-DECAY i), as
in ACT (Zhao et al., 2023)."""


@dataclass
class Chunk:
    """An answer: the actions from the instant of its observation, before which `start` actions had
    been executed. `query`: its number from 0."""

    query: int
    start: int
    actions: Actions

    @property
    def end(self) -> int:
        return self.start + len(self.actions)


@dataclass
class Remaining:
    """The actions that the robot has left.

    `execute` is what the policy's spec says of it: with the rule `wait`, the rest of a chunk is
    never executed.
    """

    rule: Switching
    execute: int | None = None
    executed: int = 0
    """Actions that were executed; times in which the robot held do not count."""
    _chunks: list[Chunk] = field(default_factory=list)

    @property
    def left(self) -> int:
        """Actions that the robot can execute without another answer."""
        return max((chunk.end for chunk in self._chunks), default=0) - self.executed

    @property
    def wants_query(self) -> bool:
        """Whether the policy is to be asked now, if it is not being asked already."""
        if self.left <= 0:
            return True
        since = self.executed - self._chunks[-1].start
        return self.rule.after is not None and since >= self.rule.after

    def arrive(self, chunk: Chunk) -> None:
        """The answer to a query."""
        if self.rule.kind == "wait":
            chunk = replace(chunk, actions=chunk.actions[: self.execute])
        if chunk.end <= self.executed:  # it came too late: what is left of the last one goes on
            return
        kept = self._chunks if self.rule.kind == "ensemble" else []
        self._chunks = [*(c for c in kept if c.end > self.executed), chunk]

    def take(self) -> tuple[Actions, int] | None:
        """The next action (D,) and the number of the query that it came from, the newest of
        several; None if nothing is left, and the robot holds."""
        found = [c for c in self._chunks if c.end > self.executed]
        if not found:
            return None
        self._chunks = found
        place, self.executed = self.executed, self.executed + 1
        rows = np.stack([c.actions[place - c.start] for c in found])
        if len(rows) == 1:
            return rows[0], found[0].query
        # Rounded, because the last bit of an exponential is the processor's own.
        weights = np.round(np.exp(-DECAY * np.arange(len(rows))), 9)
        mean = (weights[:, None] * rows).sum(axis=0) / weights.sum()
        return quantize(mean.astype(np.float32)), found[-1].query

    def committed(self) -> Actions:
        """The actions (n, D) that are left of the chunk in use, the next one first; of an ensemble,
        of the newest."""
        if self.left <= 0:
            return np.zeros((0, 0), np.float32)
        newest = self._chunks[-1]
        return newest.actions[self.executed - newest.start :]


class RealTime:
    """A trial under a real clock. `log` says what came of it, for the record."""

    def __init__(
        self, run: TrialState, answers: PolicyCaller, clock: PolicyClock, policy_seed: int
    ) -> None:
        self.run, self.answers, self.clock = run, answers, clock
        self.spec = answers.policy.spec
        self.space = run.robot.action_space(self.spec.action)
        self.remaining = Remaining(clock.switching, self.spec.execute)
        self.log = MotionLog(clock.period_ms / 1000.0)
        self._latencies = clock.latency.draws(policy_seed)
        self._thinking: tuple[int, Chunk] | None = None
        """An answer under way, and the period in which it takes over."""
        self._joints = run.robot.action_space("joint").bodies

    def act(self, step_limit: int) -> str:
        """Act until the goal is met or lost, `step_limit` actions are executed or the time is over;
        the end reason."""
        run, periods = self.run, self.clock.periods(step_limit)
        while self.remaining.executed < step_limit:
            if len(run.actions) >= periods:
                return "time_limit"
            self._think()
            if self.spec.history and run.actions:
                run.remember(self.spec, len(run.actions) + 1)
            if self._execute():
                return run.end
        return "step_limit"

    def _think(self) -> None:
        """Take the answer that is there, and ask if it is time to."""
        period = len(self.run.actions)
        self._arrive(period)
        if self._thinking is None and self.remaining.wants_query:
            query, start = len(self.log.asked), self.remaining.executed
            committed = self._committed()
            actions = self.answers.next_actions(self.run, self.spec, committed, start)
            latency = next(self._latencies)
            self.log.asked.append(period)
            self.log.latencies.append(latency)
            self._thinking = period + self.clock.delay(latency), Chunk(query, start, actions)
            self._arrive(period)

    def _committed(self) -> Committed | None:
        """What real-time chunking needs; None for other rules. The delay is foretold as a robot's
        client does, that does not know what this answer will take: the longest of the last ones."""
        if self.clock.switching.kind != "rtc":
            return None
        rows = self.remaining.committed()
        if not len(rows):
            return Committed(np.zeros((0, self.space.width), np.float32), 0)
        recent = self.log.latencies[-FORESEEN:]
        delay = max((self.clock.delay(latency) for latency in recent), default=0)
        return Committed(rows, min(delay, len(rows)))

    def _arrive(self, period: int) -> None:
        """The answer takes over if its time has come."""
        if self._thinking is not None and period >= self._thinking[0]:
            chunk, self._thinking = self._thinking[1], None
            self.log.arrived.append(period)
            self.remaining.arrive(chunk)

    def _execute(self) -> bool:
        """One period; True if the goal was met or lost during it."""
        run, taken = self.run, self.remaining.take()
        if taken is None:
            last = run.actions[-1] if run.actions else None
            action, source = holding_action(run.world, self.space, last), HELD
        else:
            action, source = taken
        stopped = run.execute(action, self.spec.action)
        joints = action if run.last_joints is None else run.last_joints
        self.log.sources.append(source)
        self.log.blind.append(self._thinking is not None)
        self.log.targets.append(joints[self._joints])
        return stopped


COMMANDED = PolicySpec("commanded", cameras=())


def holding_action(
    world: World, space: ActionSpace, last: NDArray[np.float32] | None
) -> NDArray[np.float32]:
    """The action (D,) of `space` in which no arm and no gripper moves.

    `last` is the one before, None at the trial's start. Targets are absolute, so the same ones
    again are no motion; a `delta_ee` holds by no change of pose. Before the first action they are
    what the world says is commanded.
    """
    if last is not None and space.kind != "delta_ee":
        return last
    seen = world.observe(COMMANDED)
    if space.kind == "joint":
        return np.asarray(seen["state"], np.float32)
    if space.kind == "ee":
        return np.asarray(seen["ee"], np.float32).reshape(-1)
    held = np.zeros(space.width, np.float32)
    for arm, column in enumerate(space.grippers):
        held[space.arms[arm].quaternion] = (1.0, 0.0, 0.0, 0.0)
        held[column] = seen["ee"][arm, -1] if last is None else last[column]
    return held


ENTRY = "real_time"
"""Of a record's diagnostics."""
HELD = -1
"""In the place of a query's number: nothing was left, the robot held."""
WINDOW = 3
"""Third differences that reach over a seam."""


@dataclass
class MotionLog:
    """One entry a period: the number of the query that its action came from, HELD for none;
    whether an answer was under way, so that the action was executed blind; and the joint
    targets (J,) [rad]. One entry a query: when it was asked, when its answer took over (none for
    one that the trial's end overtook), and its declared latency [ms]."""

    period: float
    """[s]"""
    sources: list[int] = field(default_factory=list)
    blind: list[bool] = field(default_factory=list)
    targets: list[NDArray[np.float32]] = field(default_factory=list)
    asked: list[int] = field(default_factory=list)
    arrived: list[int] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)

    def held(self) -> list[list[int]]:
        """Spans of periods in which the robot held: the first, and the first after it."""
        holds = [False, *(source == HELD for source in self.sources), False]
        spans: list[list[int]] = np.flatnonzero(np.diff(holds)).reshape(-1, 2).tolist()
        return spans

    def seams(self) -> list[int]:
        """Periods in which an action came from another query than the action before it."""
        acted = [(row, source) for row, source in enumerate(self.sources) if source != HELD]
        return [row for (_, last), (row, source) in pairwise(acted) if source != last]

    def jerks(self) -> NDArray[np.float64]:
        """Jerk of the commanded motion at every period from the fourth on, that of the joint with
        most [rad/s^3]: the third difference of the targets over the period's third power."""
        if len(self.targets) <= WINDOW:
            return np.zeros(0)
        third = np.diff(np.stack(self.targets).astype(float), n=WINDOW, axis=0)
        return np.asarray(np.abs(third).max(axis=1) / self.period**WINDOW)

    def entry(self) -> dict[str, object]:
        """What goes into the record's diagnostics: counts of periods, mean jerks [rad/s^3] over
        seams and elsewhere, declared latencies [ms]."""
        seams, jerks = self.seams(), self.jerks()
        over = np.zeros(len(jerks), bool)
        for row in seams:
            over[max(0, row - WINDOW) : row] = True
        found: dict[str, object] = {
            "periods": len(self.sources),
            "held": self.sources.count(HELD),
            "held_spans": self.held(),
            "blind": sum(b and s != HELD for b, s in zip(self.blind, self.sources, strict=True)),
            "seams": len(seams),
        }
        if over.any():
            found["seam_jerk"] = round(float(jerks[over].mean()), 3)
        if not over.all():
            found["other_jerk"] = round(float(jerks[~over].mean()), 3)
        if self.latencies:
            found["mean_latency_ms"] = round(float(np.mean(self.latencies)), 3)
            found["max_latency_ms"] = round(max(self.latencies), 3)
        found["asked"], found["arrived"] = self.asked, self.arrived
        return {ENTRY: found}
