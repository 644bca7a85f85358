"""Doors and lids: how far a hinged part must be open."""

from __future__ import annotations

from robospa.tasks.snapshot import Snapshot


class Opened:
    """A part of a checklist: the door of `name` is open by at least `angle` [rad].

    It stops counting when the door closes again (official). Nothing is asked about the gripper:
    a door that is held open is open.
    """

    latched = False
    after: int | None = None
    targets: tuple[str, ...] = ()

    def __init__(self, name: str, angle: float) -> None:
        self.name = name
        self.movers = (name,)
        self._angle = angle

    def start(self, snapshot: Snapshot) -> None:
        """Nothing to remember."""

    def holds(self, snapshot: Snapshot, before: bool) -> bool:
        """True if it is open far enough at this instant."""
        return snapshot.hinges[self.name] >= self._angle
