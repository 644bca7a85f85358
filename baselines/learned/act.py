"""Acting: a step of a plan, performed on an imagined scene.

What was seen (`Seen`) is imagined as the library's models, and the expert's skills plan on these.
They are told of no true pose: what a gripper closes around comes along, what it lets go of stays,
and the next look, once empty arms are out of the way, puts right where everything is. A gripper
that closed on nothing is seen by how far it closed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.baselines.learned import steps
from robospa.baselines.learned.steps import Seen, State, Step, Tracked
from robospa.geometry import Pose, rotate
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.skills.pick import world_grasps
from robospa.observation import KIND_BITS, SLOTS, Observation
from robospa.tasks import plan as calls
from robospa.tasks.environment_state import kind_code
from robospa.tasks.families import memory
from robospa.tasks.families.dustbin import BIN, ROOM, discard, exchange_place
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot, pose_of_row, snapshot_from_json
from robospa.workcell import TABLE_TOP

Rows = NDArray[np.float32]
NEAR_HOME = 0.2
"""An arm whose joints are all so close [rad] to home hides nothing."""
AROUND = 0.02
"""A gripper that closes so far [m] beside an object's box takes it."""
SHUT = 0.02
"""A gripper that is told to close is told to close wholly."""
EMPTY = 0.4
"""One that holds something is open by more than this share of its width, from shut on."""
NEARLY = 0.015
"""What is seen so near [m] to where it was believed to be is taken to be in the middle."""
PILED, BLURRED = 0.03, 12.0
"""Things so near [m] to each other lie on each other: they are often seen as one, and at a wrong
height, so that what is seen within so many pixels says nothing new."""
FALLEN = Pose((0.0, 0.0, -calls.Place.drop))
"""What becomes of a pose where something is let go of: it falls so far [m]."""
FLOATS, BACK, BEHIND = 0.06, 0.1, 0.09
"""What seems to lie so high [m] above the table is on a stand; what is hidden by a wall was at a
larger y [m], and about so far [m] behind it."""
CROWD = 0.08
"""What is seen for the first time so near [m] to what is known is a part or a pile of that."""
SAME = 0.15
"""What is seen within this [m], colours' distance counted a tenth, is what was there before."""
WAIT = 2.6
"""Seconds until what hides the cue is there [s]; official: 2."""
TURN_AT_ONCE = 0.2
"""Only so far [m] from the middle or more can an arm make half a turn at once."""
LIFT, RISE = 0.08, 0.11
"""How high [m] things are lifted: to be set down again, and with both arms or to go elsewhere."""


def told(observation: Observation) -> list[Seen]:
    """The objects of an environment state: what a perfect eye would see."""
    codes = {tuple(kind_code(kind)): kind for kind in steps.KINDS}
    rows, found = observation["environment_state"].astype(float).reshape(SLOTS, -1), []
    for row in rows[rows[:, 0] > 0].tolist():
        kind = codes[tuple(row[-KIND_BITS:])]
        _, x, y, z, cos, sin, *_, a, b, c, red, green, blue, hinge = row[:-KIND_BITS]
        place = (x, y, z - (c if kind == "block" else 0.0))
        turn = math.atan2(sin, cos)
        found.append(Seen(kind, place, (a, b, c), turn, (red, green, blue), hinge))
    return found


NEEDS = {"hang": ("handle", "hang"), "hit": ("head", "press")}
"""The frames that object and destination of a step of a type must have."""
ONTO = {"dock": calls.Dock, "hang": calls.Hang, "pour": calls.Pour}


def imagined(item: Tracked) -> bool:
    """Whether an object is in the imagined scene: it is seen, or hidden but on the table."""
    return item.visible or item.now.place[2] > TABLE_TOP - 0.1


def possible(step: Step, state: State) -> bool:
    """Whether a step can be tried at all."""
    if step.type == "wait" or step.type == "done":
        return True
    if step.object is None or step.object == step.destination:
        return False
    named = [state.objects[i] for i in (step.object, step.destination) if i is not None]
    if not all(imagined(item) for item in named):
        return False
    if step.destination is None:
        return step.type not in steps.WITH_GOAL or step.place is not None
    own, other = NEEDS.get(step.type, ("support", "support"))
    things = (state.objects[step.object].now, state.objects[step.destination].now)
    return own in steps.model(things[0]).frames and other in steps.model(things[1]).frames


