"""Hollow things: `bowl`, `mug`, `bread_basket`, `dustbin`, the `cover` that hides a block.

For throwing away: `table_trash_bin`, a small bin to empty, and `garbage`, what lies in it.
"""

import math

from robospa.geometry import Pose, Vec3, axis_rotation, multiply
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, solid, srgb, visual
from robospa.tasks.shapes import Box, Color, Cylinder, Mesh, ObjectModel, Params, Shape, Sphere

BOWLS = (
    ("blue", "white", "blue", 0.0572, 0.049), ("white", "blue", "white", 0.0600, 0.0506),
    ("green", "cream", "green", 0.0640, 0.052), ("orange", "cream", "orange", 0.0648, 0.072),
    ("brown", "beige", "brown", 0.0648, 0.069),
)  # fmt: skip
"""Colours of outside and rim, colour word, radius of the rim and height [m]."""
BOWL_SIDES = 16
"""Of how many flat pieces a bowl's wall is made."""


def bowl(look: int, params: Params) -> ObjectModel:
    """An open bowl on a foot ring, glazed differently inside, with a painted rim.

    It flares, so that bowls stand 13 cm apart beside a plate and each other (official). Frame
    "nest": where the origin of a bowl stacked into it goes, its foot on the floor.
    """
    outside, stripe, word, rim, h = BOWLS[look]
    foot, belly = 0.414 * rim, 0.742 * rim
    stand, middle = 0.27 * h, 0.54 * h
    low, high = math.atan2(belly - foot, middle - stand), math.atan2(rim - belly, h - middle)
    # so high that another bowl's foot fits inside
    floor = stand + build.RIM / math.sin(low) + 0.0015
    thick = build.RIM / math.cos(high)

    def wall(z: float) -> float:
        return belly + (z - middle) * math.tan(high)

    outer = [(foot - 0.001, 0.0), (foot, stand), (belly, middle), (rim, h)]
    inner = [(rim - thick, h), (belly - thick, middle), (foot - 0.001, floor), (0.0, floor)]
    r, g, b = colour(outside)
    lining = (0.9 * r + 0.035, 0.9 * g + 0.035, 0.9 * b + 0.035)
    band = (0.74 * h, 0.88 * h)
    ring = [(wall(z) + 0.0004, z) for z in band]
    inside = [(wall(z) - thick - 0.0004, z) for z in reversed(band)]
    flat = math.cos(math.pi / BOWL_SIDES)  # a piece's middle is nearer to the axis than its edges
    parts = [
        visual(m.lathe([(0.0, 0.0), *outer], 18, False), colour(outside), roughness=0.25),
        visual(m.lathe([outer[-1], inner[0]], 18, False), colour(stripe), roughness=0.25),
        visual(m.lathe(inner, 18, False), lining, roughness=0.25),
        visual(m.lathe(ring, 18, False), colour(stripe), roughness=0.25),
        visual(m.lathe(inside, 18, False), colour(stripe), roughness=0.25),
        collision(Cylinder(foot, floor / 2), (0.0, 0.0, floor / 2)),
        *build.wall_ring(
            (foot + belly) / 2 * flat - build.RIM, build.RIM, stand, middle, BOWL_SIDES, low
        ),
        *build.wall_ring(
            (belly + rim) / 2 * flat - build.RIM, build.RIM, middle, h, BOWL_SIDES, high
        ),
    ]
    phrases = build.fill_phrases(
        word, "{} bowl", "{} soup bowl", "bowl in {}", "round {} bowl", "{} cereal bowl",
        "bowl that is {} on the outside", "{} ceramic bowl",
    )  # fmt: skip
    grip, lean = 0.86 * h, round(high, 4)
    held = wall(grip) * flat - thick / 2
    grasps = build.rim_grasps(held, build.RIM, grip, BOWL_SIDES, lean)
    made = build.model("bowl", parts, "bowl", phrases, grasps, mass=0.01, support=(0.0, 0.0, floor))
    return build.with_frames(made, nest=Pose((0.0, 0.0, floor)))


