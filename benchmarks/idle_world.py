"""A world in which nothing happens and a goal that is never met: trials cost only the harness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.trial import TrialParts
from robospa.harness.world import Poll, StepResult
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.tasks.task import Level, Task
from robospa.trial import TrialKey


class IdleWorld:
    """Executes every action in one step and changes nothing."""

    def __init__(self) -> None:
        self.steps = 0

    def load(self, scene: Scene, contacts: bool = False) -> None:
        """Begin a trial."""
        self.steps = 0

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Count the action and poll once."""
        self.steps += 1
        return StepResult(1, poll(self.snapshot()))

    def observe(self, spec: PolicySpec) -> Observation:
        """Joints (14,) at 0, no images."""
        return {"images": {}, "state": np.zeros(14, np.float32)}

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        """A black image."""
        return np.zeros((camera.height, camera.width, 3), np.uint8)

    def snapshot(self) -> Snapshot:
        """One block at the origin, open grippers there too."""
        here = Pose()
        points = (here.position, here.position)
        time = 0.02 * self.steps
        return Snapshot(time, {"block": here}, (1.0, 1.0), (here, here), grasp_points=points)

    def contacts(self) -> tuple[Contact, ...]:
        """None."""
        return ()

    def digest(self) -> str:
        """The number of steps."""
        return str(self.steps)

    def info(self) -> Mapping[str, object]:
        """The simulator's name."""
        return {"simulator": "none"}

    def close(self) -> None:
        """Nothing to free."""


class NeverMet:
    """A goal that is never met: every trial takes all of its steps."""

    needs_contacts = False
    total = 1
    roles: Mapping[str, ObjectRole] = {}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """No events."""
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """No events."""
        return ()

    def diagnostics(self) -> Mapping[str, object]:
        """None."""
        return {}


def _unused(*_: object) -> NoReturn:
    raise AssertionError("the task of this benchmark is never drawn")


def endless_trial(key: TrialKey, steps: int) -> TrialParts:
    """A trial of `steps` policy actions that no policy ends sooner."""
    levels = {1: Level(candidates=1, subtasks=1, steps=steps)}
    task = Task(
        key.task, "GAC", levels, _unused, _unused, _unused, _unused, _unused, "idle", "never"
    )
    scene = Scene(key.task, key.level, key.seed, key.embodiment, key.mode, (), {})
    return TrialParts(scene, task, NeverMet(), "Do nothing.")
