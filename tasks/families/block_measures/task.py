"""Pick Blocks Size, Height, Length and Area (GAC): pick the block of the named rank in a measure.

Length is the extent from left to right: the shortest blocks are wider than long. Area is that of
the square base; all blocks of a scene are equally high there.
"""

from __future__ import annotations

import itertools

from robospa.geometry import Vec3
from robospa.tasks.families.block_measures.scenes import (
    LAYOUTS,
    LEVELS,
    Measure,
    diagonal,
    front,
    rank_task,
)
from robospa.tasks.sampling.places import Points
from robospa.workcell import TABLE_TOP, FixedCamera

HALF_EDGES = (
    (0.032, 0.033),
    (0.027, 0.028),
    (0.022, 0.023),
    (0.017, 0.018),
    (0.014, 0.015),
    (0.009, 0.010),
)
HALF_HEIGHTS = (
    (0.077, 0.078),
    (0.060, 0.061),
    (0.045, 0.046),
    (0.032, 0.033),
    (0.021, 0.022),
    (0.012, 0.013),
)
HALF_LENGTHS = (
    (0.044, 0.045),
    (0.033, 0.034),
    (0.024, 0.025),
    (0.017, 0.018),
    (0.012, 0.013),
    (0.009, 0.010),
)
HALF_BASES = (
    (0.032, 0.033),
    (0.027, 0.028),
    (0.022, 0.023),
    (0.017, 0.018),
    (0.012, 0.013),
    (0.009, 0.010),
)
"""Ranges [m] of each rank."""
HALF_SIDE = (0.0155, 0.0165)
"""The two other half sizes [m] of blocks of different height or length, the same in a scene."""
BASE_HALF_HEIGHT = {1: 0.029, 2: 0.027, 3: 0.025, 4: 0.022, 5: 0.020}

HEIGHT_LAYOUTS = {
    1: front(0.04, 0.35, 0.10),
    2: front(0.07, 0.35, 0.12, 0.02),
    3: front(0.07, 0.35, 0.14, 0.03),
    4: front(0.08, 0.35, 0.15, 0.04),
    5: front(0.07, 0.35, 0.18, 0.05),
}
LENGTH_LAYOUTS = {
    1: front(0.045, 0.30, 0.11),
    2: front(0.045, 0.30, 0.13, 0.02),
    3: front(0.045, 0.30, 0.14, 0.03),
    4: front(0.045, 0.35, 0.15, 0.04),
    5: front(0.045, 0.30, 0.18, 0.05),
}


def none_hidden(camera: FixedCamera, points: Points, halves: list[Vec3]) -> bool:
    """Whether the camera sees the top of every block past all blocks that stand before it."""
    blocks = sorted(zip(points, halves, strict=True), key=lambda b: b[0][1])
    return not any(_hides(camera.position, a, b) for a, b in itertools.combinations(blocks, 2))


def _hides(
    eye: Vec3, near: tuple[tuple[float, float], Vec3], far: tuple[tuple[float, float], Vec3]
) -> bool:
    """Whether the line of sight to the middle of `far`'s top meets `near`'s bounding cylinder."""
    (x, y), half = far
    (nx, ny), near_half = near
    radius = diagonal(near_half)
    part = (ny + radius - eye[1]) / (y - eye[1])  # where the line passes the cylinder's far side
    if part > 1 or abs(eye[0] + part * (x - eye[0]) - nx) > radius + half[0]:
        return False
    top = TABLE_TOP + 2 * half[2]
    return eye[2] + part * (top - eye[2]) < TABLE_TOP + 2 * near_half[2]


SIZE = Measure(
    "size",
    ranges=lambda level: HALF_EDGES[: LEVELS[level].candidates],
    half=lambda edge, shared, level: (edge, edge, edge),
    room=lambda half: half[0],
    seen=lambda half: (half[0] * 1.42, half[0] * 2),
)
HEIGHT = Measure(
    "height",
    ranges=lambda level: HALF_HEIGHTS[: LEVELS[level].candidates],
    shared=(HALF_SIDE, HALF_SIDE),
    half=lambda height, shared, level: (shared[0], shared[1], height),
    room=diagonal,
    # Every block keeps the view of the tallest: its height must not tell where it may stand.
    seen=lambda half: (diagonal(half), 2 * HALF_HEIGHTS[0][1]),
    visible=none_hidden,
)
LENGTH = Measure(
    "length",
    ranges=lambda level: HALF_LENGTHS[: LEVELS[level].candidates],
    shared=(HALF_SIDE, HALF_SIDE),
    half=lambda length, shared, level: (length, shared[0], shared[1]),
    room=diagonal,
    seen=lambda half: (diagonal(half), 2 * half[2]),
)
AREA = Measure(
    "area",
    # Level 4 leaves the biggest base out, as the official scenes do.
    ranges=lambda level: HALF_BASES[1:] if level == 4 else HALF_BASES[: LEVELS[level].candidates],
    half=lambda base, shared, level: (base, base, BASE_HALF_HEIGHT[level]),
    room=lambda half: half[0],
    seen=lambda half: (diagonal(half), 2 * half[2]),
)

TASKS = (
    rank_task(SIZE, LAYOUTS),
    rank_task(HEIGHT, HEIGHT_LAYOUTS),
    rank_task(LENGTH, LENGTH_LAYOUTS),
    rank_task(AREA, LAYOUTS),
)