MUGS = (
    ("red", "white", (0.0445, 0.092, 0.0765, 0.058)),
    ("blue", "white", (0.0390, 0.106, 0.0765, 0.066)),
    ("yellow", "brown", (0.0470, 0.102, 0.0775, 0.062)),
    ("white", "red", (0.0360, 0.077, 0.0715, 0.042)),
    ("green", "cream", (0.0395, 0.092, 0.0745, 0.050)),
    ("black", "orange", (0.0395, 0.109, 0.0745, 0.062)),
)  # fmt: skip
"""Colours; radius, height, reach of the handle from the axis, and height of its middle [m]."""
MUG_HANDLE, MUG_EAR = 0.0045, 0.022
"""Radius of the bar of a mug's handle, and half the handle's height [m]: a handle that hangs on a
peg has its middle 14 mm lower."""


def mug(look: int, params: Params) -> ObjectModel:
    """An upright mug, its handle towards +x, with a painted band.

    It is taken at the rim, off the handle. Frame "handle": the middle of the hole of its handle,
    which runs along y.
    """
    base, mark, (r, h, reach, ear) = MUGS[look]
    inside, bar = r - build.RIM, MUG_HANDLE
    outer = [(r - 0.003, 0.0), (r, 0.003), (r, h)]
    inner = [(r, h), (inside, h), (inside, 0.006), (0.0, 0.006)]
    wide, half = reach - bar - r, MUG_EAR
    arc = [
        (r - 0.002 + (wide + 0.002) * math.cos(a), 0.0, ear + half * math.sin(a))
        for a in (-1.5, -1.1, -0.65, 0.0, 0.65, 1.1, 1.5)
    ]
    glaze = colour("white") if base != "white" else colour("cream")
    middle = r + (wide - bar) / 2
    reaching = Box((wide / 2, bar * 0.9, bar * 0.9))
    parts = [
        visual(m.lathe([(0.0, 0.0), *outer], 20, False), colour(base), roughness=0.25),
        visual(m.lathe([(r, h), (inside, h)], 20, False), colour(base), roughness=0.25),
        visual(m.lathe(inner[1:], 20, False), glaze, roughness=0.25),
        visual(m.lathe([(r + 0.0004, 0.74 * h), (r + 0.0004, 0.86 * h)], 20, False), colour(mark)),
        visual(m.tube(arc, bar, 6), colour(base), roughness=0.25),
        collision(Cylinder(r - 0.001, 0.003), (0.0, 0.0, 0.003)),
        *build.wall_ring(inside * math.cos(math.pi / 12), build.RIM, 0.0, h, 12),
        collision(reaching, (r + wide / 2, 0.0, ear + half)),
        collision(Box((bar * 0.8, bar * 0.9, half)), (reach - bar, 0.0, ear)),
        collision(reaching, (r + wide / 2, 0.0, ear - half)),
    ]
    phrases = build.fill_phrases(
        base, "{} mug", "{} coffee mug", "mug in {}", "{} cup with a handle",
        f"{base} mug with a {mark} stripe", "{} ceramic mug", "{} tea mug",
    )  # fmt: skip
    middle_of_wall = inside * math.cos(math.pi / 12) + build.RIM / 2
    rims = build.rim_grasps(middle_of_wall, build.RIM, h - 0.007, 12)[2:11]
    made = build.model("mug", parts, "mug", phrases, rims, support=(0.0, 0.0, 0.006))
    return build.with_frames(made, handle=Pose((round(middle, 5), 0.0, ear)))


BASKETS = (
    ("#8a5526", "#b9803f", "brown", "cream"), ("#c79a5a", "#e0bd84", "tan", "white"),
    ("#e9e4d8", "#c9c2b2", "white", "light blue"), ("#4a2d18", "#6e4626", "dark brown", "red"),
    ("#8b8f94", "#b4b8bc", "grey", "yellow"),
)  # fmt: skip
BASKET_SIZES = (
    (0.1931, 0.1360, 0.0640), (0.1906, 0.1395, 0.0520), (0.2102, 0.1718, 0.0864),
    (0.1917, 0.1398, 0.0477), (0.1900, 0.1900, 0.0774),
)  # fmt: skip
"""Official length, width and height [m] of each look; the last one is round."""


