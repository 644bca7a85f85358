"""Calls of skills in a trial: points in pictures become objects and places, and the expert's skills
(`robospa.harness.skills`) perform them as joint actions.

All points of an answer are read at the instant of its observation, before anything moves. A call
that cannot be done costs what the arms did until then, at least one still action, so that a task's
limit of actions bounds the calls as well; its feedback is a sentence that names no object.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS, quantize
from robospa.geometry import Vec3, rotate
from robospa.harness.pointing import meant
from robospa.harness.policy_calls import PolicyCaller
from robospa.harness.skills import Expert, SkillFailed
from robospa.harness.skills.motion import go_home
from robospa.harness.skills.pick import arms_for
from robospa.harness.skills.workspace import Steps, Workspace
from robospa.harness.trial import TrialState
from robospa.harness.world import TABLE
from robospa.observation import CameraSpec
from robospa.protocol.calls import Call, Point, plain_call, read_calls
from robospa.protocol.policy import PolicySpec
from robospa.tasks import plan

LOST = 0.05
"""A held thing this much farther [m] from the fingers than it is large has slipped out."""
EXCHANGE = tuple(
    (x, y) for y in (-0.08, -0.02, 0.04, -0.14) for x in (-0.03, 0.03, 0.0, 0.09, -0.09)
)
"""Where a thing is put down for the other hand [m], from the middle of a table in its usual place,
the first that is free."""
GAP = 0.06
"""Room [m] between it and other things there."""
DONE = "done"
MET, CUT = "the goal was met", "the trial ended meanwhile"
NOTHING, NOT_HELD, BUSY = "nothing there", "not held", "the hand is not free"
NOT_POSSIBLE, NOT_THERE = "not possible with what is there", "let go, but not where it should be"
REACH = "out of reach"
REASONS = (
    ("could not be lifted", "it could not be lifted"),
    ("is not held", NOT_HELD),
    ("no door", "it has no door with a handle"),
    ("did not hit", "it was not hit"),
    ("could not open|could be opened", "it could not be opened so far"),
)
"""What of a skill's message stands for which feedback; REACH for all others."""
REFUSED = (SkillFailed, ArithmeticError, LookupError, ValueError)
"""What a skill may raise for things that it is not made for: the call fails, not the trial."""


class TrialOver(Exception):
    """No more action can be executed; the text is why the trial ends."""


@dataclass(frozen=True)
class Meant:
    """What a point means: an object's name, or a place on the table [m, world], or neither."""

    name: str | None = None
    spot: Vec3 | None = None


@dataclass(frozen=True)
class ReadCall:
    """A call with what its points mean."""

    call: Call
    at: Meant = Meant()
    to: tuple[Meant, ...] = ()


