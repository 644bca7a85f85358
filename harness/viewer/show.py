"""What `robospa view RUN TRIAL` and `robospa tasks NAME --view` show, and how long.

Nothing is drawn here: the world runs without its renderer, and the poses of its bodies are kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from robospa.extras import need
from robospa.geometry import Pose
from robospa.harness.replay import replay_record
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.harness.viewer.playback import DrawnBody, Playback, drawn_bodies, playback_of
from robospa.harness.world import StepResult, World
from robospa.protocol.policy import Policy
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, finished, read_run
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
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
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
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
) -> Playback:
    """The trial `key` with `policy`, run now; passes on what `world` and `policy` raise."""
    recorder = PoseRecorder()
    record = run_trial(world, policy, key, policy_seed=0, recorder=recorder, parts=parts)
    return _playback(record, parts(key), recorder)


def _playback(record: TrialRecord, setup: TrialSetup, seen: PoseRecorder) -> Playback:
    roles = setup.tracker.roles
    subtasks = {name: role.subtasks for name, role in roles.items() if role.subtasks}
    names = describe_objects(setup.scene)
    return playback_of(record, seen.times, seen.frames, names, subtasks)


LISTED = 5
"""So many trials are named where a name fits several."""


def trial_named(run: Run, name: str) -> TrialRecord:
    """The finished trial of `run` whose name begins so, such as Pick_Blocks_Size-L3-100004.

    Raises RunError if it fits none or several, naming some.
    """
    slugs = {r.key.slug: r for _, r in sorted(run.records.items()) if finished(r)}
    fits = [slug for slug in slugs if slug == name or slug.startswith(f"{name}-")]
    fits = fits or [slug for slug in slugs if slug.startswith(name)]
    if len(fits) == 1:
        return slugs[fits[0]]
    some = fits or [slug for slug, record in slugs.items() if not record.success] or list(slugs)
    listed = ", ".join(some[:LISTED]) or "none with a result"
    what = f"{len(fits)} trials are called" if fits else "no trial with a result is called"
    raise RunError(f"{what} {name!r}; {'they are' if fits else 'there are'} {listed}"
                   + (", ..." if len(some) > LISTED else ""))  # fmt: skip


def of_run(folder: Path, name: str) -> tuple[Playback, list[DrawnBody]]:
    """The trial called `name` of the run in `folder`, replayed; raises RunError, ReplayError."""
    from robospa.harness.factory import load_function
    from robospa.harness.robots import embodiment
    from robospa.harness.running.films import replay_config
    from robospa.harness.sim.sapien_world import SapienWorld

    need("viser")  # what is missing is said before anything is played
    run = read_run(folder)
    record, config = trial_named(run, name), replay_config(run)
    parts = partial(load_function(config.parts), **config.parts_arguments)
    world = SapienWorld(**{**config.world_arguments, "render": False})
    try:
        played = recorded_playback(world, record, folder, parts=parts, step_scale=config.step_scale)
    finally:
        world.close()
    return played, drawn_bodies(parts(record.key).scene, embodiment(record.key.embodiment))


def of_expert(key: TrialKey) -> tuple[Playback, list[DrawnBody]]:
    """The trial `key` with the expert; passes on what its world raises."""
    from robospa.harness.factory import policy_factory
    from robospa.harness.robots import embodiment
    from robospa.harness.seeds.attempt import ORACLE
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import task_parts

    need("viser")
    world = SapienWorld(render=False)
    try:
        played = policy_playback(world, policy_factory(ORACLE)(), key)
    finally:
        world.close()
    return played, drawn_bodies(task_parts(key).scene, embodiment(key.embodiment))


def show(playback: Playback, bodies: Sequence[DrawnBody], port: int, minutes: float) -> None:
    """Serve `playback` until Ctrl-C, or for so many minutes if they are not 0."""
    from robospa.harness.viewer.server import play, serving

    until = time.monotonic() + 60 * minutes if minutes > 0 else float("inf")
    with serving(playback, bodies, port) as (address, advance):
        print(f"{playback.title} is at {address} (Ctrl-C stops it)", flush=True)
        try:
            play(advance, until)
        except KeyboardInterrupt:
            print()


def write_html(playback: Playback, bodies: Sequence[DrawnBody], path: Path) -> None:
    """Write `playback` as one HTML page; OSError if it cannot be written."""
    from robospa.harness.viewer.server import as_html

    path.write_text(as_html(playback, bodies), encoding="utf-8")