def bread_basket(look: int, params: Params) -> ObjectModel:
    """A wicker basket lined with a cloth, oval or round; wide enough for a whole bread."""
    dark, pale, word, cloth = BASKETS[look]
    length, width, high = BASKET_SIZES[look]
    edge, inside, outside, floor = 0.0042, 0.0735, 0.0785, 0.008
    h, hem = high - edge, high - edge - 0.012
    rows = round(h / 0.01)
    weave: dict[str, list[Mesh]] = {dark: [], pale: []}
    step = h / rows
    for k in range(rows):
        for i in range(24):
            a = 2 * math.pi * (i + 0.5) / 24
            shade = dark if (i + k) % 2 else pale
            weave[shade].append(m.band(outside, k * step, (k + 1) * step, a, 2 * math.pi / 24, 1))
    middle = (inside + outside) / 2
    for i in range(24):
        ends = ((math.cos(a), math.sin(a)) for a in (math.pi * i / 12, math.pi * (i + 1) / 12))
        path = [(middle * x, middle * y, h) for x, y in ends]
        weave[dark if i % 2 else pale].append(m.tube(path, edge, 4, caps=False))
    parts = [
        visual(m.merge(*weave[dark]), srgb(dark), roughness=0.9),
        visual(m.merge(*weave[pale]), srgb(pale), roughness=0.9),
        visual(m.lathe([(inside, hem), (inside, floor), (0.0, floor)], 20, False), colour(cloth)),
        visual(m.lathe([(inside, h), (inside, hem)], 20, False), srgb(dark), roughness=0.9),
        collision(Cylinder(0.077, floor / 2), (0.0, 0.0, floor / 2)),
        *build.wall_ring(inside, 0.005, 0.0, h, 16),
    ]
    shape = "round" if length == width else "oval"
    phrases = build.fill_phrases(
        word, "{} bread basket", "{} basket", "{} wicker basket", "basket for bread in {}",
        f"{shape} {{}} basket",
    )  # fmt: skip
    lining = f"{word} basket lined with {cloth} cloth"
    phrases = (*phrases[:4], lining, *phrases[4:], f"{word} woven basket")
    made = build.fitted(parts, (length, width, high))
    on_floor = made.at(0.0, 0.0, floor)
    return build.model("bread_basket", made.shapes, "bread basket", phrases, support=on_floor)


BINS = (
    ("#49a862", "#2d7a44", "green"), ("#8b97a1", "#5b6670", "grey"), ("#4a86d0", "#2a5ba3", "blue"),
)  # fmt: skip
BIN_SIZE = (0.4396, 0.6488, 0.7387)
"""Official size [m]: its rim is just below the table's top."""
LINER = srgb("#e9ecee")
"""The bag inside, pale so that the opening is seen for one."""