def calls_of(same: Sequence[Step], state: State, scene: Scene) -> list[object]:
    """The skill calls that do the `same` steps, one after the other, in the imagined scene."""
    step, count = same[0], len(same)
    if step.object is None:
        return [calls.Wait(WAIT)] if step.type == "wait" else []
    name, item = str(step.object), state.objects[step.object]
    on = "" if step.destination is None else str(step.destination)

    def side(number: int) -> str:
        return ARMS[int(state.objects[number].now.place[0] > 0)]

    match step.type:
        case "pick":
            return [calls.Pick(name)]
        case "press":
            pressed = [s.object for s in same if s.object is not None]
            return [calls.Press(str(number), arm=side(number)) for number in pressed]
        case "stamp":
            return [calls.Stamp(name, on, count)]
        case "dock" | "hang" | "pour":
            return [ONTO[step.type](name, on)]
        case "hit":
            return [calls.Hit(name, tuple(str(s.destination) for s in same))]
        case "open":
            return [calls.Open(name)]
        case "lift" if item.now.kind == "kitchen_pot":
            return [calls.RaiseLower(name, RISE, count, ARMS)]
        case "lift":
            return [calls.RaiseLower(name, LIFT, count, (side(step.object),))]
        case "drop":
            place = exchange_place(steps.taken(state, step.object, ROOM))
            return list(discard(scene, name, on, place))
    return _moved(step, state)


def _moved(step: Step, state: State) -> list[object]:
    assert step.object is not None
    name, item = str(step.object), state.objects[step.object]
    goal = None if step.destination is None else state.objects[step.destination]
    (x, y, z), low = item.first.place, -steps.model(item.now).bottom
    lift, yaws = RISE if step.type == "back" else LIFT, list[float | None]([None])
    if step.type == "turn" and goal is not None:
        yaw = round(goal.first.turn / (math.pi / 2)) * math.pi / 2
        half = math.cos(yaw - item.now.turn) < -0.7 and abs(x) < TURN_AT_ONCE
        yaws = [yaw - math.pi / 2, yaw] if half else [yaw]
    elif goal is not None:
        frames = steps.model(goal.now).frames
        top = goal.now.place[2] + 2 * goal.now.half[2] - steps.table_below(state.objects)
        up = 0.0
        if item.now.kind == "bowl" == goal.now.kind:
            up = frames["nest"].position[2] - frames["support"].position[2]
        drop = 0.02 if goal.now.kind == "bread_basket" else calls.Place.drop
        on = calls.Place(name, (0.0, 0.0, up), on=str(step.destination), drop=drop)
        return [calls.Pick(name, max(LIFT, min(0.16, top + 0.06))), on]
    elif step.place is not None:
        (x, y), z = step.place, steps.support_height(state.objects, step.place, item.now)
    pairs = ((calls.Pick(name, lift), calls.Place(name, (x, y, z + low), yaw=a)) for a in yaws)
    return [call for pair in pairs for call in pair]


@dataclass
class Grip:
    """What an arm holds, how it lies in the hand, its width between the fingers [m], and where it
    was before."""

    number: int
    offset: Pose
    width: float
    before: Pose


def furnished(seen: Sequence[Seen]) -> list[Seen]:
    """What is seen, with the bin for bottles among cups, whose rim is not found beside arms that no
    picture learned from shows; and with the stand below what floats at the back, of which no part
    is a thing."""
    kinds = {one.kind for one in seen}
    if "bottle" in kinds <= {"bottle", "cup", "coaster"}:
        return [*seen, the_bin()]
    shown = [one for one in seen if one.place[2] > TABLE_TOP + FLOATS]
    if not shown or any(one.half[0] > memory.SHOWN_X for one in seen):
        return list(seen)
    made = memory.BLOCKS_STAND.params
    half = made["half"]
    y, top = (float(np.median([one.place[i] for one in shown])) for i in (1, 2))
    stand = Seen("block", (0.0, y, top - 2 * half[2]), half, 0.0, made["color"])
    parts = [o for o in seen if o.kind == "block" and o.place[1] > y - half[1] and o not in shown]
    return [stand, *(one for one in seen if one not in parts)]


def the_bin() -> Seen:
    """The bin beside the table: it always stands at the same place, and only its rim is in view."""
    return steps.seen_at("dustbin", object_model("dustbin", {"look": 0}), BIN)


