"""Rules that every scene obeys, each a function that returns its violations.

The tests look at a few scenes of every variant, `tools/check_scenes.py` at thousands. No
simulator; nothing here asks the code that draws the scenes: what the head camera sees follows from
the camera's pose and field of view, what an arm reaches from the inverse kinematics of the robot.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from scene_answers import targets_of

from robospa.action_space import ARMS
from robospa.geometry import Pose, look_rotation, to_matrix
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector, inverse
from robospa.harness.skills.pick import LEANS, LEVEL, candidate_poses, world_grasps
from robospa.harness.skills.workspace import Workspace
from robospa.tasks import catalog
from robospa.tasks.objects import object_model
from robospa.tasks.objects.build import points_of
from robospa.tasks.plan import Pick
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import HEIGHT, WIDTH, WORKCELL, grasp_points

TILTS = (0.0, 0.3, 0.6, 0.9, 1.2)
"""How far a gripper may lean away from the arm's base [rad]."""
TOUCH = 5e-4
"""Boxes may share this much [m]: what stands beside another thing is no overlap."""
ROBOT = embodiment("aloha-agilex")
LOWER = ("dustbin", "garbage")
"""Assets that stand on the floor or lie in a bin."""
LARGE = ("tray", "bread_basket")
"""Assets that are only partly in the picture at some of their places (official regions)."""
SEEN_TO = {"mug_rack": "tip"}
"""The frame to which assets are seen whose top is cut off at their official places."""
PARTLY_SEEN = (
    "Put_Bottles_Dustbin",
    "Stack_Blocks_Color_Order",
    "Click_Can_Place_Items",
    "Remember_Color_Cover",
    "Place_Bottle_Cup",
    "Stamp_Seals_Press_Stapler",
)
"""Tasks whose official regions end at the picture's edge: only middles have to be seen there."""
TO_THE_EDGE = (
    *("Pick_Mixed_Objects_Canonical_A", "Pick_Mixed_Objects_Canonical_B"),
    *("Basic_Ordinal_Mixed_Objects_A", "Basic_Ordinal_Mixed_Objects_B"),
)
"""Spatial tasks whose objects may come as near to the picture's edge as they like."""
TURNED = ("SDE", "CBG", "RRR", "CVR", "EPG", "Move_Playing_Cards_Away")
"""Categories and tasks that draw how far objects are turned."""
BEYOND_REACH = ("Remember_Orientation_Restore",)
"""Tasks that show things which no arm is meant to reach."""

LOWERED = 200.0
"""Pixels by which a lower table moves the picture's content outwards, for each metre."""

_TURN = np.linspace(0.0, 2 * math.pi, 17)[:-1]
RING = np.stack([np.cos(_TURN), np.sin(_TURN), np.zeros(16)], axis=1)
_AROUND = np.arange(36) * (math.pi / 36)
AROUND = np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1)
CHAINS = tuple(chain_of(arm) for arm in ROBOT.arms)
SIGNS = np.array(list(itertools.product((-0.5, 0.5), (-0.5, 0.5), (0.0, 1.0))))


def movable(scene: Scene) -> list[SceneObject]:
    """Objects that exist from the start and can be moved."""
    return [o for o in scene.objects if not o.fixed and o.appears_at is None]


def corners(items: Sequence[SceneObject]) -> np.ndarray:
    """(N, 8, 3) corners [m] of the objects' boxes in the world."""
    models = [object_model(item.asset, item.params) for item in items]
    sizes = np.array([model.size for model in models]).reshape(-1, 3)
    local = SIGNS * sizes[:, None]
    local[:, :, 2] += np.array([model.bottom for model in models])[:, None]
    rotations = [to_matrix(item.pose.rotation) for item in items]
    turned = local @ np.array(rotations).reshape(-1, 3, 3).transpose(0, 2, 1)
    at = np.array([item.pose.position for item in items]).reshape(-1, 1, 3)
    return np.asarray(turned + at)