def dustbin(look: int, params: Params) -> ObjectModel:
    """An open rectangular bin for the floor, lined with a pale bag that hangs from its edge.

    Its raised inner floor is 0.21 m above the ground.
    """
    shell, dark, word = BINS[look]
    hx, hy, h = (BIN_SIZE[0] / 2, BIN_SIZE[1] / 2, BIN_SIZE[2])
    wall, floor, foot, edge = 0.014, 0.21, 0.94, 0.075
    outer = m.rounded_rectangle(hx, hy, 0.03, 3)
    inner = m.rounded_rectangle(hx - wall, hy - wall, 0.02, 3)
    rim, lip, hem = m.ring(outer, h), m.ring(inner, h), m.ring(inner, h - edge)
    low = m.rounded_rectangle(hx - wall - 0.03, hy - wall - 0.04, 0.04, 3)
    parts = [
        visual(m.loft([m.ring(outer, 0.0, foot), rim], False), srgb(shell), roughness=0.6),
        visual(m.loft([rim, lip], False), srgb(shell), roughness=0.6),
        visual(m.loft([lip, hem], False), srgb(dark), roughness=0.6),
        visual(m.loft([hem, m.ring(low, floor)], False), LINER, roughness=0.9),
        visual(m.flat(low, floor), srgb("#c3c9cf"), roughness=0.9),
        visual(m.merge(*_pleats(hx - wall, hy - wall, h - edge, floor)), srgb("#b9c1c8")),
        visual(_recycling(hx, h), colour("white")),
        collision(Box((hx * foot, hy * foot, floor / 2)), (0.0, 0.0, floor / 2)),
    ]  # fmt: skip
    for sign in (-1.0, 1.0):
        half = (h - floor) / 2
        at_x = (sign * (hx - wall / 2), 0.0, floor + half)
        at_y = (0.0, sign * (hy - wall / 2), floor + half)
        parts.append(collision(Box((wall / 2, hy, half)), at_x))
        parts.append(collision(Box((hx, wall / 2, half)), at_y))
    parts.append(collision(Box((hx - wall, hy - wall, 0.02)), (0.0, 0.0, floor - 0.02)))
    phrases = build.fill_phrases(
        word, "{} dustbin", "{} trash bin", "{} waste bin", "dustbin in {}", "open {} bin",
        "{} rubbish bin", "{} garbage bin",
    )  # fmt: skip
    return build.model("dustbin", parts, "dustbin", phrases, support=(0.0, 0.0, floor))


def _pleats(hx: float, hy: float, high: float, low: float) -> list[Mesh]:
    """Folds of the bag: narrow strips down the inner walls, from below the edge to the floor."""
    strips = []
    for facing in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        across, out = (hy, hx) if round(math.sin(facing)) == 0 else (hx, hy)
        for k in range(-4, 5):
            top, foot = 0.21 * across * k, 0.17 * across * k
            outline = [(foot - 0.004, low), (foot + 0.004, low), (top + 0.006, high),
                       (top - 0.006, high)]  # fmt: skip
            x, y = math.cos(facing), math.sin(facing)
            part = m.upright(outline, (0.0, 0.0, 0.0), facing)
            slope = (0.03 if abs(x) > 0.5 else 0.04) / (high - low)
            shifts = ((v, out - slope * (high - v[2]) - 0.002) for v in part.vertices)
            leaning = [(a - x * s, b - y * s, z) for (a, b, z), s in shifts]
            strips.append(m.mesh(leaning, part.faces))
    return strips


def _recycling(hx: float, h: float) -> Mesh:
    arrow = [(-0.034, 0.052), (0.012, 0.052), (0.012, 0.038), (0.042, 0.066), (0.012, 0.094),
             (0.012, 0.080), (-0.034, 0.080)]  # fmt: skip
    pieces = []
    for side in (-1, 1):
        for k in range(3):
            a = 2 * math.pi * k / 3
            turned = [
                (u * math.cos(a) + v * math.sin(a), v * math.cos(a) - u * math.sin(a))
                for u, v in arrow
            ]
            part = m.upright(turned, (side * hx, 0.0, 0.40), 0.0 if side > 0 else math.pi)
            lean = 0.06 * hx / (h - 0.03)
            shifted = [
                (x - side * (lean * (h - 0.03 - z) - 0.002), y, z) for x, y, z in part.vertices
            ]
            pieces.append(m.mesh(shifted, part.faces))
    return m.merge(*pieces)


COVERS: tuple[tuple[Color, Color, str, float], ...] = (
    (srgb("#d9d2c4"), srgb("#6b4a2c"), "cream", 0.0), (build.STEEL, srgb("#2a2c30"), "silver", 0.4),
    (srgb("#9a6a3c"), srgb("#5a3a1e"), "brown", 0.0),
)  # fmt: skip
COVER_INNER_RADIUS = 0.0312
COVER_INNER_HEIGHT = 0.047


