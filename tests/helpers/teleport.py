"""A plan carried out by moving poses about: no physics, no robot, just what each skill promises.

It tells whether a task's plan and its goal mean the same, on hundreds of scenes a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from snapshots_by_hand import AWAY, TICK, snap

from robospa.action_space import ARMS
from robospa.geometry import Pose, Vec3, rotate, yaw_rotation
from robospa.tasks.events import Event
from robospa.tasks.objects import object_model
from robospa.tasks.plan import (
    Dock,
    Drop,
    Hang,
    Hit,
    Home,
    Open,
    Pick,
    Place,
    Pour,
    Press,
    RaiseLower,
    Skill,
    Stamp,
    Wait,
)
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.tasks.task import Tracker

STEP = 0.01
"""Length [m] of one tick's motion."""


def mix(a: Vec3, b: Vec3, t: float) -> Vec3:
    """The point between `a` (t = 0) and `b` (t = 1)."""
    return (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]))


class Teleport:
    """One trial of `scene` under `tracker`; `events` holds what the tracker said."""

    def __init__(self, scene: Scene, tracker: Tracker) -> None:
        self.scene = scene
        self.tracker = tracker
        self.models = {o.name: object_model(o.asset, o.params) for o in scene.objects}
        self.poses = {o.name: o.pose for o in scene.objects}
        self.hinges = {name: 0.0 for name, model in self.models.items() if model.hinge}
        self.gripper = [1.0, 1.0]
        self.grasp = list(AWAY)
        self.time = 0.0
        self.events: list[Event] = list(tracker.start(self.snapshot()))

    @property
    def ended(self) -> bool:
        """Whether the trial is won or lost."""
        return any(e.kind in ("success", "failed") for e in self.events)

    def snapshot(self, contacts: Iterable[Contact] = ()) -> Snapshot:
        """The state now."""
        there = {
            o.name: self.poses[o.name]
            for o in self.scene.objects
            if o.appears_at is None or o.appears_at <= self.time + 1e-9
        }
        opening, grasp = (self.gripper[0], self.gripper[1]), (self.grasp[0], self.grasp[1])
        now = snap(self.time, {}, opening, grasp)
        return replace(now, poses=there, contacts=tuple(contacts), hinges=dict(self.hinges))

    def frame(self, name: str, frame: str) -> Pose:
        """A frame of an object, in the world."""
        return self.poses[name] * self.models[name].frames[frame]

    def tick(self, count: int = 1, contacts: Iterable[Contact] = ()) -> None:
        """Let time pass; nothing is heard after the end."""
        for _ in range(count):
            if not self.ended:
                self.time += TICK
                self.events += self.tracker.update(self.snapshot(contacts))

    def run(self, plan: Iterable[Skill]) -> Teleport:
        """Carry out a whole plan, then wait a little."""
        for skill in plan:
            self.do(skill)
        self.tick(30)
        return self

    def do(self, skill: Skill) -> None:
        """Carry out one skill, by the method of its name."""
        getattr(self, f"_{type(skill).__name__.lower()}")(skill)

    def _wait(self, skill: Wait) -> None:
        self.tick(round(skill.seconds / TICK))

    def _home(self, skill: Home) -> None:
        self.gripper, self.grasp = [1.0, 1.0], list(AWAY)
        self.tick()

    def _hit(self, skill: Hit) -> None:
        """The tool's head down on one object after the other, and up again."""
        arm = self._pick(Pick(skill.tool, 0.08, skill.arm))
        for name in skill.targets:
            x, y, z = self.frame(name, "press").position
            tool = self.poses[skill.tool]
            dx, dy, dz = rotate(tool.rotation, self.models[skill.tool].frames["head"].position)
            self._carry(skill.tool, arm, (x - dx, y - dy, z - dz + 0.05))
            self._carry(skill.tool, arm, (x - dx, y - dy, z - dz))
            self.tick(3, [Contact(name, skill.tool, (x, y, z))])
            self._carry(skill.tool, arm, (x - dx, y - dy, z - dz + 0.05))

    def _raiselower(self, skill: RaiseLower) -> None:
        """Up and down as often as asked, both arms at the handles, or one arm above the origin."""
        home, frames = self.poses[skill.object], self.models[skill.object].frames
        arms = {name: ARMS.index(name) for name in skill.arms}
        pieces = round(skill.rise / STEP)
        x, y, z = home.position
        for _ in range(skill.times):
            for height in (*range(pieces + 1), *range(pieces, -1, -1)):
                pose = Pose((x, y, z + skill.rise * height / pieces), home.rotation)
                self.poses[skill.object] = pose
                for name, arm in arms.items():
                    self.gripper[arm] = 0.1
                    point = frames[name].position if len(arms) > 1 else (0.0, 0.0, 0.02)
                    self.grasp[arm] = pose.apply(point)
                self.tick()
            for arm in arms.values():
                self.gripper[arm] = 1.0
            self.tick(3)

    def _stamp(self, skill: Stamp) -> None:
        """Down and up again as often as asked; the last time it stays there."""
        arm = self._pick(Pick(skill.object, 0.08, skill.arm))
        x, y, z = self.frame(skill.on, "support").position
        for _ in range(skill.times):
            self._carry(skill.object, arm, (x, y, z + skill.lift))
            self._carry(skill.object, arm, (x, y, z))
        self._let_go(arm)

    def _dock(self, skill: Dock | Hang) -> None:
        """To the frame of the other object, turned as it is (Hang: as the object comes)."""
        arm = self._pick(Pick(skill.object, 0.10, skill.arm))
        frame = self.frame(skill.on, skill.frame)
        x, y, z = frame.position
        if isinstance(skill, Hang):
            dx, dy, dz = self.frame(skill.object, skill.handle).position
            px, py, pz = self.poses[skill.object].position
            x, y, z = x - dx + px, y - dy + py, z - dz + pz
        self._carry(skill.object, arm, (x, y, z + 0.06))
        self._carry(skill.object, arm, (x, y, z))
        if isinstance(skill, Dock):
            self.poses[skill.object] = frame
        self._let_go(arm)

    _hang = _dock

    def _pour(self, skill: Pour) -> None:
        """Whatever is over the object's footprint falls into the container."""
        x, y, _ = self.poses[skill.object].position
        room = self.models[skill.object].radius
        floor = self.frame(skill.into, "support")
        for name, pose in self.poses.items():
            near = math.dist(pose.position[:2], (x, y)) < room
            if name != skill.object and near:
                self.poses[name] = floor
        self.tick(3)

    def _arm(self, name: str | None, at: Vec3) -> int:
        return ARMS.index(name) if name is not None else int(at[0] >= 0)

    def _carry(self, name: str, arm: int, to: Vec3) -> None:
        """Move a held object and the gripper around it along a straight line."""
        start = self.poses[name]
        pieces = max(1, round(math.dist(start.position, to) / STEP))
        for i in range(1, pieces + 1):
            here = mix(start.position, to, i / pieces)
            self.poses[name] = Pose(here, start.rotation)
            self.grasp[arm] = (here[0], here[1], here[2] + 0.02)
            self.tick()

    def _press(self, skill: Press) -> None:
        point = self.frame(skill.object, skill.frame).position
        arm = self._arm(skill.arm, point)
        self.gripper[arm], self.grasp[arm] = 0.0, point
        self.tick(5, [Contact(skill.object, f"{ARMS[arm]}_gripper", point)])
        self.tick(10)

    def _pick(self, skill: Pick) -> int:
        """Lift an object; returns the arm."""
        x, y, z = self.poses[skill.object].position
        arm = self._arm(skill.arm, (x, y, z))
        self.grasp[arm], self.gripper[arm] = (x, y, z + 0.02), 0.1
        self.tick()
        self._carry(skill.object, arm, (x, y, z + skill.lift))
        return arm

    def _place(self, skill: Place) -> None:
        goal = skill.position
        if skill.on is not None:
            x, y, z = self.frame(skill.on, "support").apply(skill.position)
            goal = (x, y, z - self.models[skill.object].bottom)
        arm = self._arm(skill.arm, self.poses[skill.object].position)
        high = max(goal[2] + 0.07, self.poses[skill.object].position[2])
        self._carry(skill.object, arm, (goal[0], goal[1], high))
        if skill.yaw is not None:
            here = self.poses[skill.object].position
            self.poses[skill.object] = Pose(here, yaw_rotation(skill.yaw))
        self._carry(skill.object, arm, goal)
        self._let_go(arm)

    def _drop(self, skill: Drop) -> None:
        x, y, z = self.poses[skill.into].position
        arm = self._arm(skill.arm, self.poses[skill.object].position)
        self._carry(skill.object, arm, (x, y, z + self.models[skill.into].size[2] + skill.height))
        self.gripper[arm] = 1.0
        floor = self.frame(skill.into, "support").position[2]
        height, speed = self.poses[skill.object].position[2], 0.0
        while height > floor:
            speed += 9.81 * TICK
            height = max(floor, height - speed * TICK)
            self.poses[skill.object] = Pose((x, y, height), (0.6, 0.8, 0.0, 0.0))
            self.tick()
        self.tick(3)
        self.grasp[arm] = AWAY[arm]

    def _open(self, skill: Open) -> None:
        """Turn the door, the gripper at its handle, in steps of a tenth of the way."""
        model, pose = self.models[skill.object], self.poses[skill.object]
        assert model.hinge is not None
        arm = self._arm(skill.arm, pose.position)
        for i in range(1, 11):
            angle = skill.to * model.hinge.upper * i / 10
            handle = pose * model.hinge.turned(angle) * model.frames["handle"]
            self.hinges[skill.object] = angle
            self.gripper[arm], self.grasp[arm] = 0.0, handle.position
            self.tick()
        self._let_go(arm)

    def _let_go(self, arm: int) -> None:
        for opening in (0.3, 0.6, 1.0):
            self.gripper[arm] = opening
            self.tick()
        self.grasp[arm] = AWAY[arm]
        self.tick(12)