@dataclass
class SkillTrial:
    """A trial whose policy answers calls."""

    run: TrialState
    answers: PolicyCaller
    limit: int
    """Of actions."""
    expert: Expert = field(init=False)
    yaws: dict[str, float] = field(default_factory=dict)
    """How things stood when they were grasped [rad]."""
    latest: int = 0
    """The arm that took something last."""

    def __post_init__(self) -> None:
        self.expert = Expert(self.run.parts.scene, self.run.world.snapshot(), ())

    @property
    def ws(self) -> Workspace:
        return self.expert.workspace

    def act(self) -> str:
        """Perform the policy's calls until the trial ends; returns why."""
        spec = self.answers.policy.spec
        try:
            while True:
                orders = self.orders(
                    read_calls(self.answers.next_answer(self.run, spec), spec), spec
                )
                finished = self._perform(orders)
                self._look()
                go_home(self.ws, [arm for arm in range(len(ARMS)) if self.ws.held[arm] is None])
                self._drive(self.ws.flush())
                if finished:
                    self._still()
                    return "success" if self.run.end == "success" else DONE
        except TrialOver as over:
            for call in self.run.calls if str(over) == "success" else ():
                call["feedback"] = MET if call["feedback"] == CUT else call["feedback"]
            return str(over)

    # -- what the points mean ------------------------------------------------------------------

    def orders(self, calls: Sequence[Call], spec: PolicySpec) -> list[ReadCall]:
        """`calls` with what their points mean at this instant."""
        self._look()
        cameras = {camera.name: camera for camera in spec.cameras}
        seen = {
            name: self.run.stopwatch.call("rendering", self.run.world.identify, cameras[name])
            for name in dict.fromkeys(call.camera for call in calls)
            if name is not None
        }

        def meant(point: Point | None, call: Call) -> Meant:
            if point is None or call.camera is None:
                return Meant()
            place = call.skill == "place"
            return self._meant(point, cameras[call.camera], seen[call.camera], place)

        return [
            ReadCall(call, meant(call.at, call), tuple(meant(p, call) for p in call.to or ()))
            for call in calls
        ]

    def _meant(
        self, point: Point, camera: CameraSpec, seen: NDArray[np.int16], place: bool
    ) -> Meant:
        """The object drawn at `point`, or nearest to it (`meant`); for a `place`, which leaves
        out what is held, also the table."""
        scene = self.run.parts.scene
        names = [one.name for one in scene.everything]
        ground = self.run.world.view(camera).onto(*point, scene.table_top) if place else None
        usable = seen >= (TABLE if place else 0)
        if place:
            held = [names.index(name) for name in self.ws.held if name is not None]
            column, row = (min(int(s * n), n - 1) for s, n in zip(point, seen.T.shape, strict=True))
            if int(seen[row, column]) in held:
                return Meant(spot=ground)
            usable &= ~np.isin(seen, held)
        found = meant(seen, point, usable)
        if found >= 0:
            return Meant(names[found])
        return Meant(spot=ground) if found == TABLE and place else Meant()

    # -- what is done --------------------------------------------------------------------------

    def _perform(self, orders: list[ReadCall]) -> bool:
        """Perform `orders`; True once one of them is `done`."""
        left = list(orders)
        while left:
            group = [left.pop(0)]
            first = group[0]
            if first.call.skill == DONE:
                self._keep(first, DONE)
                return True
            if first.call.skill == "pick" and left and _together(first.call, left[0].call):
                group.append(left.pop(0))
            self._look()
            before, held = len(self.run.actions), list(self.ws.held)
            for order in group:
                self._keep(order, CUT)
            said = self._done(group)
            for kept, text in zip(self.run.calls[-len(group) :], said, strict=True):
                kept["feedback"] = text
            for arm, name in enumerate(self.ws.held):
                if name is not None and name != held[arm]:
                    self.latest = arm
            if len(self.run.actions) == before:
                for _ in group:
                    self._still()
        return False

    def _keep(self, order: ReadCall, feedback: str) -> None:
        since = {"step": len(self.run.actions), "time": round(self.ws.snapshot.time, 3)}
        self.run.calls.append({**plain_call(order.call), **since, "feedback": feedback})

    def _done(self, group: list[ReadCall]) -> list[str]:
        """Perform a call, or a pick with the place or drop after it; the feedback of each."""
        first = group[0]
        try:
            if len(group) == 2:
                return self._moved(*group)
            if first.call.skill == "handover":
                steps = self._handover(first.call)
            else:
                steps = self.expert.perform(self._planned(first))
            self._drive(steps)
        except REFUSED as error:
            self._forget()
            return [_feedback(error)] * len(group)
        return [DONE]

    def _moved(self, first: ReadCall, then: ReadCall) -> list[str]:
        try:
            take = self._planned(first)
        except SkillFailed as error:
            return [_feedback(error), *self._done([then])]
        assert isinstance(take, plan.Pick)
        try:
            put = self._put(then, take.object)
        except SkillFailed as error:  # what is said to do with it is not possible: it is taken
            return [*self._done([first]), str(error)]
        try:
            self._drive(self.expert.move(take, put))
        except REFUSED as error:
            self._forget()
            text = _feedback(error)
            return [DONE, text] if "cannot be brought" in str(error) else [text, NOT_HELD]
        return [DONE, DONE if self.expert.arrived(put) else NOT_THERE]

    def _planned(self, order: ReadCall) -> object:
        """The plan's call; raises SkillFailed with feedback if there cannot be one."""
        call, name = order.call, order.at.name
        if call.skill == "home":
            return plan.Home(call.arm)
        if call.skill == "wait":
            return plan.Wait(call.seconds or 0.0)
        if call.skill in ("place", "drop"):
            return self._put(order, self._held(call.arm))
        if name is None or any(one.name is None for one in order.to):
            raise SkillFailed(NOTHING)
        if any(one.name == name for one in order.to):
            raise SkillFailed(NOT_POSSIBLE)
        if name in self.ws.held:
            raise SkillFailed("held already")
        goals = tuple(one.name for one in order.to if one.name is not None)
        arm = self._free(call.arm)
        x, y, _ = rotate(self.ws.pose(name).rotation, (1.0, 0.0, 0.0))
        self.yaws[name] = math.atan2(y, x)
        times = call.times or 1
        if call.skill == "pick":
            return plan.Pick(name, call.lift or plan.Pick.lift, arm)
        if call.skill == "press":
            return plan.Press(name, arm=arm)
        if call.skill == "stamp":
            return plan.Stamp(name, goals[0], times, arm=arm)
        if call.skill == "hit":
            return plan.Hit(name, goals, arm)
        if call.skill == "pour":
            return plan.Pour(name, goals[0], arm)
        if call.skill == "hang":
            return plan.Hang(name, goals[0], arm=arm)
        if call.skill == "dock":
            return plan.Dock(name, goals[0], arm=arm)
        if call.skill == "open":
            return plan.Open(name, arm=arm)
        rise = call.lift or plan.RaiseLower.rise
        return plan.RaiseLower(name, rise, times, self._lifting(name, call.arms))

    def _put(self, order: ReadCall, name: str) -> plan.Place | plan.Drop:
        """The call that puts the held `name` down or drops it."""
        call, at = order.call, order.at
        if call.skill == "drop":
            if at.name is None:
                raise SkillFailed(NOTHING)
            return plan.Drop(name, at.name, call.height or plan.Drop.height)
        if at.name == name:
            at = Meant(spot=self.ws.pose(name).position)
        right, ahead = call.offset or (0.0, 0.0)
        turn = None if call.turn is None else self.yaws.get(name, 0.0) + math.radians(call.turn)
        drop = call.height or plan.Place.drop
        if at.name is not None:
            top = self.ws.pose(at.name) * self.ws.models[at.name].frames["support"]
            x, y, z = top.position
            x, y = x + right, y + ahead
            local = top.inverse().apply((x, y, z))
            if call.offset is None or self._over(at.name, (x, y, z)):
                deep = self._nesting(name, at.name)
                return plan.Place(name, (local[0], local[1], deep), at.name, drop, turn)
        elif at.spot is not None:
            x, y = at.spot[0] + right, at.spot[1] + ahead
        else:
            raise SkillFailed(NOTHING)
        z = self.run.parts.scene.table_top - self.ws.models[name].bottom
        return plan.Place(name, (x, y, z), drop=drop, yaw=turn)

    def _over(self, name: str, point: Vec3) -> bool:
        """Whether `point` [m, world] is above the box around an object."""
        x, y, _ = self.ws.pose(name).inverse().apply(point)
        size = self.ws.models[name].size
        return abs(x) <= size[0] / 2 and abs(y) <= size[1] / 2

    def _nesting(self, name: str, below: str) -> float:
        """How far [m] `name` sinks into `below`: a bowl into a bowl."""
        frames = self.ws.models[below].frames
        alike = self.ws.models[name].asset == self.ws.models[below].asset
        if not alike or "nest" not in frames:
            return 0.0
        return frames["nest"].position[2] - frames["support"].position[2]

    def _handover(self, call: Call) -> Steps:
        """Put what is held down in the middle, and take it with the other arm."""
        giver = None if call.arm is None else ARMS[1 - ARMS.index(call.arm)]
        name = self._held(giver)
        taker = 1 - self.ws.held.index(name)
        self._free(ARMS[taker])
        x, y = self._exchange(name)
        z = self.run.parts.scene.table_top - self.ws.models[name].bottom
        yield from self.expert.perform(plan.Place(name, (x, y, z)))
        yield from self.expert.perform(plan.Pick(name, arm=ARMS[taker]))

    def _exchange(self, name: str) -> tuple[float, float]:
        """A place in the middle for `name`, the first that is free."""
        shift = self.run.parts.scene.table_at
        places = [(x + shift[0], y + shift[1]) for x, y in EXCHANGE]
        others = [
            (pose.position[:2], self.ws.models[one].radius + self.ws.models[name].radius + GAP)
            for one, pose in self.ws.snapshot.poses.items()
            if one not in self.ws.held
        ]
        return next((p for p in places if all(math.dist(p, o) > r for o, r in others)), places[0])

    def _held(self, arm: str | None) -> str:
        """What the arm, or else the arm that took something last, holds."""
        for one in (self.latest, 1 - self.latest):
            name = self.ws.held[one]
            if name is not None and one in arms_for(arm):
                return name
        raise SkillFailed(NOT_HELD)

    def _free(self, arm: str | None) -> str | None:
        """An arm that holds nothing: `arm`, or the only one; None for any."""
        free = [ARMS[one] for one in arms_for(arm) if self.ws.held[one] is None]
        if not free:
            raise SkillFailed(BUSY)
        return free[0] if len(free) == 1 else None

    def _lifting(self, name: str, asked: tuple[str, ...] | None) -> tuple[str, ...]:
        """The arms that lift: those `asked` for, both for a thing with two handles, else the one on
        its side."""
        both = {"left", "right"} <= self.ws.models[name].frames.keys()
        side = "left" if self.ws.pose(name).position[0] < 0 else "right"
        arms = tuple(dict.fromkeys(asked or (ARMS if both else (side,))))
        for arm in arms:
            self._free(arm)
        return arms

    # -- how it is done ------------------------------------------------------------------------

    def _look(self) -> None:
        """Take over the state, and forget what has slipped out of a hand."""
        ws = self.ws
        ws.update_state(self.run.world.snapshot())
        for arm, name in enumerate(ws.held):
            if name is not None:
                model, points = ws.models[name], ws.snapshot.grasp_points
                middle = (0.0, 0.0, model.bottom + model.size[2] / 2)
                away = math.dist(ws.pose(name).apply(middle), points[arm])
                if away > max(model.radius, model.size[2] / 2) + LOST:
                    ws.held[arm] = None

    def _forget(self) -> None:
        """Drop what a skill that failed has not sent."""
        self.ws.rows = []
        self._look()

    def _still(self) -> None:
        self._look()
        self._execute(self.ws.row()[None])

    def _drive(self, steps: Steps) -> None:
        """Execute what a skill yields; raises what it raises, and TrialOver."""
        watch = self.run.stopwatch
        try:
            rows = watch.call("planning", next, steps)
            while True:
                self._execute(rows)
                rows = watch.call("planning", steps.send, self.run.world.snapshot())
        except StopIteration:
            return

    def _execute(self, rows: NDArray[np.float64]) -> None:
        spec = self.answers.policy.spec
        for action in quantize(np.asarray(rows, dtype=np.float32)):
            if len(self.run.actions) >= self.limit:
                raise TrialOver("step_limit")
            if spec.history and self.run.actions:
                self.run.remember(spec, len(self.run.actions))
            if self.run.execute(action, spec.executed):
                raise TrialOver(self.run.end)


def _together(take: Call, put: Call) -> bool:
    """Whether the second call puts down or drops what the first one picks."""
    return put.skill in ("place", "drop") and put.arm in (None, take.arm)


def _feedback(error: Exception) -> str:
    """Why a call failed, without the names in the skill's message."""
    text = str(error)
    if not isinstance(error, SkillFailed):
        return NOT_POSSIBLE
    if text in (NOTHING, NOT_HELD, BUSY, NOT_POSSIBLE, "held already"):
        return text
    return next((said for found, said in REASONS if re.search(found, text)), REACH)