def cover(look: int, params: Params) -> ObjectModel:
    """An opaque domed cup turned upside down, a knob on top; a 4 cm cube fits under it."""
    shell, trim, word, metallic = COVERS[look]
    r, hollow, top = COVER_INNER_RADIUS, COVER_INNER_HEIGHT, 0.052
    outer = [(r + 0.0033, 0.0), (r + 0.0033, 0.036), (r - 0.001, 0.0465), (0.022, top), (0.0, top)]
    inner = [(0.0, hollow), (r - 0.0062, hollow), (r, 0.042), (r, 0.0), (r + 0.0033, 0.0)]
    knob = [(0.006, top - 0.001), (0.006, top + 0.004), (0.0112, top + 0.009)]
    knob += [(0.0112, top + 0.019), (0.0085, top + 0.024), (0.0, top + 0.025)]
    ring = [(r + 0.0037, 0.004), (r + 0.0037, 0.010)]
    parts: list[Shape] = [
        visual(m.lathe(outer, 18, False), shell, roughness=0.35, metallic=metallic),
        visual(m.lathe(inner, 18, False), trim, roughness=0.8),
        visual(m.lathe(knob, 14, False), trim, roughness=0.4),
        visual(m.lathe(ring, 18, False), trim, roughness=0.5),
        collision(Cylinder(0.0285, (top - hollow) / 2), (0.0, 0.0, (top + hollow) / 2)),
        collision(Cylinder(0.0112, 0.0125), (0.0, 0.0, top + 0.0125)),
        *build.wall_ring(r, 0.0033, 0.0, hollow, 12),
    ]
    phrases = build.fill_phrases(
        word, "{} cover", "{} lid", "{} dome", "cover in {}", "{} cup turned upside down",
        "{} cover with a knob", "{} domed lid",
    )  # fmt: skip
    grasps = build.round_grasps(0.0224, top + 0.014, 0.7, 8)
    return build.model("cover", parts, "cover", phrases, grasps, mass=0.01)


TRASH_BINS = (
    ("blue", "white"), ("green", "white"), ("silver", "black"), ("pink", "white"),
    ("black", "red"), ("yellow", "black"),
)  # fmt: skip
TRASH_BIN_SIZES = (
    (0.1460, 0.1320), (0.1500, 0.1437), (0.0865, 0.1162), (0.0820, 0.1162), (0.0970, 0.1167),
    (0.0854, 0.1356),
)  # fmt: skip
"""Width at the rim (of the official contact points) and official height [m] of each look."""
WALL = 0.0064
"""Thickness of its walls [m]: some grippers' closed fingers stay 5.4 mm apart."""


