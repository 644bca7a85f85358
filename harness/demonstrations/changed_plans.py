"""Plans of the expert that are not the task's own: mistakes, and beginnings in the middle.

Plans are data, so a mistake is another plan: mostly a wrong belief about the scene, else one that
is cut short, repeats a part, or has a skill that goes wrong. The failure analysis is measured on
them.

For an episode that begins in the middle the expert does the first steps of its plan, then the arms
that are free go anywhere, or the next object is dropped a little beside where it was; then the
episode begins, and the expert does the rest.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace

import numpy as np

from robospa.action_space import ARMS
from robospa.geometry import Array, Pose, Vec3, axis_rotation, look_rotation, rotate
from robospa.harness.demonstrations.noise import depths, gaps
from robospa.harness.skills import Expert, SkillFailed
from robospa.harness.skills.bring_in import put_down, translated
from robospa.harness.skills.motion import route, travel
from robospa.harness.skills.pick import pick
from robospa.harness.skills.place import arm_holding
from robospa.harness.skills.touch import press
from robospa.harness.skills.workspace import Steps, Workspace
from robospa.tasks.catalog import task as find_task
from robospa.tasks.objects import object_model
from robospa.tasks.plan import (
    Drop,
    Hit,
    Home,
    Pick,
    Place,
    Press,
    RaiseLower,
    Skill,
    Wait,
)
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot

KINDS = {
    "neighbour": "picks the object nearest to the target instead",
    "beside": "closes (or presses) beside the object, touching nothing",
    "drops": "lifts the right object a little and lets go of it",
    "hovers": "reaches for the right object and never closes",
    "swaps": "exchanges two steps",
    "repeats": "does a step again that is done, then stops",
    "forgets": "does not know any more what lay where",
    "hasty": "does not wait for the cue",
    "stops": "does the first part well, then nothing",
    "nothing": "never moves",
}
"""Mistakes by name."""

LOW = 0.036
"""How high an object is lifted before it is dropped, or put down beside its place [m]: no goal
counts it."""
CLEAR = 0.075
"""Free space [m] between an object and the place beside it at which a gripper closes."""
SIDES = 0.06
"""Free space [m] that place needs on all other sides: half an open gripper."""
PRESS_BESIDE = 0.06
"""A press goes this far [m] from where it should: outside the box in which a press counts."""


@dataclass(frozen=True)
class ActBeside:
    """Do `call` once as if its object lay shifted by `by` [m] in the plane."""

    call: Pick | Press
    by: tuple[float, float]

    def steps(self, ws: Workspace) -> Steps:
        name, seen = self.call.object, ws.snapshot
        x, y, z = seen.poses[name].position
        shifted = Pose((x + self.by[0], y + self.by[1], z), seen.poses[name].rotation)
        of = {field.name: getattr(seen, field.name) for field in fields(Snapshot)}
        ws.snapshot = Snapshot(**{**of, "poses": {**seen.poses, name: shifted}})
        steps = pick(ws, self.call) if isinstance(self.call, Pick) else press(ws, self.call)
        try:
            rows = next(steps)
        finally:
            ws.snapshot = seen
        steps.close()
        ws.update_state((yield rows))
        if isinstance(self.call, Pick):
            for arm in (0, 1):
                if ws.gripper[arm] < 0.5:
                    ws.add(arm, gripper=1.0)
            yield from ws.flush()


@dataclass(frozen=True)
class Hover:
    """Reach for `object` with open gripper, up to where a pick would close, and stay there."""

    object: str

    def steps(self, ws: Workspace) -> Steps:
        """The way in; then nothing for ever, for going home would be another mistake."""
        steps = pick(ws, Pick(self.object))
        rows = next(steps)
        steps.close()
        grippers = ws.robot.action_space("joint").grippers
        closed = [i for i, row in enumerate(rows) if row[grippers].min() < 0.05]
        ws.update_state((yield rows[: closed[0]] if closed else rows))
        while True:
            ws.add(0)
            yield from ws.flush()


@dataclass(frozen=True)
class ReleaseAnywhere:
    """Open the gripper that holds `object`, wherever it is, and lift the arm out of the way."""

    object: str

    def steps(self, ws: Workspace) -> Steps:
        arm = arm_holding(ws, self.object)
        ws.add(arm, gripper=1.0)
        ws.add(arm)
        ws.held[arm] = None
        yield from ws.flush()


@dataclass(frozen=True)
class GoWrong:
    """From here on the plan is not the task's; this itself takes no time."""