def near(items: Sequence[SceneObject]) -> Iterator[tuple[int, int, float]]:
    """Pairs whose upright cylinders are inside each other, and how deep [m]."""
    radii = np.array([object_model(item.asset, item.params).radius for item in items])
    at = np.array([item.pose.position[:2] for item in items]).reshape(-1, 2)
    apart = np.sqrt(((at[:, None] - at) ** 2).sum(axis=2))
    deep = radii[:, None] + radii - apart
    for i, j in zip(*np.nonzero(np.triu(deep > 0, 1)), strict=True):
        yield int(i), int(j), float(deep[i, j])


def overlap(a: SceneObject, b: SceneObject) -> float:
    """Depth [m] of the overlap of two upright objects, 0 if there is none.

    As columns over their footprints, along the vertical and 36 directions of the plan, and slice by
    slice, because a bowl leans out over a plate's rim.
    """
    pair = (a, b)
    for _, _, least in near(pair):
        p, q = corners(pair)[:, :, 2]
        high = min(p.max() - q.min(), q.max() - p.min())
        u, v = (plan_of(item) @ AROUND.T for item in pair)
        gaps = np.minimum(u.max(axis=0) - v.min(axis=0), v.max(axis=0) - u.min(axis=0))
        depth = min(least, float(high), float(gaps.min()))
        return max(0.0, min(depth, depth_in_slices(a, b)) if depth > 0 else depth)
    return 0.0


SLICE = 0.002
"""Height [m] of the slices in which two things are compared."""


@cache
def _outline(asset: str, params: str) -> np.ndarray:
    """Bound of the radius [m] around the origin of what collides, in each slice from below."""
    model = object_model(asset, json.loads(params))
    wide = np.zeros(math.ceil(model.size[2] / SLICE) + 1)
    edges = SLICE * np.arange(len(wide) + 1)
    for shape in model.shapes:
        if not shape.collision:
            continue
        points = points_of(shape)
        height, radius = points[:, 2] - model.bottom, np.hypot(points[:, 0], points[:, 1])
        above = height > (height.min() + height.max()) / 2
        (low, r), (high, top) = ((height[s], radius[s].max()) for s in (~above, above))
        ends = (low.min(), high.min()) if top > r else (low.max(), high.max())
        bound = np.interp(edges, ends, (r, top))  # radii are convex along the piece's edges
        inside = (edges[1:] > height.min()) & (edges[:-1] < height.max())
        wide[inside] = np.maximum(wide, np.maximum(bound[1:], bound[:-1]))[inside]
    return wide


def depth_in_slices(a: SceneObject, b: SceneObject) -> float:
    """How deep [m] two upright things reach into each other in the slice where they do most."""
    (wide, low), (other, start) = (
        (_outline(o.asset, json.dumps(dict(o.params))), underside(o)) for o in (a, b)
    )
    shift = round((start - low) / SLICE)
    both = [r + other[k - shift] for k, r in enumerate(wide) if 0 <= k - shift < len(other)]
    apart = math.dist(a.pose.position[:2], b.pose.position[:2])
    return max(both, default=0.0) - apart


def underside(item: SceneObject) -> float:
    """Height [m] of an object's underside; all stand upright at the start."""
    return float(item.pose.position[2]) + object_model(item.asset, item.params).bottom


def plan_of(item: SceneObject) -> np.ndarray:
    """(N, 2) points [m, world] around which an object's footprint is the hull."""
    foot = footprint(item.asset, json.dumps(dict(item.params)))
    turned = foot @ to_matrix(item.pose.rotation).T + np.asarray(item.pose.position)
    return np.asarray(turned[:, :2])


def rests_in(a: SceneObject, b: SceneObject) -> bool:
    """True if one of the two starts inside or on the other, as things in a bin do."""
    boxes = dict(zip((a.name, b.name), corners((a, b)), strict=True))
    upper, lower = sorted((a, b), key=lambda item: -boxes[item.name][:, 2].min())
    (left, fore), (right, far) = (
        boxes[lower.name][:, :2].min(axis=0),
        boxes[lower.name][:, :2].max(axis=0),
    )
    x, y, _ = upper.pose.position
    higher = boxes[upper.name][:, 2].min() > boxes[lower.name][:, 2].min() + 1e-3
    return bool(higher and left < x < right and fore < y < far)