def table_trash_bin(look: int, params: Params) -> ObjectModel:
    """A small open bin for a table, square, wider at the top, held by one of its walls."""
    body, band = TRASH_BINS[look]
    low, high, h, floor = 0.0235, 0.0280, 0.085, 0.0040
    wall = WALL * 2 * high / TRASH_BIN_SIZES[look][0]  # before it is stretched
    lean = math.atan2(high - low, h)

    def square(half: float, z: float, corner: float = 0.007) -> list[Vec3]:
        return m.ring(m.rounded_rectangle(half, half, corner, 4), z)

    def half_at(z: float) -> float:
        return low + z * math.tan(lean)

    shell = m.loft([square(low, 0.0), square(high, h)], False)
    lip = m.loft([square(high, h), square(high - wall, h, 0.005)], False)
    well = half_at(floor) - wall
    inner = m.loft([square(high - wall, h, 0.005), square(well, floor, 0.005)], False)
    base = m.rounded_rectangle(well, well, 0.005, 4)
    stripe = m.loft([square(half_at(z) + 0.0004, z) for z in (h - 0.013, h - 0.005)], False)
    under = [(x, y, 0.0) for x, y, _ in reversed(square(low, 0.0))]
    underside = m.mesh(under, m.triangulate([(x, -y) for x, y, _ in under]))
    red, green, blue = colour(body)
    shade = (0.55 * red, 0.55 * green, 0.55 * blue)
    icons = _can_icons(half_at(0.036) + 0.0006, lean)
    parts = [
        visual(shell, colour(body), roughness=0.5),
        visual(lip, colour(body), roughness=0.5),
        visual(inner, shade, roughness=0.7),
        visual(m.flat(base, floor), shade, roughness=0.7),
        visual(m.merge(stripe, *icons), colour(band), roughness=0.5),
        visual(underside, colour(body), roughness=0.5),
        collision(Box((low, low, floor / 2)), (0.0, 0.0, floor / 2)),
    ]
    middle = half_at(h / 2) - wall / 2
    for k in range(4):
        a = math.pi / 2 * k
        turned = multiply(axis_rotation((0.0, 0.0, 1.0), a), axis_rotation((0.0, 1.0, 0.0), lean))
        at = (middle * math.cos(a), middle * math.sin(a), h / 2)
        side = Box((wall / 2, high - 0.0015, h / 2 / math.cos(lean) - 0.0005))
        parts.append(collision(side, at, turned))
    phrases = build.fill_phrases(
        body, "{} trash bin", "{} table bin", "small {} trash bin", "{} desktop trash bin",
        "little {} bin", "{} tabletop bin", "{} desk bin",
    )  # fmt: skip
    wide, tall = TRASH_BIN_SIZES[look]
    made = build.fitted(parts, (wide, wide, tall))
    rim = 0.074
    out = half_at(rim) - wall / 2
    angles = [math.pi / 2 * k for k in range(4)]
    points = [made.at(out * round(math.cos(a)), out * round(math.sin(a)), rim) for a in angles]
    thick = wall * made.factors[0]
    rims = [build.top_grasp(p, thick, a, 0.5) for p, a in zip(points, angles, strict=True)]
    inside = made.at(0.0, 0.0, floor)
    return build.model("table_trash_bin", made.shapes, "trash bin", phrases, rims, support=inside)


def _can_icons(out: float, lean: float) -> list[Mesh]:
    """A small drawing of a bin on each of the four walls, `out` [m] from the axis."""
    can = [(-0.0058, -0.0095), (0.0058, -0.0095), (0.0075, 0.0050), (-0.0075, 0.0050)]
    lid, knob = m.rectangle(0.0090, 0.0011, 0.0, 0.0075), m.rectangle(0.0028, 0.001, 0.0, 0.0098)
    pieces = []
    for k in range(4):
        a = math.pi / 2 * k
        for outline in (can, lid, knob):
            part = m.upright(outline, (0.0, 0.0, 0.0), 0.0)
            tipped = m.moved(part, (out, 0.0, 0.036), axis_rotation((0.0, 1.0, 0.0), lean))
            pieces.append(m.moved(tipped, rotation=axis_rotation((0.0, 0.0, 1.0), a)))
    return pieces


BALLS = ("red", "blue", "green", "yellow")
BALL_RADIUS = 0.008


def garbage(look: int, params: Params) -> ObjectModel:
    """A small ball to be thrown away."""
    word = BALLS[look]
    r = BALL_RADIUS
    parts = [solid(Sphere(r), colour(word), (0.0, 0.0, r), roughness=0.7)]
    phrases = build.fill_phrases(
        word, "{} ball", "{} piece of garbage", "small {} ball", "ball of {} garbage",
        "{} piece of trash", "little {} ball",
    )  # fmt: skip
    grasps = build.round_grasps(2 * r, r, 0.7)
    return build.model("garbage", parts, "ball", phrases, grasps, mass=0.002)


ASSETS = build.library(
    (bowl, BOWLS), (mug, MUGS), (bread_basket, BASKETS), (dustbin, BINS), (cover, COVERS),
    (table_trash_bin, TRASH_BINS), (garbage, BALLS),
)  # fmt: skip
