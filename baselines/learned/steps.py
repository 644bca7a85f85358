"""Plans as steps: what is done next with which object, and where everything is then.

A step is what a policy decides at one look. `labelled` reads a scene's plan as steps and moves the
objects to where each step leaves them: all states of a plan, without physics. `after` says the same
of objects that were seen, so that acting knows what to expect.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from robospa.geometry import Pose, Vec3, rotate, yaw_rotation
from robospa.tasks import plan as calls
from robospa.tasks.catalog import task
from robospa.tasks.environment_state import main_color
from robospa.tasks.objects import assets, model_of, object_model, variant_count
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import Color, ObjectModel
from robospa.workcell import HEIGHT, TABLE_TOP, WIDTH, WORKCELL

TYPES = (
    *("pick", "move", "back", "turn", "drop", "press", "stamp", "dock"),
    *("hang", "hit", "pour", "open", "lift", "wait", "done"),
)
"""move: onto `destination` or to `place`; back: to where it stood at first; turn: as `destination`
lay at first. Press, stamp, hit and lift are once a step."""
WITH_GOAL = ("move", "turn", "drop", "stamp", "dock", "hang", "hit", "pour")
"""Types of steps that have a destination; to move is also to move to a place."""
KINDS = assets()
"""The library's assets."""
WEIGHTS = Path(__file__).parent / "weights"
"""What is served where no other folder is named."""
SAME_PLACE = 0.012
"""A thing that comes as near [m] as that to where it stood at first is brought back."""
MIDDLE = (0.0, 0.0, 1.0)
"""Of a box, in halves of it from the middle of its underside."""
SUNK = 0.06
"""No table is so much lower [m] than usual."""
WIDE = 0.08
"""What is as wide [m] carries others."""


@dataclass(frozen=True)
class Seen:
    """An object as it is seen. `place`: x and y of its origin and z of its underside [m, world];
    `half` sizes [m] and `turn` [rad], of its own axes; `color` linear RGB; `hinge` [rad]."""

    kind: str
    place: Vec3
    half: Vec3
    turn: float
    color: Color
    hinge: float = 0.0


@dataclass(frozen=True)
class Tracked:
    """An object over a trial: as it is `now` and as it was `first` seen; `acts` and `goals` count
    the steps in which it was object and destination. `visible`: it can be seen at present;
    `at_start`: it could be in the first picture."""

    now: Seen
    first: Seen
    acts: int = 0
    goals: int = 0
    visible: bool = True
    at_start: bool = True


@dataclass(frozen=True)
class Step:
    """What is done next. `object` and `destination` count in the state's objects, `place` is x and
    y [m]."""

    type: str
    object: int | None = None
    destination: int | None = None
    place: tuple[float, float] | None = None


@dataclass(frozen=True)
class State:
    """All objects that were ever seen, and the steps done."""

    objects: tuple[Tracked, ...]
    done: tuple[Step, ...] = ()


def model(seen: Seen) -> ObjectModel:
    """The library's model that looks most like it."""
    return object_model(seen.kind, params_of(seen))


def params_of(seen: Seen) -> Mapping[str, object]:
    """Parameters of that model: a block has the sizes seen, of all else there are a few looks."""
    if seen.kind == "block":
        return {"half": list(seen.half), "color": list(seen.color)}
    size = [2 * h for h in seen.half]

    def unlike(look: tuple[Mapping[str, object], Vec3, Color]) -> float:
        return math.dist(size, look[1]) + 0.003 * math.dist(seen.color, look[2])

    return min(_looks(seen.kind), key=unlike)[0]


@cache
def _looks(kind: str) -> list[tuple[Mapping[str, object], Vec3, Color]]:
    forms: list[dict[str, object]] = [{"kind": 0}, {"kind": 1}] if kind == "t_block" else [{}]
    every = [{"look": look, **form} for look in range(variant_count(kind)) for form in forms]
    models = [object_model(kind, params) for params in every]
    return [(p, m.size, main_color(m)) for p, m in zip(every, models, strict=True)]


def pose_of(seen: Seen, made: ObjectModel | None = None) -> Pose:
    """Pose [m, world] of the body frame of its model, or of that which it is known to have."""
    x, y, z = seen.place
    return Pose((x, y, z - (made or model(seen)).bottom), yaw_rotation(seen.turn))