@dataclass(frozen=True)
class Wander:
    """The free arms go anywhere; then the episode begins."""

    def steps(self, ws: Workspace, rng: np.random.Generator) -> Steps:
        """Their ways to free places; SkillFailed if none has any."""
        free = [arm for arm in range(len(ARMS)) if ws.held[arm] is None]
        went = False
        for arm in rng.permutation(free).tolist():
            goal = _free_place(ws, arm, rng)
            if goal is not None and (not went or rng.uniform() < 0.5):
                travel(ws, arm, goal, float(rng.uniform(*OPEN)))
                went = True
        if not went:
            raise SkillFailed("no arm finds a free place")
        yield from ws.flush()


@dataclass(frozen=True)
class Displace:
    """`object` is put down beside its place; then the episode begins."""

    object: str

    def steps(self, ws: Workspace, rng: np.random.Generator) -> Steps:
        """Take it, put it down, and stay there; SkillFailed without space."""
        height = ws.pose(self.object).position[2]
        yield from pick(ws, Pick(self.object, LOW))
        arm = ws.held.index(self.object)
        for _ in range(TRIES):
            angle, far = rng.uniform(0.0, 2 * math.pi), rng.uniform(*ASIDE)
            by = (far * math.cos(angle), far * math.sin(angle), 0.0)
            joints = ws.solve(arm, translated(ws.snapshot.end_effector[arm], by), ws.joints[arm])
            if joints is not None and depths(ws, arm, joints[None])[0] <= 0.0:
                ws.add(arm, joints)
                yield from ws.flush()
                yield from put_down(ws, arm, height)
                return
        raise SkillFailed(f"there is no space beside {self.object}")


Call = Skill | ActBeside | Hover | ReleaseAnywhere | GoWrong


