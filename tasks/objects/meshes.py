"""Small meshes from profiles: lofts, lathes, prisms, rounded slabs, tubes and surface decals.

Every function returns a `Mesh` in metres whose triangles run counter-clockwise seen from outside.
Meshes are made to be few triangles, not smooth: they are drawn on a CPU, many times a second.
Polygons are sequences of (u, v) points, counter-clockwise.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array, Pose, Quat, Vec3
from robospa.tasks.shapes import Mesh

Point = tuple[float, float]
Polygon = Sequence[Point]
Face = tuple[int, int, int]


def mesh(vertices: Iterable[Sequence[float]], faces: Iterable[Face]) -> Mesh:
    """A `Mesh` of plain floats, rounded to the micrometre, without degenerate triangles."""
    points = [
        (round(float(v[0]), 6), round(float(v[1]), 6), round(float(v[2]), 6)) for v in vertices
    ]
    kept = tuple(f for f in faces if len({points[i] for i in f}) == 3)
    return Mesh(tuple(points), kept)


def merge(*parts: Mesh) -> Mesh:
    """All `parts` as one mesh."""
    vertices: list[Vec3] = []
    faces: list[Face] = []
    for part in parts:
        n = len(vertices)
        vertices.extend(part.vertices)
        faces.extend((a + n, b + n, c + n) for a, b, c in part.faces)
    return Mesh(tuple(vertices), tuple(faces))


def moved(part: Mesh, at: Vec3 = (0.0, 0.0, 0.0), rotation: Quat = (1.0, 0.0, 0.0, 0.0)) -> Mesh:
    """`part` turned by `rotation`, then shifted by `at`."""
    pose = Pose(at, rotation)
    return mesh([pose.apply(v) for v in part.vertices], part.faces)


def stretched(part: Mesh, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Mesh:
    """`part` scaled by positive factors along the axes."""
    return mesh([(a * x, b * y, c * z) for a, b, c in part.vertices], part.faces)


def ellipse(rx: float, ry: float, n: int = 16, phase: float = 0.0) -> list[Point]:
    """Polygon of `n` points on an ellipse."""
    angles = [phase + 2 * math.pi * i / n for i in range(n)]
    return [(rx * math.cos(a), ry * math.sin(a)) for a in angles]


def rounded_rectangle(hx: float, hy: float, radius: float, n: int = 3) -> list[Point]:
    """Rectangle of half sizes `hx`, `hy` whose corners are arcs of `n` points each."""
    points = []
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        for i in range(n):
            a = math.pi / 2 * (k + i / max(1, n - 1))
            cx, cy = sx * (hx - radius), sy * (hy - radius)
            points.append((cx + radius * math.cos(a), cy + radius * math.sin(a)))
    return points


def star(outer: float, inner: float) -> list[Point]:
    """Star polygon with five tips, one of them up."""
    return [
        (r * math.cos(math.pi / 2 + math.pi * i / 5), r * math.sin(math.pi / 2 + math.pi * i / 5))
        for i in range(10)
        for r in ((outer if i % 2 == 0 else inner),)
    ]


def triangulate(polygon: Polygon) -> list[Face]:
    """Triangles of a simple counter-clockwise polygon, by cutting ears."""
    left = list(range(len(polygon)))
    faces: list[Face] = []
    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            ear = _cross(polygon[i], polygon[j], polygon[m]) > 1e-15
            others = (polygon[o] for o in left if o not in (i, j, m))
            if ear and not any(_inside(p, polygon[i], polygon[j], polygon[m]) for p in others):
                faces.append((i, j, m))
                del left[k]
                break
        else:  # only collinear points are left: dropping one changes nothing
            del left[0]
    return [*faces, (left[0], left[1], left[2])]


def _cross(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _inside(p: Point, a: Point, b: Point, c: Point) -> bool:
    return min(_cross(a, b, p), _cross(b, c, p), _cross(c, a, p)) >= -1e-15


def ring(polygon: Polygon, z: float, scale: float = 1.0) -> list[Vec3]:
    """`polygon` (x, y), scaled, at the height `z`."""
    return [(x * scale, y * scale, z) for x, y in polygon]


def loft(rings: Sequence[Sequence[Vec3]], caps: bool = True, under: bool = True) -> Mesh:
    """Skin over `rings` of equally many points, counter-clockwise from above, bottom ring first.

    Its ends are closed if they are `caps`, the lower one only if it is seen from `under` it.
    """
    n = len(rings[0])
    vertices = [p for ring in rings for p in ring]
    faces: list[Face] = []
    for k in range(len(rings) - 1):
        for i in range(n):
            a, b = k * n + i, k * n + (i + 1) % n
            faces += [(a, b, b + n), (a, b + n, a + n)]
    if caps:
        last = (len(rings) - 1) * n
        top = triangulate([(p[0], p[1]) for p in rings[-1]]) if _area(rings[-1]) > 1e-10 else []
        low = triangulate([(p[0], p[1]) for p in rings[0]]) if _area(rings[0]) > 1e-10 else []
        faces += [(a + last, b + last, c + last) for a, b, c in top]
        faces += [(a, c, b) for a, b, c in low if under]
    return mesh(vertices, faces)


def _area(ring: Sequence[Vec3]) -> float:
    p = np.asarray(ring, dtype=float)[:, :2]
    q = np.roll(p, -1, axis=0)
    return float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])) / 2


def lathe(profile: Polygon, n: int = 14, caps: bool = True) -> Mesh:
    """Surface of revolution about z of `profile` = (radius, z) points.

    The outside lies to the right of the profile's direction of travel: outer walls run upwards,
    inner walls downwards. With `caps` an end of non-zero radius is closed by a flat disc.
    """
    rings = [[(x, y, z) for x, y in ellipse(r, r, n)] for r, z in profile]
    return loft(rings, caps)


def prism(polygon: Polygon, low: float, high: float, top: float = 1.0, under: bool = True) -> Mesh:
    """`polygon` (x, y) extruded from z = `low` to `high`, its upper face scaled by `top`."""
    return loft((ring(polygon, low), ring(polygon, high, top)), under=under)


def side_prism(polygon: Polygon, half: float) -> Mesh:
    """`polygon` (y, z) extruded along x to +-`half`."""
    part = prism(polygon, -half, half)
    return mesh([(w, u, v) for u, v, w in part.vertices], part.faces)


def front_prism(polygon: Polygon, back: float, front: float) -> Mesh:
    """`polygon` (x, z) extruded along y between `back` and `front` (front < back: towards -y)."""
    part = prism(polygon, -back, -front)
    return mesh([(u, -w, v) for u, v, w in part.vertices], part.faces)


def slab(hx: float, hy: float, height: float, radius: float, edge: float = 0.0, n: int = 3) -> Mesh:
    """Rounded rectangle from z = 0 to `height`; the upper and lower rims are cut by `edge`."""
    outer = rounded_rectangle(hx, hy, radius, n)
    if edge <= 0:
        return prism(outer, 0.0, height)
    inner = rounded_rectangle(hx - edge, hy - edge, max(radius - edge, radius * 0.4), n)
    levels = ((inner, 0.0), (outer, edge), (outer, height - edge), (inner, height))
    return loft([ring(polygon, z) for polygon, z in levels])


def pillow(sections: Sequence[tuple[float, float, float]], n: int = 14, power: float = 1.0) -> Mesh:
    """Loft of ellipses (rx, ry, z), bottom first; `power` < 1 makes them squarer."""

    def bend(c: float) -> float:
        return math.copysign(abs(c) ** power, c)

    unit = [(bend(x), bend(y)) for x, y in ellipse(1.0, 1.0, n, math.pi / n)]
    return loft([[(x * rx, y * ry, z) for x, y in unit] for rx, ry, z in sections])


def tube(
    path: Sequence[Vec3], radius: float, n: int = 6, closed: bool = False, caps: bool = True
) -> Mesh:
    """Round bar of `radius` along `path`; `closed` joins its ends, `caps` are at open ones."""
    points = np.asarray(path, dtype=float)
    count = len(points)
    rings: list[list[Vec3]] = []
    side: Array | None = None
    for i in range(count):
        before = points[i - 1] if closed or i > 0 else points[i]
        after = points[(i + 1) % count] if closed or i < count - 1 else points[i]
        along = (after - before) / np.linalg.norm(after - before)
        if side is None:
            side = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
        side = side - along * float(side @ along)
        side = side / np.linalg.norm(side)
        up = np.cross(along, side)
        angles = (2 * math.pi * k / n for k in range(n))
        ring = [points[i] + radius * (math.cos(a) * side + math.sin(a) * up) for a in angles]
        rings.append([(float(x), float(y), float(z)) for x, y, z in ring])
    vertices = [v for ring in rings for v in ring]
    faces: list[Face] = []
    for k in range(count if closed else count - 1):
        for i in range(n):
            j, m = k * n + i, k * n + (i + 1) % n
            c, d = (j + n) % (n * count), (m + n) % (n * count)
            faces += [(j, m, d), (j, d, c)]
    if caps and not closed:
        last = (count - 1) * n
        faces += [(0, i + 1, i) for i in range(1, n - 1)]
        faces += [(last, last + i, last + i + 1) for i in range(1, n - 1)]
    return mesh(vertices, faces)


def decal(polygon: Polygon, radius: float, height: float, angle: float) -> Mesh:
    """A patch wrapped on an upright cylinder: `polygon` (along the circumference, up) in metres.

    Centred at `angle` [rad] about z and at z = `height`; star-shaped polygons only. Visible from
    outside only.
    """
    flat: list[Point] = [(0.0, 0.0)]
    flat += [(u * 0.5, v * 0.5) for u, v in polygon] + list(polygon)
    n = len(polygon)
    faces: list[Face] = []
    small = max(abs(u) for u, _ in polygon) ** 2 < 0.0048 * radius  # sinks by less than 0.6 mm
    for i in range(n):
        j, k = 1 + i, 1 + (i + 1) % n
        faces += [(0, j + n, k + n)] if small else [(0, j, k), (j, j + n, k + n), (j, k + n, k)]
    vertices = []
    for u, v in flat:
        a = angle + u / radius
        vertices.append((radius * math.cos(a), radius * math.sin(a), height + v))
    return mesh(vertices, faces)


def band(radius: float, low: float, high: float, angle: float, span: float, n: int = 6) -> Mesh:
    """Part of a cylinder wall: `span` [rad] wide, centred at `angle`; visible from outside."""
    angles = [angle - span / 2 + span * i / n for i in range(n + 1)]
    lower = [(radius * math.cos(a), radius * math.sin(a), low) for a in angles]
    upper = [(x, y, high) for x, y, _ in lower]
    faces: list[Face] = []
    for i in range(n):
        faces += [(i, i + 1, n + 2 + i), (i, n + 2 + i, n + 1 + i)]
    return mesh(lower + upper, faces)


def strip(points: Sequence[Vec3]) -> Mesh:
    """A ribbon, given as left and right points alternately."""
    faces: list[Face] = []
    for i in range(0, len(points) - 2, 2):
        faces += [(i, i + 1, i + 3), (i, i + 3, i + 2)]
    return mesh(points, faces)


def flat(polygon: Polygon, z: float, at: Point = (0.0, 0.0)) -> Mesh:
    """Horizontal patch of `polygon` (x, y), seen from above only."""
    points = [(x + at[0], y + at[1]) for x, y in polygon]
    return mesh([(x, y, z) for x, y in points], triangulate(points))


def upright(polygon: Polygon, at: Vec3, facing: float = -math.pi / 2) -> Mesh:
    """Vertical patch: `polygon` (to the right, up) seen from outside, around `at`.

    `facing` [rad] is the direction about z in which its outside looks (-pi/2: towards -y).
    """
    rx, ry = -math.sin(facing), math.cos(facing)
    points = [(at[0] + u * rx, at[1] + u * ry, at[2] + v) for u, v in polygon]
    return mesh(points, triangulate(polygon))


def rectangle(hx: float, hy: float, x: float = 0.0, y: float = 0.0) -> list[Point]:
    """Axis-parallel rectangle of half sizes `hx`, `hy` around (`x`, `y`)."""
    return [(x - hx, y - hy), (x + hx, y - hy), (x + hx, y + hy), (x - hx, y + hy)]


def box_mesh(half: Vec3, at: Vec3 = (0.0, 0.0, 0.0), rotation: Quat = (1.0, 0.0, 0.0, 0.0)) -> Mesh:
    """A cuboid as a mesh, to be merged with others."""
    return moved(prism(rectangle(half[0], half[1]), -half[2], half[2]), at, rotation)


CREASE = np.cos(np.radians(40.0))
"""Faces that meet at a sharper angle than this are shaded apart."""


def shaded_corners(points: Array, faces: NDArray[np.int64]) -> tuple[Array, Array]:
    """Corners (3 F, 3) of all `faces` (F, 3) of `points` (V, 3), and their unit normals.

    A corner's normal is the area-weighted mean over the faces at that vertex which lie within the
    crease angle of its own face.
    """
    a, b, c = (points[faces[:, i]] for i in range(3))
    areas = np.cross(b - a, c - a)
    length = np.linalg.norm(areas, axis=1)
    unit = areas / np.maximum(length, 1e-15)[:, None]
    at_vertex: list[list[int]] = [[] for _ in points]
    for index, face in enumerate(faces.tolist()):
        for vertex in face:
            at_vertex[vertex].append(index)
    normals = np.empty((len(faces), 3, 3))
    for vertex, around in enumerate(at_vertex):
        if not around:
            continue
        near = np.array(around)
        alike = unit[near] @ unit[near].T >= CREASE
        summed = alike @ areas[near]
        summed /= np.maximum(np.linalg.norm(summed, axis=1), 1e-15)[:, None]
        rows, corners = np.nonzero(faces[near] == vertex)
        normals[near[rows], corners] = summed[rows]
    return points[faces].reshape(-1, 3), normals.reshape(-1, 3)