def seen_at(kind: str, made: ObjectModel, pose: Pose, hinge: float = 0.0) -> Seen:
    """A model at a pose, as it is seen by who sees it perfectly."""
    x, y, z = pose.position
    ahead = rotate(pose.rotation, (1.0, 0.0, 0.0))
    half = (made.size[0] / 2, made.size[1] / 2, made.size[2] / 2)
    turn = math.atan2(ahead[1], ahead[0])
    return Seen(kind, (x, y, z + made.bottom), half, turn, main_color(made), hinge)


def labelled(scene: Scene, rng: np.random.Generator | None = None) -> list[tuple[State, Step]]:
    """All states of the scene's plan, each with its next step; the last one is done. With `rng`,
    the things are moved in an order of its own."""
    every = tuple(map(tracked, in_order(scene)))
    state = State(tuple(one for one in every if one.at_start))
    later = every[len(state.objects) :]
    plan, found = numbered(scene), list[tuple[State, Step]]()
    moves = [step for step in plan if step.type != "wait"]
    if rng is not None and len({step.destination for step in moves}) == 1:
        plan[-len(moves) :] = [moves[int(i)] for i in rng.permutation(len(moves))]
    for step in plan:
        found.append((state, step))
        state = after(state, step)
        if step.type == "wait":
            state = hidden(replace(state, objects=state.objects + later))
    return [*found, (state, Step("done"))]


def tracked(item: SceneObject) -> Tracked:
    """An object of a scene, where it is when it appears."""
    seen = seen_at(item.asset, model_of(item), item.pose)
    return Tracked(seen, seen, at_start=item.appears_at is None)


def in_order(scene: Scene) -> list[SceneObject]:
    """The scene's objects as its states number them: those that appear later come last."""
    return sorted(scene.objects, key=lambda item: item.appears_at is not None)


def reminder(state: State, step: Step) -> int | None:
    """Which object says that it is the step's: it is turned like that, or hides that, or looks
    like that, which is hidden."""
    if step.object is None or step.type == "turn":
        return step.destination
    mine = state.objects[step.object].first
    for i, item in enumerate(state.objects):
        alike = item.now.kind == mine.kind and math.dist(item.now.color, mine.color) < 0.05
        below = math.dist(item.now.place[:2], mine.place[:2]) < 0.03
        if not item.visible and not item.acts and i != step.object and (alike or below):
            return i
    return None


def numbered(scene: Scene) -> list[Step]:
    """The steps of the scene's plan, objects numbered as in its states."""
    names: dict[str | None, int] = {item.name: i for i, item in enumerate(in_order(scene))}
    starts = {o.name: o.pose.position for o in scene.objects}
    partners = dict(zip(scene.facts.get("near", ()), scene.facts.get("far", ()), strict=True))
    plan = [c for c in task(scene.task).plan(scene) if not isinstance(c, calls.Home)]
    made = list[Step]()
    while plan:
        call = plan.pop(0)
        if isinstance(call, calls.Pick) and plan and isinstance(plan[0], calls.Place | calls.Drop):
            call = plan.pop(0)
            follow = plan[0] if plan else None
            again = isinstance(follow, calls.Pick) and follow.object == call.object
            if again and isinstance(call, calls.Place) and call.on is None:
                continue  # put down only to be taken anew: handed over, or turned by halves
        (own, goals), name, place = named(call), type(call).__name__.lower(), None
        name = {"place": "move", "raiselower": "lift"}.get(name, name)
        if isinstance(call, calls.Place) and call.on is None:
            if call.yaw is not None:
                name, goals = "turn", [partners[call.object]]
            elif math.dist(call.position, starts[call.object]) < SAME_PLACE:
                name = "back"
            else:
                place = call.position[:2]
        every = [Step(name, names.get(own), names.get(goal), place) for goal in goals]
        made += every * vars(call).get("times", 1)
    return made


def named(call: object) -> tuple[str | None, Sequence[str | None]]:
    """The object that a plan's call is about, and what this is brought to, one after the other."""
    given = vars(call)
    return (
        given.get("object", given.get("tool")),
        given.get("targets", [given.get("on") or given.get("into")]),
    )


def after(state: State, step: Step) -> State:
    """Where everything is after a step that went well."""
    items = list(state.objects)
    if step.object is not None:
        item = items[step.object]
        goal = None if step.destination is None else items[step.destination]
        now, visible = _brought(items, step, item, goal), step.type != "drop"
        items[step.object] = replace(item, now=now, acts=item.acts + 1, visible=visible)
        if goal is not None and step.destination is not None:
            items[step.destination] = replace(goal, goals=goal.goals + 1)
    return hidden(State(tuple(items), (*state.done, step)))


