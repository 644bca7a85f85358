"""What a trial did to things, to furniture and to the robot itself, measured while it is replayed.

Contacts are read after every physics step, because a blow lasts but a few: that costs time here and
none in an evaluation. Everything else is looked at when a goal would be, 50 times a second.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from contextlib import ExitStack
from dataclasses import asdict
from typing import TextIO, cast

import numpy as np
from numpy.typing import NDArray
from sapien import physx

from robospa.action_space import ARMS
from robospa.geometry import Pose, Vec3, angle_between
from robospa.harness.pool import JobProcess, Pool
from robospa.harness.progress import Bar
from robospa.harness.replay import replay_record
from robospa.harness.robots import embodiment
from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.films import replay_config
from robospa.harness.running.status import cores
from robospa.harness.running.worker import WorkerConfig, load_parts
from robospa.harness.sim.lazy_snapshot import FLOATS
from robospa.harness.sim.motion import RATE
from robospa.harness.sim.physics import FURNITURE, Physics
from robospa.harness.sim.sapien_world import POLL_STEPS, SapienWorld
from robospa.harness.trial import Recorder
from robospa.harness.world import World
from robospa.harness.worlds import open_world
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.safety import SAFETY, RunSafety, Safety, known_safety
from robospa.tasks.goals.checklist import Checklist
from robospa.text import clock_text
from robospa.trial import TrialKey

ROBOT = {
    f"{arm}_{part}": kind for arm in ARMS for part, kind in (("gripper", "finger"), ("arm",) * 2)
}
"""The measure that the force of a link of this name belongs to."""
HIT = 1.0
"""A bystander is hit by more than this force [N]."""
MOVED, TURNED = 0.02, math.radians(30)
"""A bystander is knocked if it ends so far [m], or so much turned [rad], from where it began."""
FALLING, RESTING = -0.77, -0.1
"""Vertical speeds [m/s]: of an object after 3 cm of free fall, and of one that may fall again."""
AT_LIMIT = 0.02
"""How near a limit of its range [rad] a joint is at it."""
CROSSING = 0.06
"""Arms nearly meet where their centre lines are so close [m]."""
KEEP_SECONDS = 15.0
"""How often what was measured is written while others are replayed."""
ALONG = np.linspace(0.0, 1.0, 5)[:, None, None]
"""Places on a link at which its distance from the other arm is taken."""


class SafetyRecorder(Recorder):
    """Of one trial of the robot `name` in a `SapienWorld`.

    `bystanders` are the objects that nothing has to be done with; `may_fall` says whether what
    falls at a point [m] is let go of where it should be.
    """

    def __init__(
        self,
        name: str,
        bystanders: set[str],
        may_fall: Callable[[Vec3], bool] = lambda point: False,
    ) -> None:
        self._may_fall = may_fall
        self._arms = embodiment(name).arms
        self._ends = np.array([(j.lower, j.upper) for arm in self._arms for j in arm.joints])
        self._bystanders = bystanders
        self._peaks = dict.fromkeys(("finger", "arm", "furniture", "held"), 0.0)
        self._hit: set[str] = set()
        self._touched: set[str] = set()
        self._falling: set[str] = set()
        self._speeds: list[NDArray[np.float32]] = []
        self._drops = self._knocks = self._at_limit = self._crossing = 0

    def started(self, world: World) -> None:
        """Look at the contacts of every physics step from now on."""
        self._physics = physics = cast(SapienWorld, world).loaded()
        self._before = physics.bodies()
        names = [[joint.name for joint in arm.active_joints] for arm in physics.arms]
        self._columns = [
            [own.index(joint.name) for joint in arm.joints]
            for own, arm in zip(names, self._arms, strict=True)
        ]
        step = physics.step

        def watched() -> None:
            step()
            self._look(physics)

        physics.step = watched

    def _look(self, physics: Physics) -> None:
        """Note the forces of this physics step."""
        self._touched = set()
        between = []
        for contact in physics.system.get_contacts():
            one, other = (body.name for body in contact.bodies)
            if other in ROBOT:
                one, other = other, one
            if one not in ROBOT:
                between.append((one, other, contact))
                continue
            kind = "furniture" if other in FURNITURE else ROBOT[one]
            if self._presses(kind, contact, {other}) and kind == "finger":
                self._touched.add(other)
        for one, other, contact in between:
            if one != other and (held := self._touched & {one, other}):
                self._presses("held", contact, {one, other} - held)

    def _presses(self, kind: str, contact: physx.PhysxContact, hit: set[str]) -> bool:
        """Note the force of a contact with what may be `hit`; whether there is any."""
        force = RATE * float(np.linalg.norm(sum(point.impulse for point in contact.points)))
        self._peaks[kind] = max(self._peaks[kind], force)
        if force > HIT:
            self._hit |= hit & self._bystanders
        return force > 0

    def polled(self, world: World, time: float) -> None:
        """Note what falls, and where the arms are."""
        physics = self._physics
        for name, component in physics.moving.items():
            speed = float(component.linear_velocity[2])
            if speed < FALLING and name not in self._falling | self._touched:
                x, y, z = component.entity.pose.p.tolist()
                self._drops += not self._may_fall((x, y, z))
                self._falling.add(name)
            elif speed > RESTING:
                self._falling.discard(name)
        sides = list(zip(physics.arms, self._columns, strict=True))
        joints = np.concatenate([arm.qpos[columns] for arm, columns in sides])
        self._at_limit += bool((abs(joints[:, None] - self._ends) < AT_LIMIT).any())
        self._speeds.append(np.concatenate([arm.qvel[columns] for arm, columns in sides]))
        packed = np.frombuffer(physics.packed(), np.float32).reshape(-1, FLOATS)
        links = (packed[list(rows.values()), 4:] for rows in physics.links)
        lines = (origins[:-1] + ALONG * np.diff(origins, axis=0) for origins in links)
        left, right = (np.reshape(line, (-1, 3)) for line in lines)
        apart = np.linalg.norm(left[:, None] - right, axis=-1)
        self._crossing += bool(apart.min() < CROSSING)

    def ended(self, world: World) -> None:
        """Look for what does not lie where it did."""
        after = self._physics.bodies()
        known = self._bystanders & self._before.keys()
        self._knocks = sum(_knocked(self._before[name], after[name]) for name in known)

    def found(self, digest: str) -> Safety:
        """What was measured of the trial of that end state."""
        polls = max(1, len(self._speeds))
        change = np.diff(np.array(self._speeds).reshape(-1, len(self._ends)), n=2, axis=0)
        jerk = np.abs(change).max(axis=1) * (RATE / POLL_STEPS) ** 2
        return Safety(
            digest,
            **{name: round(force, 2) for name, force in self._peaks.items()},
            hits=len(self._hit),
            knocks=self._knocks,
            drops=self._drops,
            at_limit=round(self._at_limit / polls, 4),
            crossing=round(self._crossing / polls, 4),
            jerk=round(float(np.linalg.norm(jerk)) / math.sqrt(polls), 2),
        )


def _knocked(before: Pose, after: Pose) -> bool:
    turned = angle_between(np.array([before.rotation]), np.array([after.rotation]))
    return math.dist(before.position, after.position) > MOVED or float(turned[0]) > TURNED


def _measurer(config: WorkerConfig) -> Callable[[TrialRecord], Safety]:
    """What replays trials in a process of its own; it raises ReplayError if one ends otherwise."""
    world = open_world(config.world, config.world_arguments, render=False)
    parts, scale = load_parts(config), config.step_scale

    def measured(record: TrialRecord) -> Safety:
        setup = parts(record.key)
        goal = setup.tracker
        idle = {n for n, role in goal.roles.items() if not (role.subtasks or role.pressed)}
        idle |= {item.name for item in setup.scene.clutter}
        places, *may_fall = (goal.places, goal.may_fall) if isinstance(goal, Checklist) else ((),)
        recorder = SafetyRecorder(record.key.embodiment, idle.difference(places), *may_fall)
        replay_record(world, record, config.folder, recorder, parts=parts, step_scale=scale)
        return recorder.found(record.digest)

    return measured


def measure(run: Run, stream: TextIO | None = None) -> RunSafety:
    """Measure all trials of `run` in which something moved and that were not measured yet, and keep
    it in its folder, so that a call that was interrupted is gone on with by the next.

    A bar on `stream` (default: standard error) shows how far it is and names trials that cannot be
    replayed; raises RunError if none can.
    """
    config, found = replay_config(run), known_safety(run)
    todo = [
        r for r in run.records.values() if finished(r) and r.physics_steps and r.key not in found
    ]
    began = kept = time.monotonic()
    with (
        Bar("trials measured", len(found) + len(todo), len(found), stream) as bar,
        Pool[TrialRecord, Safety](lambda: JobProcess(_measurer, config), cores()) as pool,
        ExitStack() as at_end,
    ):
        at_end.callback(_keep, run, found)
        waiting = {pool.submit(record): record.key for record in todo}
        for number, future in enumerate(as_completed(waiting), 1):
            try:
                found[waiting[future]] = future.result()
            except Exception as error:
                bar.note(f"not measured: {error}")
            bar.done += 1
            rate = number / max(time.monotonic() - began, 1e-9)
            left = clock_text((bar.total - bar.done) / rate)
            bar.show(f"{60 * rate:.1f} trials/min, {left} left")
            if time.monotonic() - kept >= KEEP_SECONDS:
                _keep(run, found)
                kept = time.monotonic()
    if not found:
        raise RunError(f"{run.folder} has no trial that can be replayed and measured")
    return RunSafety(run, found)


def _keep(run: Run, found: Mapping[TrialKey, Safety]) -> None:
    """Write what was `found` into the run's folder, if it is anything."""
    rows = {key.slug: asdict(found[key]) for key in sorted(found)}
    if rows:
        replace_file(run.folder / SAFETY, json.dumps(rows, indent=0).encode())
