"""Playbacks of trials: a recorded one of a run, played again, or the expert's.

Nothing is drawn here: the world runs without its renderer, and the poses of its bodies are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.replay import replay_record
from robospa.harness.trial import TrialParts, run_trial, task_parts
from robospa.harness.viewer.playback import Playback, playback_of
from robospa.harness.world import StepResult, World
from robospa.protocol.policy import Policy
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.descriptions import describe_objects
from robospa.trial import TrialKey

EVERY = 0.1
"""Simulated seconds between two frames."""


class HasBodies(Protocol):
    """A world that tells where its bodies are."""

    def bodies(self) -> Mapping[str, Pose]:
        """World pose of everything that moves, by name."""
        ...


class PoseRecorder:
    """A `Recorder` of where everything is, ten times a simulated second."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.frames: list[Mapping[str, Pose]] = []

    def started(self, world: World) -> None:
        """Keep how everything stands at the start."""
        self._keep(world, 0.0)

    def polled(self, world: World, time: float) -> None:
        """Keep this instant if the next frame is due."""
        if time >= self.times[-1] + EVERY - 1e-6:
            self._keep(world, time)

    def executed(self, world: World, action: NDArray[np.float32], done: StepResult) -> None:
        """A playback shows times, not actions."""

    def ended(self, world: World) -> None:
        """Keep the last instant."""
        self._keep(world, world.snapshot().time)

    def _keep(self, world: World, time: float) -> None:
        if not hasattr(world, "bodies"):
            raise TypeError(f"{type(world).__name__} does not tell where its bodies are")
        self.times.append(time)
        self.frames.append(cast(HasBodies, world).bodies())


def recorded_playback(
    world: World,
    record: TrialRecord,
    folder: Path,
    *,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
    step_scale: float = 1.0,
) -> Playback:
    """The trial of `record`, whose actions are in the run in `folder`, played again.

    Raises ReplayError if it does not come again, RunError if its actions cannot be read.
    """
    recorder = PoseRecorder()
    replay_record(world, record, folder, recorder, parts=parts, step_scale=step_scale)
    return _playback(record, parts(record.key), recorder)


def policy_playback(
    world: World,
    policy: Policy,
    key: TrialKey,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
) -> Playback:
    """The trial `key` with `policy`, run now; passes on what `world` and `policy` raise."""
    recorder = PoseRecorder()
    record = run_trial(world, policy, key, policy_seed=0, recorder=recorder, parts=parts)
    return _playback(record, parts(key), recorder)


def _playback(record: TrialRecord, setup: TrialParts, seen: PoseRecorder) -> Playback:
    roles = setup.tracker.roles
    subtasks = {name: role.subtasks for name, role in roles.items() if role.subtasks}
    names = describe_objects(setup.scene)
    return playback_of(record, seen.times, seen.frames, names, subtasks)