class ChangedExpert(Expert):
    """An expert whose plan may have these calls; `failures` lists what it did not bring about.

    A plan with a `Wander` or a `Displace` needs `rng`.
    """

    went_wrong = False
    """True from the plan's `GoWrong` on."""
    begun = False
    """True from the episode's beginning on, in a plan with a `Wander` or a `Displace`."""

    def __init__(
        self,
        scene: Scene,
        snapshot: Snapshot,
        plan: Sequence[object],
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(scene, snapshot, plan)
        self._rng = rng

    def perform(self, call: object) -> Steps:
        ws = self.workspace
        if isinstance(call, GoWrong):
            self.went_wrong = True
        elif isinstance(call, ActBeside | Hover | ReleaseAnywhere):
            yield from call.steps(ws)
        elif self._rng is not None and isinstance(call, Wander | Displace):
            yield from call.steps(ws, self._rng)
            self.begun = True
        else:
            yield from super().perform(call)


def free_side(scene: Scene, name: str) -> tuple[float, float]:
    """A shift [m] that leads beside `name` and away from everything else, on the table."""
    x, y, _ = scene.object(name).pose.position
    radius = {o.name: object_model(o.asset, o.params).radius for o in scene.objects}
    far = radius[name] + CLEAR
    best, found = 0.0, (0.0, 0.0)
    for i in range(16):
        angle = 2 * math.pi * i / 16
        dx, dy = far * math.cos(angle), far * math.sin(angle)
        if abs(x + dx) > 0.45 or not -0.24 < y + dy < 0.2:
            continue
        space = min(
            (
                math.dist((x + dx, y + dy), o.pose.position[:2]) - radius[o.name]
                for o in scene.objects
                if o.name != name
            ),
            default=1.0,
        )
        if space < SIDES:
            continue
        space = min(space, 0.12) - 0.2 * max(0.0, y + dy)  # far places are hard to reach
        if space > best:
            best, found = space, (dx, dy)
    if not best:
        raise ValueError(f"there is no space beside {name} to close a gripper without a touch")
    return found


def split_steps(plan: tuple[Skill, ...]) -> list[list[Skill]]:
    """The plan by steps: calls about one object that follow each other, each press for itself."""
    steps: list[list[Skill]] = []
    last = ""
    for call in plan:
        if isinstance(call, Wait | Home):
            continue
        name = getattr(call, "object", "")
        if name and name == last and not isinstance(call, Press):
            steps[-1].append(call)
        else:
            steps.append([call])
        last = name
    return steps


def join_steps(plan: tuple[Skill, ...], steps: Sequence[Sequence[Call]]) -> tuple[Call, ...]:
    """`steps` with the waits that stand before everything else in `plan`."""
    waits = [call for call in plan if isinstance(call, Wait)]
    return (*waits, *(call for step in steps for call in step))


def with_wrong_facts(scene: Scene, **facts: object) -> Scene:
    """The scene with other facts: what somebody plans on who has them wrong."""
    return replace(scene, facts={**scene.facts, **facts})


def wrong_plan(kind: str, scene: Scene) -> tuple[Call, ...]:
    """The plan of a policy that makes the mistake `kind`; ValueError where that makes no sense."""
    if kind not in KINDS:
        raise ValueError(f"no mistake {kind!r}; there are {', '.join(KINDS)}")
    found = find_task(scene.task)
    plan = found.plan(scene)
    steps = split_steps(plan)
    if kind == "nothing":
        return ()
    if kind == "stops" and len(steps) > 1:
        return join_steps(plan, steps[: max(1, len(steps) // 2)])
    if kind == "neighbour" and "target" in scene.facts:
        return found.plan(with_wrong_facts(scene, target=neighbour(scene)))
    if kind == "hovers" and "target" in scene.facts:
        return (Hover(scene.facts["target"]),)
    if kind in ("beside", "drops"):
        return join_steps(plan, plan_with_failure(kind, scene, steps))
    if kind == "swaps" and "order" in scene.facts and len(steps) > 1:
        order = list(scene.facts["order"])
        i = min(1, len(order) - 2)
        order[i], order[i + 1] = order[i + 1], order[i]
        return found.plan(with_wrong_facts(scene, order=order))
    if kind == "repeats" and len(steps) > 1:
        repeated = repeat_step(scene, steps)
        if repeated:
            return join_steps(plan, repeated)
    if "covers" in scene.facts:
        covers, blocks = list(scene.facts["covers"]), list(scene.facts["blocks"])
        if kind == "hasty":
            return (Pick(blocks[0]),)
        if kind == "forgets" and len(covers) > 1:
            turned = {"covers": covers[1:] + covers[:1], "blocks": blocks[1:] + blocks[:1]}
            return found.plan(with_wrong_facts(scene, **turned))
    raise ValueError(f"{scene.task} level {scene.level} gives no occasion for {kind!r}")


def marked(scene: Scene, plan: Sequence[Call]) -> tuple[Call, ...]:
    """`plan` with `GoWrong` before the first step that is not the task's own."""
    right = find_task(scene.task).plan(scene)
    same = 0
    while same < min(len(plan), len(right)) and plan[same] == right[same]:
        same += 1
    taken = plan[same - 1] if same else None
    # what is picked and where it goes are one step
    if isinstance(taken, Pick) and same < len(plan):
        same -= getattr(plan[same], "object", "") == taken.object
    return (*plan[:same], GoWrong(), *plan[same:])


def occasions(scene: Scene) -> tuple[str, ...]:
    """The mistakes that the scene gives occasion for."""
    found = []
    for kind in KINDS:
        with suppress(ValueError):
            wrong_plan(kind, scene)
            found.append(kind)
    return tuple(found)


def neighbour(scene: Scene) -> str:
    """The object nearest to the target."""
    target = scene.object(str(scene.facts["target"]))
    others = [o for o in scene.objects if o.name != target.name]
    return min(others, key=lambda o: math.dist(o.pose.position[:2], target.pose.position[:2])).name


def plan_with_failure(kind: str, scene: Scene, steps: list[list[Skill]]) -> list[Sequence[Call]]:
    """The steps with one that goes wrong: the second pick if there is one, else the only one."""
    picks = [i for i, step in enumerate(steps) if isinstance(step[0], Pick)]
    if not picks and kind == "drops":
        raise ValueError(f"{scene.task} has nothing to drop")
    wrong = picks[min(1, len(picks) - 1)] if picks else len(steps) - 1
    call = steps[wrong][0]
    bad: list[Call]
    if kind == "drops" and isinstance(call, Pick):
        alone = "target" in scene.facts
        bad = [replace(call, lift=LOW) if alone else call, ReleaseAnywhere(call.object)]
    elif isinstance(call, Press):
        bad = [ActBeside(call, (0.0, PRESS_BESIDE))]
    elif not isinstance(call, Pick):
        raise ValueError(f"{scene.task} ends with {type(call).__name__}: no place beside it")
    else:
        bad = [ActBeside(call, free_side(scene, call.object))]
    return [*steps[:wrong], bad, *steps[wrong + 1 :]]


def repeat_step(scene: Scene, steps: list[list[Skill]]) -> list[list[Skill]]:
    """The first step that can be done again, twice over, and nothing after it; [] if none can."""
    first = steps[0]
    if isinstance(first[0], Press):
        other = any(not isinstance(step[0], Press) for step in steps)
        return [first, first, first] if other else []
    if "covers" in scene.facts:
        return [first, first]
    if "order" in scene.facts and len(steps) > 2:
        return [*steps[:2], steps[1]]
    return []


NEVER = ("MIP",)
"""Categories without such episodes: what has to be remembered is seen before they begin."""
IN_PLACE = ("SDE", "CPI", "RRR", "CVR", "EPG", "SOI")
"""Categories in which sentences name objects by where they lie: there nothing is displaced."""
CARRIES = (Place, Drop)
"""Calls that go on with what an earlier call took."""
TRACELESS = (Press, Hit, RaiseLower, Wait)
"""Calls that leave nothing behind by which a picture shows that they are done: no episode begins
after one, or it would look like one that begins before it."""

REACH_X, REACH_Y, REACH_Z = (-0.05, 0.35), (-0.2, 0.1), (0.14, 0.34)
"""Where fingertips may be at the beginning [m]: x to the arm's own side of the table's middle, y in
the world, z above the table."""
TILT = 0.7
"""The most [rad] by which a gripper is tilted there."""
OPEN = (0.4, 1.0)
"""How wide it is open there."""
APART = 0.1
"""Clearance [m] between the arms there."""
TRIES = 60
ASIDE = (0.02, 0.05)
"""How far beside its place it is put down [m]."""


def middle_plan(scene: Scene, rng: np.random.Generator) -> tuple[object, ...]:
    """The task's plan with a `Wander` or a `Displace` where the episode begins.

    Raises ValueError where the task has no such episodes.
    """
    found = find_task(scene.task)
    if found.category in NEVER:
        raise ValueError(f"{scene.task} has to be remembered from its beginning on")
    plan = found.plan(scene)
    cuts = beginnings(plan)
    at = cuts[int(rng.integers(len(cuts)))]
    call = plan[at]
    displaced = isinstance(call, Pick) and found.category not in IN_PLACE and rng.uniform() < 0.5
    event = Displace(call.object) if displaced and isinstance(call, Pick) else Wander()
    return (*plan[:at], event, *plan[at:])


def beginnings(plan: Sequence[Skill]) -> list[int]:
    """The calls before which nothing is held, and all that is done can be seen."""
    last = next((i for i, call in enumerate(plan) if isinstance(call, TRACELESS)), len(plan) - 1)
    return [i for i in range(last + 1) if not isinstance(plan[i], CARRIES)]


def _free_place(ws: Workspace, arm: int, rng: np.random.Generator) -> Array | None:
    """Joints of a random pose above the table, to which the way is free; None if none is found."""
    for _ in range(TRIES):
        joints = ws.solve(arm, _pose(ws, arm, rng))
        if joints is None or not route(ws, arm, joints).free:
            continue
        both = list(ws.joints)
        both[arm] = joints
        apart = gaps(ws, both[0][None], both[1][None])[0]
        if apart > APART and depths(ws, arm, joints[None])[0] <= 0.0:
            return joints
    return None


def _pose(ws: Workspace, arm: int, rng: np.random.Generator) -> Pose:
    x, y = (-1, 1)[arm] * rng.uniform(*REACH_X), rng.uniform(*REACH_Y)
    z = ws.scene.table_top + rng.uniform(*REACH_Z)
    turn, tilt = rng.uniform(0.0, math.pi), rng.uniform(-TILT, TILT)
    closing: Vec3 = (math.cos(turn), math.sin(turn), 0.0)
    ahead = rotate(axis_rotation(closing, tilt), (0.0, 0.0, -1.0))
    tip = ws.hand(arm).tip
    at = (x - ahead[0] * tip, y - ahead[1] * tip, z - ahead[2] * tip)
    return Pose(at, look_rotation(ahead, closing))