def _brought(items: Sequence[Tracked], step: Step, item: Tracked, goal: Tracked | None) -> Seen:
    """The object of a step, as it is after it."""
    now, (x, y, z) = item.now, item.now.place
    if step.type == "open" and (hinge := model(now).hinge):
        return replace(now, hinge=calls.Open.to * hinge.upper)
    if step.type == "pick":
        return replace(now, place=(x, y, z + calls.Pick.lift))
    if step.type == "back":
        return replace(now, place=item.first.place)
    if step.type == "move" and step.place is not None:
        return replace(now, place=(*step.place, support_height(items, step.place, now)))
    if goal is None:
        return now
    if step.type == "turn":
        return replace(now, turn=goal.first.turn)
    frames = model(goal.now).frames
    frame = pose_of(goal.now) * frames["hang" if step.type == "hang" else "support"]
    if step.type in ("dock", "hang"):
        if step.type == "hang":
            frame = frame * model(now).frames["handle"].inverse()
        return replace(seen_at(now.kind, model(now), frame), color=now.color, half=now.half)
    x, y, top = frame.position
    if step.type in ("hit", "pour"):
        top += calls.Pick.lift
    return replace(now, place=(x, y, goal.now.place[2] if step.type == "drop" else top))


def table_top(heights: Iterable[float]) -> float:
    """Height [m] of the table, by those of the undersides of things, most of which stand on it."""
    low = [z for z in heights if abs(z - TABLE_TOP) < SUNK]
    return float(np.median(low)) if low else TABLE_TOP


def table_below(items: Sequence[Tracked]) -> float:
    """Height [m] of the table, by how its objects were first seen."""
    return table_top(item.first.place[2] for item in items)


def support_height(items: Sequence[Tracked], place: tuple[float, float], but: Seen) -> float:
    """Height [m] of what lies at x and y: the table, or where a wide thing carries others."""
    tops = [
        (pose_of(o.now) * model(o.now).frames["support"]).position[2]
        for o in items
        if o.now is not but and min(o.now.half[:2]) > 0.04 and _covers(o.now, place)
    ]
    return max([z for z in tops if z < TABLE_TOP + 0.1], default=table_below(items))


def taken(state: State, but: int, room: float = 0.0) -> list[tuple[tuple[float, float], float]]:
    """Places [m] that leave no room for the object of that number, and how far around [m]: of all
    that can be seen but what carries others; at least `room`."""
    half = state.objects[but].now.half
    return [
        (o.now.place[:2], max(room, 0.45 * sum((*half[:2], *o.now.half[:2]))))
        for i, o in enumerate(state.objects)
        if i != but and o.visible and max(o.now.half[:2]) < WIDE
    ]


def _covers(seen: Seen, place: Sequence[float]) -> bool:
    dx, dy = place[0] - seen.place[0], place[1] - seen.place[1]
    c, s = math.cos(seen.turn), math.sin(seen.turn)
    return abs(c * dx + s * dy) < seen.half[0] and abs(c * dy - s * dx) < seen.half[1]


def in_picture(seen: Seen) -> bool:
    """Whether its middle is in the head camera's picture."""
    column, row = pixel(seen)
    return 0 < column < WIDTH and 0 < row < HEIGHT


def pixel(one: Seen, shares: Sequence[float] = MIDDLE) -> tuple[float, float]:
    """Where the head camera sees its middle [px], or another place in `shares` of its half sizes
    from the middle of its underside."""
    u, v = WORKCELL.head.pixel(*(np.array(one.place) + np.multiply(one.half, shares)))
    return float(u), float(v)


def is_wall(seen: Seen) -> bool:
    """Whether it is the wall that hides what is behind it."""
    return seen.kind == "block" and seen.half[2] > 0.15 and seen.half[1] < 0.015


def hidden(state: State) -> State:
    """The state with what nobody can see: behind a wall, under a cover, out of the picture."""
    walls = [o.now for o in state.objects if is_wall(o.now)]
    covers = [o.now for o in state.objects if o.now.kind == "cover"]

    def seen(item: Tracked) -> bool:
        now = item.now
        behind = any(now.place[1] > w.place[1] + w.half[1] for w in walls)
        under = any(now is not c and math.dist(now.place, c.place) < 0.03 for c in covers)
        gone = item.acts > 0 and now.place[2] < TABLE_TOP - 0.1
        return in_picture(now) and not (behind or under or gone)

    return replace(state, objects=tuple(replace(o, visible=seen(o)) for o in state.objects))