def standing(scene: Scene) -> list[SceneObject]:
    """What stands on the table from the start: nothing in a bin, on a stand or on the floor."""
    there = [o for o in scene.objects if o.appears_at is None]
    return [o for o in there if o.asset not in LOWER and underside(o) < scene.table_top + 0.03]


def overlaps(scene: Scene) -> Iterator[str]:
    """Objects that are inside each other, of those that are there together."""
    items = [o for o in scene.objects if o.asset not in LOWER]
    for i, j, _ in near(items):
        a, b = items[i], items[j]
        together = a.appears_at == b.appears_at and _different(a, b, scene.table_top)
        if together and overlap(a, b) > TOUCH and not rests_in(a, b):
            yield f"{a.name} ({a.asset}) is in {b.name} ({b.asset})"


def _different(a: SceneObject, b: SceneObject, table_top: float) -> bool:
    """Whether both may be moved or stand on the table: furniture is made of touching pieces."""
    return not (a.fixed and b.fixed) or max(underside(a), underside(b)) < table_top + 0.03


def _head_matrix() -> np.ndarray:
    """(3, 4) pinhole projection of the head camera: homogeneous pixels of points in the world."""
    camera = WORKCELL.head
    focal = HEIGHT / 2 / math.tan(camera.fov / 2)
    intrinsic = np.array([[focal, 0.0, WIDTH / 2], [0.0, focal, HEIGHT / 2], [0.0, 0.0, 1.0]])
    axes = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # right, down, ahead
    turn = axes @ to_matrix(camera.pose.rotation).T
    shift = -turn @ np.array(camera.pose.position)
    return np.asarray(intrinsic @ np.column_stack([turn, shift]))


HEAD = _head_matrix()


def pixels(points: np.ndarray) -> np.ndarray:
    """(..., 2) columns and rows [px] of points (..., 3) [m] in the head camera's picture."""
    seen = points @ HEAD[:, :3].T + HEAD[:, 3]
    return np.asarray(seen[..., :2] / seen[..., 2:])


def unseen(scene: Scene) -> Iterator[str]:
    """Objects on the table that the head camera does not see whole (see `PARTLY_SEEN`).

    Scenes are drawn on the usual table: a lower one may move them to or over the picture's edge.
    """
    spatial = catalog.task(scene.task).dimension != "procedural"
    margin = spatial and scene.task not in TO_THE_EDGE
    free = 0.02 * np.array([WIDTH, HEIGHT]) - 0.5 if margin else np.array([-1.0, -1.0])
    free = free - LOWERED * max(0.0, -scene.table_rise)
    middle_only = scene.task in PARTLY_SEEN
    for item in (*standing(scene), *movable(scene)):
        model = object_model(item.asset, item.params)
        middle = middle_only or item.asset in LARGE
        x, y, z = item.pose.position
        base = (x, y, z + model.bottom)
        foot = footprint(item.asset, json.dumps(dict(item.params)))
        foot = foot[:1] * 0.0 if middle else foot @ to_matrix(item.pose.rotation).T
        top = (x, y, base[2] + (0.0 if middle else model.size[2]))
        if item.asset in SEEN_TO:
            top = (item.pose * model.frames[SEEN_TO[item.asset]]).position
        at = pixels(np.vstack([foot + base, [top]]))
        if (at < free).any() or (at > np.array([WIDTH, HEIGHT]) - free).any():
            yield f"{item.name} ({item.asset}) is out of view"


@cache
def footprint(asset: str, params: str) -> np.ndarray:
    """(N, 3) points [m] under an object, as it stands unturned, around its origin's foot."""
    model = object_model(asset, json.loads(params))
    points = np.concatenate([points_of(shape) for shape in model.shapes])
    points[:, 2] = 0.0
    hull = np.unique((points @ RING.T).argmax(axis=0))
    return np.asarray(points[hull])


