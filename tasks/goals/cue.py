"""Goals of memory tasks: hold still while something is shown, then do something about it.

What has to be remembered is hidden by objects that appear. Until then no arm may move; that is
official, and whoever breaks it has failed for good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from robospa.geometry import Vec3
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.snapshot import Snapshot
from robospa.tasks.task import Tracker

STILL = 0.03
"""No end effector may be farther [m] from its start before the cue is hidden."""

MOVED_EARLY = "moved before the cue was hidden"


class Stillness:
    """Largest distance [m] of an end effector from where it was at the start."""

    def __init__(self) -> None:
        self.motion = 0.0
        self._origins: tuple[Vec3, ...] = ()

    def start(self, snapshot: Snapshot) -> None:
        """Remember where the end effectors are."""
        self._origins = tuple(pose.position for pose in snapshot.end_effector)

    def broken(self, snapshot: Snapshot) -> bool:
        """True once an end effector has moved more than STILL from its start."""
        for origin, pose in zip(self._origins, snapshot.end_effector, strict=True):
            self.motion = max(self.motion, math.dist(origin, pose.position))
        return self.motion > STILL


class AfterCue:
    """`goal`, which starts when the objects called `covers` have appeared; stillness before."""

    def __init__(self, goal: Tracker, covers: Sequence[str]) -> None:
        self.total = goal.total
        self.needs_contacts = goal.needs_contacts
        self._goal = goal
        self._covers = tuple(covers)
        self._still = Stillness()
        self._hidden_at: float | None = None
        self._over = False

    @property
    def roles(self) -> Mapping[str, ObjectRole]:
        """Those of the goal."""
        return self._goal.roles

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Remember where the end effectors are."""
        self._still.start(snapshot)
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Before the covers: stillness. After: what the goal says, until it is won or lost."""
        if self._over:
            return ()
        if self._hidden_at is None:
            if any(name not in snapshot.poses for name in self._covers):
                if not self._still.broken(snapshot):
                    return ()
                self._over = True
                return (Event(snapshot.time, "failed", note=MOVED_EARLY),)
            self._hidden_at = snapshot.time
            return (Event(snapshot.time, "cue_hidden"), *self._goal.start(snapshot))
        events = self._goal.update(snapshot)
        self._over = any(e.kind in ("success", "failed") for e in events)
        return events

    def diagnostics(self) -> dict[str, object]:
        """The goal's own, when the cue was hidden (-1: not yet) and the motion [m] before."""
        return {
            **self._goal.diagnostics(),
            "cue_hidden_at": -1.0 if self._hidden_at is None else self._hidden_at,
            "motion_before": self._still.motion,
        }
