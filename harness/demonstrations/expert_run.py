"""A demonstration: the expert's whole plan, also where the goal is met before its end.

An evaluation ends a trial at the poll that finds the goal met: an object held 5.97 cm high where
6.00 count as reached at the end of the lift. A recording that stopped there would lack the command
that leads to it, so a demonstration runs on: to the plan's last motion, and then it rests. It moves
as fast as the official expert does (`DEMONSTRATION_LIMITS`), faster than a policy's actions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.harness.quantize import quantize
from robospa.harness.sim.motion import RATE
from robospa.harness.skills import Expert
from robospa.harness.trial import Recorder, TrialParts, task_parts
from robospa.harness.world import World
from robospa.tasks.events import Event
from robospa.tasks.goals.monitors import GraspMonitor
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot
from robospa.trial import TrialKey

DECIDED = {"success", "failed"}
"""Kinds of events after which a goal does not change any more."""
REST_ACTIONS = 2
"""Actions of 0.2 s in which nothing moves, at the end."""


@dataclass(frozen=True)
class Demonstration:
    """What came of a demonstration: `success` at any time of it, simulated `seconds`, its
    instruction, a sentence for every skill that failed, and the events of goal and grippers until
    the goal was met or lost."""

    success: bool
    seconds: float
    instruction: str
    failures: tuple[str, ...]
    events: tuple[Event, ...] = ()


class DemonstrationRun:
    """A demonstration at work: executes actions, watches the goal, and tells the recorder.

    `world` has loaded the scene of `setup`.
    """

    def __init__(self, world: World, setup: TrialParts, recorder: Recorder) -> None:
        self.world, self.setup, self.recorder = world, setup, recorder
        tracker = setup.tracker
        self.events: list[Event] = list(tracker.start(world.snapshot()))
        self.seconds = 0.0
        self.last: NDArray[np.float32] | None = None
        self._grasps = (
            GraspMonitor(tracker.roles, setup.scene, world.contacts) if tracker.roles else None
        )
        self._decided = any(event.kind in DECIDED for event in self.events)
        recorder.started(world)

    def has(self, kind: str) -> bool:
        """True if an event of this kind has happened."""
        return any(event.kind == kind for event in self.events)

    def poll(self, snapshot: Snapshot) -> bool:
        """Update the goal until it is met or lost, keep a frame if one is due, and go on."""
        if not self._decided:
            if self._grasps is not None:
                self.events += self._grasps.update(snapshot)
            new = self.setup.tracker.update(snapshot)
            self.events += new
            self._decided = any(event.kind in DECIDED for event in new)
        self.recorder.polled(self.world, snapshot.time)
        return False

    def execute(self, rows: NDArray[np.float32]) -> None:
        """Execute joint actions (T, D)."""
        for action in quantize(rows):
            done = self.world.step(action, "joint", self.poll)
            self.recorder.executed(self.world, action, done)
            self.seconds += done.physics_steps / RATE
            self.last = action

    def rest(self, actions: int = REST_ACTIONS) -> None:
        """Hold what was commanded last for so many actions."""
        if self.last is not None:
            self.execute(np.repeat(self.last[None], actions, axis=0))

    def ended(self, expert: Expert) -> Demonstration:
        """What came of it."""
        self.recorder.ended(self.world)
        return Demonstration(
            self.has("success"),
            self.seconds,
            self.setup.instruction,
            tuple(expert.failures),
            tuple(self.events),
        )


def demonstrate(
    world: World,
    key: TrialKey,
    recorder: Recorder,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
    make_expert: Callable[[Scene, Snapshot], Expert] = Expert,
) -> Demonstration:
    """Run the expert on `key` to its plan's end, then rest.

    Empty arms go home after the plan only where the goal is not met without. A goal that is lost
    ends it. Passes on what `world` raises.
    """
    setup = parts(key)
    world.load(setup.scene, setup.tracker.needs_contacts)
    run = DemonstrationRun(world, setup, recorder)
    return run_expert(run, make_expert(setup.scene, world.snapshot()))


def run_expert(run: DemonstrationRun, expert: Expert) -> Demonstration:
    """Run `expert` to its plan's end, then rest."""
    while not expert.finished and not run.has("failed"):
        rows = expert.next(run.world.snapshot())
        if expert.plan_done:
            run.rest()
            if run.has("success"):
                break
        run.execute(rows)
    return run.ended(expert)