def sunk(scene: Scene) -> Iterator[str]:
    """Objects that do not rest on the table: sunk into it, or above it though they can move."""
    for item in scene.objects:
        if item.appears_at is None and item.asset not in LOWER:
            high = underside(item) - scene.table_top
            if high < -1e-6 or (high > 1e-6 and not item.fixed):
                yield f"{item.name} ({item.asset}) is {1000 * high:.1f} mm above the table's top"


def named(scene: Scene) -> Iterator[str]:
    """Names that are not numbers in the order of creation."""
    names = [o.name for o in scene.objects]
    if names != [f"object_{i}" for i in range(len(names))]:
        yield f"objects are called {names}"


def unreachable(scene: Scene) -> Iterator[str]:
    """Movable objects above which no arm can bring its gripper to a grasp, tilted or not."""
    items = [] if scene.task in BEYOND_REACH else [o for o in standing(scene) if not o.fixed]
    for nearer in (True, False):  # the other arm is asked only about what the nearer one misses
        missed: list[SceneObject] = []
        for arm in range(len(CHAINS)):
            mine = [o for o in items if ((o.pose.position[0] > 0) == (arm == 1)) == nearer]
            missed += [o for o, good in zip(mine, _graspable(mine, arm), strict=True) if not good]
        items = missed
    yield from (f"{item.name} ({item.asset}) is out of reach" for item in items)


def _graspable(items: Sequence[SceneObject], arm: int) -> list[bool]:
    """Whether inverse kinematics finds joints for a gripper around each object's origin."""
    ahead = ROBOT.arms[arm].gripper.grasp_centre
    poses = []
    for item in items:
        point = np.add(item.pose.position, (0.0, 0.0, 0.02))
        away = point[:2] - ROBOT.arms[arm].base.position[:2]
        out = np.append(away / np.hypot(*away), 0.0)
        for tilt in TILTS:
            approach = math.sin(tilt) * out - (0.0, 0.0, math.cos(tilt))
            across = (-float(out[1]), float(out[0]), 0.0)
            x, y, z = point - ahead * approach
            poses.append(Pose((x, y, z), look_rotation(tuple(approach), across)))
    if not poses:
        return []
    found = inverse(CHAINS[arm], poses)[1].reshape(len(items), len(TILTS))
    return [bool(good) for good in found.any(axis=1)]


def unpickable(scene: Scene) -> Iterator[str]:
    """Objects whose first pick no grasp of the plan's arm reaches where they lie at the start."""
    ws, seen = _at_start(scene), set()
    for call in catalog.task(scene.task).plan(scene):
        if isinstance(call, Pick) and call.object not in seen:
            seen.add(call.object)
            arms = (0, 1) if call.arm is None else (ARMS.index(call.arm),)
            if call.object in ws.snapshot.poses and not _reached(ws, call.object, arms):
                yield f"{call.object} ({scene.object(call.object).asset}) is out of reach"


def _at_start(scene: Scene) -> Workspace:
    """The scene as drawn, both arms at home with open grippers."""
    joints = (ROBOT.arms[0].home, ROBOT.arms[1].home)
    poses = {o.name: o.pose for o in scene.everything if o.appears_at is None}
    ends = _home()
    points = grasp_points(ROBOT.grippers, ends)
    start = Snapshot(0.0, poses, (1.0, 1.0), ends, joints, grasp_points=points)
    return Workspace(scene, ROBOT, start)


@cache
def _home() -> tuple[Pose, Pose]:
    left, right = (end_effector(chain_of(arm), arm.home) for arm in ROBOT.arms)
    return left, right


def _reached(ws: Workspace, name: str, arms: tuple[int, ...]) -> bool:
    """True if inverse kinematics finds joints of one of `arms` for a grasp of the object."""
    body = ws.pose(name)
    for leans in (LEVEL, LEANS):
        for arm in sorted(arms, key=lambda k: (body.position[0] > 0) != (k == 1)):
            hand = ws.hand(arm)
            grasps = world_grasps(ws.models[name], body, hand)
            upright = [replace(grasp, tilt=0.0) for grasp in grasps[:1]]  # takes most objects
            for grasp in (*upright, *grasps):
                poses = [p for p, _, _ in candidate_poses(grasp, hand, ws.scene.table_top, leans)]
                if poses and inverse(ws.chains[arm], poses)[1].any():
                    return True
    return False