def wall_before(lost: Sequence[Seen], seen: Sequence[Seen]) -> list[Seen]:
    """The wall behind which things at the back were `lost` while nothing moved, if any were."""
    places = [one.place[:2] for one in seen]
    back = [o.place[1] for o in lost if o.place[1] > BACK and _nearest(o, places) > CROWD]
    if not back or any(map(steps.is_wall, seen)):
        return []
    place = (0.0, min(back) - BEHIND, TABLE_TOP)
    return [Seen("block", place, memory.WALL_HALF, 0.0, memory.WALL_COLOR)]


class Belief:
    """Where all objects of a trial are, by what was seen and by what the arms did since."""

    def __init__(self, robot: Embodiment, seen: Sequence[Seen], state: Rows) -> None:
        self.robot = robot
        self.chains = [chain_of(arm) for arm in robot.arms]
        self.columns = robot.action_space("joint").arms
        seen = furnished(seen)
        self.state = State(tuple(Tracked(one, one) for one in seen))
        self.poses = [steps.pose_of(one) for one in seen]
        self.held: list[Grip | None] = [None, None]
        self.last = state
        """What was commanded last (D,), or the first state."""

    def scene(self) -> Scene:
        """The imagined scene; objects are called by their numbers."""
        items = tuple(
            SceneObject(str(i), o.now.kind, self.poses[i], steps.params_of(o.first))
            for i, o in enumerate(self.state.objects)
            if imagined(o)
        )
        rise = steps.table_below(self.state.objects) - TABLE_TOP
        return Scene("imagined", 1, 0, self.robot.name, "clean", items, {}, table_rise=rise)

    def snapshot(self, observation: Observation, scene: Scene) -> Snapshot:
        """This instant, as imagined."""
        data = {
            "time": 0.0,
            "poses": {},
            "gripper": [self.last[c.gripper] for c in self.columns],
            "end_effector": observation["ee"][:, :7],
            "joints": [self.last[c.body] for c in self.columns],
            "measured": [observation["state"][c.body] for c in self.columns],
        }
        numbers = {item.name: int(item.name) for item in scene.objects}
        return replace(
            snapshot_from_json(data, self.robot.grippers),
            poses={name: self.poses[i] for name, i in numbers.items()},
            hinges={name: self.state.objects[i].now.hinge for name, i in numbers.items()},
        )

    def out_of_the_way(self) -> bool:
        """Whether no arm is over the table: no picture that was learned from shows one there."""
        return all(
            np.abs(self.last[c.body] - np.array(arm.home)).max() < NEAR_HOME
            for c, arm in zip(self.columns, self.robot.arms, strict=True)
        )

    # -- by what the arms do -------------------------------------------------------------------

    def advance(self, rows: Rows, target: int | None, observation: Observation) -> None:
        """Take over what commanded `rows` (T, D) did with object number `target`."""
        for row in rows:
            for arm, c in enumerate(self.columns):
                old, new = float(self.last[c.gripper]), float(row[c.gripper])
                if self.held[arm] is None and new < SHUT < old and target is not None:
                    self._close(arm, row, target)
                elif (hold := self.held[arm]) is not None and new > old + 0.02:
                    self.put(hold.number, FALLEN * self._end(arm, row) * hold.offset)
                    self.held[arm] = None
            self.last = row
        holds = [(arm, hold) for arm, hold in enumerate(self.held) if hold is not None]
        shut = [hold.number for arm, hold in holds if self._shut(arm, hold, observation)]
        for arm, hold in holds:
            if hold.number in shut:
                self.put(hold.number, hold.before)
                self.held[arm] = None
            else:
                self.put(hold.number, pose_of_row(observation["ee"][arm, :7]) * hold.offset)

    def _shut(self, arm: int, hold: Grip, observation: Observation) -> bool:
        """Whether the fingers of an arm that should hold something came together."""
        own = self.robot.arms[arm]
        shut, full = (own.gripper_value(w) for w in (own.gripper.gap, hold.width))
        share = float(observation["state"][self.columns[arm].gripper])
        return share < shut + EMPTY * (full - shut)

    def _end(self, arm: int, row: Rows) -> Pose:
        return end_effector(self.chains[arm], row[self.columns[arm].body].astype(float).tolist())

    def _close(self, arm: int, row: Rows, target: int) -> None:
        """Hold the object if the fingers are about it, in their middle."""
        hand, end, pose = self.robot.arms[arm].gripper, self._end(arm, row), self.poses[target]
        point = np.array(end.apply((hand.grip, 0.0, 0.0)))
        made = steps.model(self.state.objects[target].first)
        x, y, z = pose.inverse().apply(tuple(point.tolist()))
        z -= made.bottom + made.size[2] / 2
        if any(abs(v) > s / 2 + AROUND for v, s in zip((x, y, z), made.size, strict=True)):
            return
        across = np.array(rotate(end.rotation, (0.0, 1.0, 0.0)))
        best = min(
            world_grasps(made, pose, hand),
            key=lambda g: math.dist(g.point, point) - 0.1 * abs(float(np.dot(g.closing, across))),
            default=None,
        )
        if best is None:
            return
        shift = across * float(np.dot(point - np.array(best.point), across))
        px, py, pz = (np.array(pose.position) + shift).tolist()
        offset = end.inverse() * Pose((px, py, pz), pose.rotation)
        self.held[arm] = Grip(target, offset, best.width, pose)

    def put(self, number: int, pose: Pose) -> None:
        """Object `number` is at `pose` now."""
        self.poses[number] = pose
        items = list(self.state.objects)
        item = items[number]
        at = steps.seen_at(item.now.kind, steps.model(item.first), pose)
        items[number] = replace(item, now=replace(item.now, place=at.place, turn=at.turn))
        self.state = replace(self.state, objects=tuple(items))

    # -- by what is seen -----------------------------------------------------------------------

    def look(self, seen: Sequence[Seen], waiting: bool = False) -> None:
        """Put right where everything is; what was never seen before is new, and while `waiting` it
        may come over what is known. What is not seen, and nothing hides, is where it was."""
        items = list(self.state.objects)
        pairs = sorted(
            (cost, i, k)
            for i, item in enumerate(items)
            for k, one in enumerate(seen)
            if (cost := _unlike(item, one)) < math.inf
        )
        found: dict[int, int] = {}
        for _, i, k in pairs:
            if i not in found and k not in found.values():
                found[i] = k
                now = _seen_again(items[i].now, seen[k], _piled(i, items))
                items[i] = replace(items[i], now=now, visible=True)
                self.poses[i] = steps.pose_of(now)
        known = [item.now.place[:2] for item in items if imagined(item)]
        lost = set(range(len(items))) - set(found)
        add = [one for k, one in enumerate(seen) if k not in found.values()]
        if waiting:
            add += wall_before([items[i].now for i in lost if items[i].visible], seen)
        else:
            add = [one for one in add if _nearest(one, known) > CROWD]
        for i in lost:
            there = items[i].visible and (items[i].at_start or steps.is_wall(items[i].now))
            items[i] = replace(items[i], visible=there)
        items += [Tracked(one, one, at_start=False) for one in add]
        self.poses += [steps.pose_of(one) for one in add]
        state = replace(self.state, objects=tuple(items))
        pairs_seen = zip(items, steps.hidden(state).objects, strict=True)
        objects = tuple(replace(o, visible=o.visible and h.visible) for o, h in pairs_seen)
        self.state = replace(state, objects=objects)


