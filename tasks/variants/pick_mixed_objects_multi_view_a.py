"""Pick Mixed Objects Multi View A (CVR): pick the extreme object as seen from a named side.

Different objects lie free on the table. One of four extremes (leftmost, rightmost, farthest,
nearest) is asked for in the words of one of four viewers: the robot, one opposite, one at the
left and one at the right of the table. Viewpoints exist in words only; no image shows them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robospa.tasks.geometry import Array
from robospa.tasks.goals.pick import Lift
from robospa.tasks.instructions import words_spatial
from robospa.tasks.instructions.words import Slots
from robospa.tasks.layouts import Mask, head_pixel, in_head_view
from robospa.tasks.packing import Fits, pool, walk
from robospa.tasks.scene import TABLE_TOP, Scene, SceneObject
from robospa.tasks.task import Draft, Level, Task
from robospa.tasks.variants.picking import drawn_yaw, lifted, pick_target
from robospa.tasks.variants.tabletop import draw_look, standing

ASSETS = ("block", "bread", "seal", "toycar", "phone", "rubikscube", "remote_control")
OBJECTS = {1: 3, 2: 4, 3: 5, 4: 6, 5: 7}
"""How many objects lie there; the paper's n counts the at most four extreme ones."""
BLOCK_HALF = 0.015
BLOCK_COLORS = (
    (0.84, 0.22, 0.18), (0.16, 0.58, 0.82), (0.22, 0.67, 0.28),
    (0.90, 0.74, 0.18), (0.58, 0.34, 0.80), (0.28, 0.28, 0.28),
)  # fmt: skip

RADIUS, TALL = 0.052, 0.08
"""Bounds of footprint and height [m] of all seven; every object is given the largest one's room."""
REGION = ((-0.24 + RADIUS, 0.24 - RADIUS), (-0.225 + RADIUS, 0.095 - RADIUS))
"""x and y range [m] of the origins: the official rectangle less the largest radius."""
SPACING_X, SPACING_Y, SPACING = 0.126, 0.098, 0.118
"""Two objects are this far apart in x or in y, and by the last one in any case [m]."""
PIXELS = 60.0
"""Least distance of two objects' centres in the head image [px]."""
MARGIN = (0.05, 0.05)
EXTREME = 0.06
"""The asked object leads by more than this [m]."""
SHIFT = 0.02
"""A layout's places are moved once more by up to this [m] in each trial, where they fit."""
# Two layouts of seven for each of EXTREMES, the extreme place first: where the pool starts.
STARTS = (
    (((-0.186, 0.027), (-0.053, -0.025), (0.184, 0.036), (0.006, -0.171),
      (0.078, -0.067), (0.144, -0.166), (-0.12, -0.16)),
     ((-0.185, -0.17), (0.089, 0.041), (-0.041, 0.042), (-0.122, -0.067),
      (-0.051, -0.171), (0.08, -0.162), (0.179, -0.062))),
    (((0.187, 0.039), (0.076, -0.06), (-0.051, -0.025), (0.122, -0.169),
      (-0.183, -0.135), (-0.186, 0.02), (-0.006, -0.163)),
     ((0.176, -0.07), (-0.091, -0.166), (-0.098, 0.043), (-0.182, -0.064),
      (-0.009, -0.065), (0.064, -0.168), (0.089, 0.036))),
    (((0.057, 0.042), (-0.111, -0.172), (-0.049, -0.067), (0.186, -0.021),
      (0.021, -0.172), (-0.188, -0.057), (0.148, -0.162)),
     ((-0.178, 0.04), (0.142, -0.172), (0.186, -0.026), (0.014, -0.17),
      (0.054, -0.026), (-0.074, -0.068), (-0.149, -0.169))),
    (((-0.096, -0.173), (0.165, -0.107), (-0.097, 0.042), (0.03, 0.043),
      (0.035, -0.107), (-0.184, -0.064), (0.16, 0.038)),
     ((0.152, -0.173), (0.175, 0.035), (-0.061, -0.11), (-0.024, 0.034),
      (-0.156, 0.034), (-0.188, -0.108), (0.067, -0.069))),
)  # fmt: skip
CHAINS = 64
"""Random walks for each extreme."""

EXTREMES = ("leftmost", "rightmost", "frontmost", "backmost")
"""In the robot's frame: least x, largest x, largest y (far), least y (near)."""
VIEWS = ("robot", "opposite", "left", "right")
SEEN_AS = {
    "robot": EXTREMES,
    "opposite": ("rightmost", "leftmost", "backmost", "frontmost"),
    "left": ("backmost", "frontmost", "leftmost", "rightmost"),
    "right": ("frontmost", "backmost", "rightmost", "leftmost"),
}
"""How a viewer names the four extremes; front is the side away from the viewer."""


def allowed(x: Array, y: Array) -> Mask:
    """Whether origins are in the region with the whole object in view."""
    (left, right), (near, far) = REGION
    inside = (x >= left) & (x <= right) & (y >= near) & (y <= far)
    return inside & in_head_view(x, y, RADIUS, TALL, MARGIN)