def awkward(scene: Scene) -> Iterator[str]:
    """Objects far from the robot, of tasks that draw turns, which no gripper can close around."""
    drawn = catalog.task(scene.task).category in TURNED or scene.task in TURNED
    for item in movable(scene) if drawn else ():
        if item.pose.position[1] > WORKCELL.sideways_from:
            turn = to_matrix(item.pose.rotation)
            grasps = object_model(item.asset, item.params).grasps
            sideways = [abs(float((turn @ np.array(g.closing))[0])) for g in grasps]
            if max(sideways) < math.cos(WORKCELL.sideways_within) - 1e-9:
                yield f"{item.name} ({item.asset}) is turned so that no grasp closes sideways"


def misplaced(scene: Scene) -> Iterator[str]:
    """True if the facts of a single-target scene name another object, or none, or two."""
    if "target" in scene.facts and (found := targets_of(scene)) != [scene.facts["target"]]:
        yield f"the facts single out {found}, not {scene.facts['target']}"


def cluttered(scene: Scene) -> Iterator[str]:
    """Clutter in an object or in other clutter, not on the table, or in the line of sight.

    The lines are those from the head camera to the middle of an object and of its top.
    """
    for item in scene.clutter:
        x, y, _ = item.pose.position
        model = object_model(item.asset, item.params)
        if abs(underside(item) - scene.table_top) > 1e-6:
            yield f"{item.name} ({item.asset}) does not stand on the table"
        if abs(x - scene.table_shift[0]) + model.radius > 0.6 or abs(y) + model.radius > 0.34:
            yield f"{item.name} ({item.asset}) reaches over the table's edge"
    items = [o for o in scene.everything if o.asset not in LOWER]
    pairs = near(items) if scene.clutter else ()
    for first, other in ((items[i], items[j]) for i, j, _ in pairs):
        if other in scene.clutter and (first in scene.clutter or _meet(other, first)):
            yield f"{other.name} ({other.asset}) is in {first.name} ({first.asset})"
    yield from _hidden(scene)


def _meet(round_one: SceneObject, other: SceneObject) -> bool:
    """Whether an upright cylinder around one meets the other's box, both seen from above."""
    radius = object_model(round_one.asset, round_one.params).radius
    middle = np.array(round_one.pose.position[:2]) @ AROUND.T
    box = corners((other,))[0, :, :2] @ AROUND.T
    apart = np.maximum(middle - radius - box.max(axis=0), box.min(axis=0) - middle - radius)
    return bool((apart < 0).all())


ALONG = np.linspace(0.6, 1.0, 160)[:, None, None]
"""Points on a line of sight, from the camera (0) to what is looked at (1)."""


def _hidden(scene: Scene) -> Iterator[str]:
    """Objects whose middle, or the middle of whose top, clutter hides."""
    items = standing(scene)
    if not items or not scene.clutter:
        return
    boxes = corners(items)
    points = np.concatenate([boxes.mean(axis=1), boxes[:, 1::2].mean(axis=1)])
    eye = np.array(WORKCELL.head.position)
    line = eye + ALONG * (points - eye)
    for item in scene.clutter:
        model = object_model(item.asset, item.params)
        x, y, _ = item.pose.position
        low = line[..., 2] < underside(item) + model.size[2]
        inside = low & (np.hypot(line[..., 0] - x, line[..., 1] - y) < model.radius)
        for k in np.flatnonzero(inside.any(axis=0)):
            hidden = items[int(k) % len(items)]
            yield f"{item.name} ({item.asset}) hides {hidden.name} ({hidden.asset})"


RULES: Mapping[str, Callable[[Scene], Iterator[str]]] = {
    "overlap": overlaps,
    "view": unseen,
    "table": sunk,
    "names": named,
    "reach": unreachable,
    "turn": awkward,
    "pick": unpickable,
    "answer": misplaced,
    "clutter": cluttered,
}