def _nearest(one: Seen, places: Iterable[Sequence[float]]) -> float:
    """How far it is [m] from the nearest of places on the table."""
    return min((math.dist(one.place[:2], place) for place in places), default=math.inf)


def _piled(number: int, items: Sequence[Tracked]) -> bool:
    """Whether something lies on or below the item of that number."""
    places = [o.now.place[:2] for i, o in enumerate(items) if i != number and imagined(o)]
    return _nearest(items[number].now, places) < PILED


def _unlike(item: Tracked, one: Seen) -> float:
    """How little `one` is like the object; infinite for another one."""
    near = math.dist(item.now.place, one.place)
    if item.now.kind != one.kind:
        return math.inf
    look = 0.1 * math.dist(item.first.color, one.color) + math.dist(item.first.half, one.half)
    return near + look if near < SAME or look < 0.03 else math.inf


def _seen_again(believed: Seen, seen: Seen, piled: bool) -> Seen:
    """What was believed, where it is seen; half way if that is near."""
    place = seen.place
    if piled and math.dist(steps.pixel(believed), steps.pixel(seen)) < BLURRED:
        place = believed.place
    elif math.dist(believed.place, place) < NEARLY:
        (ax, ay, az), (bx, by, bz) = believed.place, place
        place = ((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)
    return replace(believed, place=place, turn=seen.turn, hinge=seen.hinge)