def apart(points: Array, wanted: Array, i: int) -> Mask:
    """Whether `wanted` is far enough from the chain's other places, on the table and in view."""
    dx = np.abs(points[..., 0] - wanted[:, None, 0])
    dy = np.abs(points[..., 1] - wanted[:, None, 1])
    u, v = head_pixel(points[..., 0], points[..., 1], TABLE_TOP + TALL / 2)
    wu, wv = head_pixel(wanted[:, :1], wanted[:, 1:], TABLE_TOP + TALL / 2)
    free = (
        ((dx >= SPACING_X) | (dy >= SPACING_Y))
        & (dx**2 + dy**2 >= SPACING**2)
        & ((u - wu) ** 2 + (v - wv) ** 2 >= PIXELS**2)
    )
    free[:, i] = True
    return np.asarray(free.all(axis=1))


def fits(extremes: NDArray[np.int64]) -> Fits:
    """The rule of layouts whose place 0 is the extreme one; one extreme for each chain."""
    axis = extremes // 2
    sign = np.where((extremes == 1) | (extremes == 2), 1.0, -1.0)
    chain = np.arange(len(extremes))

    def rule(points: Array, wanted: Array, i: int) -> Mask:
        ahead = sign * wanted[chain, axis]
        along = sign[:, None] * points[chain, :, axis]
        rival = along[:, 1:].max(axis=1) if i == 0 else ahead
        leader = ahead if i == 0 else along[:, 0]
        clear = leader - rival > EXTREME
        return clear & allowed(wanted[:, 0], wanted[:, 1]) & apart(points, wanted, i)

    return rule


@cache
def layouts(level: int) -> Array:
    """The level's layouts for each of EXTREMES, extreme place first: (4, many, n, 2) [m]."""
    count = OBJECTS[level]
    rng = np.random.Generator(np.random.PCG64(level))
    order = np.argsort(rng.random((4, CHAINS, 6)), axis=2)[..., : count - 1] + 1
    which = np.arange(CHAINS) % 2
    places = np.array(STARTS)[:, which]
    others = np.take_along_axis(places, order[..., None], axis=2)
    starts = np.concatenate([places[:, :, :1], others], axis=2).reshape(-1, count, 2)
    found = pool(starts, fits(np.repeat(np.arange(4), CHAINS)))
    return found.reshape(-1, 4, CHAINS, count, 2).swapaxes(0, 1).reshape(4, -1, count, 2)


def _params(rng: np.random.Generator, asset: str) -> dict[str, object]:
    if asset == "block":
        color = BLOCK_COLORS[int(rng.integers(len(BLOCK_COLORS)))]
        return {"half": [BLOCK_HALF] * 3, "color": list(color)}
    return dict(draw_look(rng, asset))


def draw(level: int, rng: np.random.Generator) -> Draft:
    """A uniform extreme and viewpoint, a layout where it is clear, and what lies where."""
    count = OBJECTS[level]
    extreme, view = int(rng.integers(4)), VIEWS[int(rng.integers(4))]
    fitting = layouts(level)[extreme]
    points = fitting[int(rng.integers(len(fitting)))][None].copy()
    walk(rng, points, fits(np.array([extreme])), SHIFT)
    order = [int(i) for i in rng.permutation(count)]
    assets = [ASSETS[int(i)] for i in rng.permutation(len(ASSETS))[:count]]
    objects = []
    for k, i in enumerate(order):
        is_block = assets[k] == "block"
        x, y = points[0, i].tolist()
        params = _params(rng, assets[k])
        yaw = drawn_yaw(rng, assets[k], params, y, 0.75 if is_block else math.pi)
        pose = standing((x, y), yaw, BLOCK_HALF if is_block else 0.0)
        objects.append(SceneObject(f"object_{k}", assets[k], pose, params))
    facts = {
        "target": f"object_{order.index(0)}",
        "extreme": EXTREMES[extreme],
        "viewpoint": view,
        "position": SEEN_AS[view][extreme],
    }
    return Draft(tuple(objects), facts)


def slots(scene: Scene) -> Slots:
    """What the instruction says: the extreme in the viewer's words, and the viewer."""
    return words_spatial.multi_view(scene.facts["position"], scene.facts["viewpoint"])


LEVELS: Mapping[int, Level] = {k: Level(min(n, 4), 1, 150) for k, n in OBJECTS.items()}

TASK = Task(
    name="Pick_Mixed_Objects_Multi_View_A",
    category="CVR",
    levels=LEVELS,
    draw=draw,
    goal=lifted(Lift(rise=0.06, closed=True, touching=True)),
    plan=pick_target,
    slots=slots,
    summary="Pick the extreme one of 3 to 7 different objects as seen from a named side.",
    success="the target rose by more than 6 cm, touched by a gripper and carried by a closed one",
)
