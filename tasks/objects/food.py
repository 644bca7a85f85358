"""Things to eat: `hamburger`, `french_fries`, and seven shapes of `bread`."""

import itertools
import math
import random
from collections.abc import Callable

from robospa.geometry import axis_rotation, yaw_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.shapes import Box, Cylinder, Grasp, Mesh, ObjectModel, Params, Shape

BURGERS = (
    ("#c9812f", "#f3b524", (
        "hamburger", "burger with sesame seeds", "cheeseburger", "burger with cheese and lettuce",
        "golden-brown hamburger", "round hamburger", "cheese hamburger",
    ), (1.02, 0.685)),
    ("#7a4420", "#f6e3a0", (
        "hamburger with a dark bun", "dark-bun burger", "brown hamburger",
        "burger in a dark brown bun", "burger with a rye bun", "hamburger on dark bread",
    ), (1.02, 0.785)),
    ("#e3ad5c", "#e2481e", (
        "hamburger with a pale bun", "light-bun burger", "burger in a light bun",
        "pale hamburger", "burger with red cheddar", "hamburger on light bread",
    ), (0.98, 0.615)),
)  # fmt: skip
"""Colours of bun and cheese, phrases, and width and height relative to a bun 6 cm wide, 5 high."""


def hamburger(look: int, params: Params) -> ObjectModel:
    """Bun, lettuce, patty, cheese, tomato, and a domed bun with sesame seeds."""
    bun, cheese, phrases, (wide, high) = BURGERS[look]
    r = 0.030
    low = [(r - 0.004, 0.0), (r, 0.004), (r, 0.010), (r - 0.002, 0.012)]
    patty = [(r - 0.002, 0.0145), (r + 0.0006, 0.017), (r + 0.0006, 0.021), (r - 0.002, 0.023)]
    tomato = [(r - 0.0025, 0.0245), (r - 0.001, 0.0255), (r - 0.0025, 0.028)]
    top = [(r - 0.001, 0.0275), (r, 0.031), (r - 0.004, 0.040), (r - 0.013, 0.047), (0.0, 0.050)]
    square = m.rectangle(0.0238, 0.0238)
    turned = [((x - y) * math.sqrt(0.5), (x + y) * math.sqrt(0.5)) for x, y in square]
    parts = [
        collision(Cylinder(r, 0.0155), (0.0, 0.0, 0.0155)),
        collision(m.lathe([*top[1:4], (0.004, 0.050)], 14)),
        visual(m.lathe(low, 16), srgb(bun), roughness=0.8),
        visual(_lettuce(r, 0.0125), srgb("#57b030"), roughness=0.8),
        visual(m.lathe(patty, 14), srgb("#4b2413"), roughness=0.9),
        visual(m.prism(turned, 0.0225, 0.0245), srgb(cheese), roughness=0.5),
        visual(m.lathe(tomato, 14), srgb("#cf2a1c"), roughness=0.5),
        visual(m.lathe(top, 16), srgb(bun), roughness=0.6),
        visual(_seeds(r), srgb("#fbeecb")),
    ]
    parts = build.stretched(parts, wide, wide, high)
    grasps = build.round_grasps(2 * r * wide, 0.015, 0.6)
    return build.model("hamburger", parts, "hamburger", phrases, grasps)


def _lettuce(r: float, z: float) -> Mesh:
    wavy = [(r + (0.0028 if i % 2 else 0.0005)) for i in range(20)]
    turns = [2 * math.pi * i / 20 for i in range(20)]
    ring = [(w * math.cos(a), w * math.sin(a)) for w, a in zip(wavy, turns, strict=True)]
    sag = [(-0.0022 if i % 2 else 0.0012) for i in range(20)]
    low = [(x, y, z + s - 0.0006) for (x, y), s in zip(ring, sag, strict=True)]
    high = [(x, y, z + s + 0.0012) for (x, y), s in zip(ring, sag, strict=True)]
    return m.loft([m.ring(ring, z, 0.8), low, high, m.ring(ring, z + 0.002, 0.8)], False)


def _seeds(r: float) -> Mesh:
    seed = m.loft([m.ring(m.ellipse(0.0024, 0.0013, 5), 0.0), [(0.0, 0.0, 0.0011)] * 5], False)
    parts = []
    for ring, z, count in ((0.009, 0.0487, 5), (0.0165, 0.0474, 8), (0.0222, 0.0437, 9)):
        for i in range(count):
            a = 2 * math.pi * (i + 0.5 * (count % 2)) / count
            turn = axis_rotation((0.0, 0.0, 1.0), a)
            parts.append(m.moved(seed, (ring * math.cos(a), ring * math.sin(a), z - 0.0004), turn))
    return m.merge(*parts)


FRIES = (
    ("red", "yellow", (0.0700, 0.0325, 0.0962)), ("white", "red", (0.0555, 0.0310, 0.0928)),
    ("blue", "yellow", (0.0800, 0.0252, 0.0814)), ("brown", "cream", (0.0720, 0.0460, 0.0830)),
)  # fmt: skip
"""Colours and outer sizes [m]."""
FRIES_BOX = (0.063, 0.043, 0.0909)
"""Sizes [m] that a box of fries is drawn with, before it is stretched to its own."""


def french_fries(look: int, params: Params) -> ObjectModel:
    """A flared carton full of fries."""
    base, mark, size = FRIES[look]
    foot, mouth, h = (0.022, 0.0155), (0.0315, 0.0215), 0.056
    low = m.ring(m.rounded_rectangle(*foot, 0.004, 2), 0.0)
    lip = m.rounded_rectangle(*mouth, 0.005, 2)
    dip = [(x, y, h - (0.010 * (1 - (x / mouth[0]) ** 2) if y < 0 else -0.008)) for x, y in lip]
    inner = [(x * 0.94, y * 0.94, z) for x, y, z in dip]
    bottom = m.ring(lip, h - 0.016, 0.8)
    carton = m.loft([low, dip, inner, bottom], False)
    underside = m.loft([low, [(x * 0.9, y * 0.9, 0.0005) for x, y, _ in low]], True)
    emblem = []
    for s in (-1, 1):
        hump = m.ellipse(0.0125, 0.0125, 12)
        part = m.upright(hump, (0.0, 0.0, 0.026), s * math.pi / 2)
        lean = (mouth[1] - foot[1]) / h
        tipped = [(x, s * (foot[1] + lean * z + 0.0006), z) for x, _, z in part.vertices]
        emblem.append(m.mesh(tipped, part.faces))
    hull = m.loft([low, m.ring(lip, h - 0.003)])
    parts: list[Shape] = [
        collision(hull),
        collision(Box((0.024, 0.014, 0.014)), (0.0, 0.0, h + 0.010)),
        visual(m.merge(carton, underside), colour(base), roughness=0.7),
        visual(m.merge(*emblem), colour(mark)),
        *_sticks(h),
    ]
    phrases = build.fill_phrases(
        base, "box of french fries in {}", "{} box of french fries", "french fries in a {} box",
        "{} carton of fries", "fries in a {} carton", "{} packet of french fries",
        f"french fries box with a {mark} spot on {base}",
    )  # fmt: skip
    x, y, z = (round(s / drawn, 4) for s, drawn in zip(size, FRIES_BOX, strict=True))
    parts = build.stretched(parts, x, y, z)
    grip = (0.0, 0.0, round(0.034 * z, 4))
    grasps = (build.top_grasp(grip, 0.038 * y, math.pi / 2), build.top_grasp(grip, 0.055 * x))
    return build.model("french_fries", parts, "box of french fries", phrases, grasps)


def _sticks(h: float) -> list[Shape]:
    draw = random.Random(5)
    shades: dict[str, list[Mesh]] = {"#f6c945": [], "#e3a52c": [], "#fbdc74": []}
    names = list(shades)
    for i in range(5):
        for j in range(3):
            x = (i - 2) * 0.0108 + draw.uniform(-0.0012, 0.0012)
            y = (j - 1) * 0.0095 + draw.uniform(-0.0012, 0.0012)
            top = h + 0.010 + 0.008 * j + draw.uniform(-0.007, 0.009)
            lean = axis_rotation((-y * 6 - 0.001, x * 5, 0.02), draw.uniform(0.05, 0.16))
            mid = (top + 0.035) / 2
            stick = m.box_mesh((0.0036, 0.0036, (top - 0.035) / 2), (x, y, mid), lean)
            shades[names[(i + 2 * j) % 3]].append(stick)
    return [visual(m.merge(*p), srgb(c), roughness=0.7) for c, p in shades.items()]


CRUST = srgb("#b8692a")
DARK_CRUST = srgb("#6b3a1a")
GOLD = srgb("#d99a45")
CRUMB = srgb("#f3dcae")
FLOUR = srgb("#f6ead0")

Made = tuple[list[Shape], tuple[Grasp, ...]]


def _arch(half: float, wall: float, height: float) -> list[m.Point]:
    bulge = half * 1.04
    dome = [
        (bulge * math.cos(a), wall + (height - wall) * math.sin(a))
        for a in (0.15, 0.5, 0.9, 1.3, math.pi - 1.3, math.pi - 0.9, math.pi - 0.5, math.pi - 0.15)
    ]
    foot = half * 0.94
    return [(-foot, 0.0), (foot, 0.0), (half, wall * 0.7), *dome, (-half, wall * 0.7)]


def _loaf() -> Made:
    section = _arch(0.0280, 0.036, 0.0615)
    inner = [(x * 0.88, 0.0031 + z * 0.9) for x, z in section]
    ends = [m.upright(inner, (0.0, s * 0.0324, 0.0), s * math.pi / 2) for s in (-1, 1)]
    scores = [_stroke(0.013, 0.0022, 0.0, y, 0.0621) for y in (-0.020, 0.0, 0.020)]
    shapes = [
        collision(m.front_prism(section, 0.032, -0.032)),
        visual(m.front_prism(section, 0.032, -0.032), CRUST, roughness=0.8),
        visual(m.merge(*ends), CRUMB, roughness=0.9),
        visual(m.merge(*scores), GOLD, roughness=0.9),
    ]
    return shapes, (build.top_grasp((0.0, 0.0, 0.036), 0.0565),)


def _stroke(hx: float, hy: float, x: float, y: float, z: float) -> Mesh:
    bar = [(-hx, 0.0), (0.0, -hy), (hx, 0.0), (0.0, hy)]
    return m.flat([(x + u, y + v) for u, v in bar], z)


def _dome(rx: float, ry: float, h: float) -> list[tuple[float, float, float]]:
    steps = ((0.86, 0.0), (0.985, 0.14), (1.0, 0.34), (0.92, 0.62), (0.70, 0.86), (0.36, 0.98))
    return [(rx * s, ry * s, h * t) for s, t in steps]


def _crest(rx: float, ry: float, h: float, x: float, y: float) -> float:
    inside = math.hypot(x / rx, y / ry)
    levels = [(0.0, h), *((s[0] / rx, s[2]) for s in reversed(_dome(rx, ry, h)[2:]))]
    for (a, za), (b, zb) in itertools.pairwise(levels):
        if inside <= b:
            return za + (zb - za) * (inside - a) / (b - a)
    return levels[-1][1]


def _slash(
    rx: float, ry: float, h: float, x: float, y: float, length: float, width: float, turn: float
) -> Mesh:
    c, s = math.cos(turn), math.sin(turn)
    points: list[m.Point] = []
    for k in range(7):
        t = (k / 6 - 0.5) * length
        w = width / 2 * math.sqrt(max(0.02, 1 - (2 * t / length) ** 2))
        points += [(x + t * c - w * s, y + t * s + w * c), (x + t * c + w * s, y + t * s - w * c)]
    return m.strip([(x, y, _crest(rx, ry, h, x, y) + 0.0007) for x, y in points])


def _bun(
    rx: float, ry: float, h: float, crust: tuple[float, float, float], cuts: list[Mesh],
    pale: tuple[float, float, float], power: float = 1.0,
) -> list[Shape]:  # fmt: skip
    body = m.pillow(_dome(rx, ry, h), 16, power)
    return [
        collision(body),
        visual(body, crust, roughness=0.75),
        visual(m.merge(*cuts), pale, roughness=0.9),
    ]


def _roll() -> Made:
    r, h = 0.0285, 0.0535
    cuts = [_slash(r, r, h, 0.0, 0.0, 0.042, 0.006, a) for a in (math.pi / 4, 3 * math.pi / 4)]
    return _bun(r, r, h, GOLD, cuts, CRUMB), build.round_grasps(2 * r, 0.020, 0.6)


def _baguette() -> Made:
    rx, ry, h = 0.0215, 0.0475, 0.043
    cuts = [_slash(rx, ry, h, 0.0, y, 0.024, 0.0065, 0.9) for y in (-0.027, -0.009, 0.009, 0.027)]
    return _bun(rx, ry, h, CRUST, cuts, CRUMB, 0.85), (build.top_grasp((0.0, 0.0, 0.017), 2 * rx),)


def _croissant() -> Made:
    bend = 0.030
    shapes: list[Shape] = []
    golden: list[Mesh] = []
    brown: list[Mesh] = []
    sizes = (0.0065, 0.0105, 0.0145, 0.0165, 0.0145, 0.0105, 0.0065)
    for i, size in enumerate(sizes):
        a = math.pi / 2 + (i - 3) * 0.42
        at = (bend * 1.12 * math.cos(a), bend * math.sin(a) - 0.021, 0.0)
        sections = [(0.0112 * s, size * s, 2 * size * 0.92 * t) for s, t in _ROUND]
        part = m.moved(m.pillow(sections, 8), at, yaw_rotation(a - math.pi / 2))
        (golden if i % 2 else brown).append(part)
        if i in (1, 3, 5):
            shapes.append(collision(part))
    middle = [(0.0105, 0.0162, 0.0), (0.0105, 0.0162, 0.026)]
    shapes.append(collision(m.moved(m.pillow(middle, 10), (0.0, bend - 0.021, 0.0))))
    shapes += [
        visual(m.merge(*golden), srgb("#d18a35"), roughness=0.5),
        visual(m.merge(*brown), srgb("#a9611f"), roughness=0.5),
    ]
    grasp = build.top_grasp((0.0, 1.05 * (bend - 0.021), 0.017), 0.0340, math.pi / 2)
    return build.stretched(shapes, 0.75, 1.05, 1.22), (grasp,)


_ROUND = ((0.75, 0.0), (1.0, 0.32), (0.84, 0.72), (0.35, 1.0))


def _toast() -> Made:
    top = [(0.018, 0.029), (0.0255, 0.029), (0.029, 0.024), (0.029, 0.018), (0.026, 0.012)]
    outline = [(-0.026, -0.029), (0.026, -0.029), *((x, y) for x, y in reversed(top))]
    outline += [(0.0, 0.031), *((-x, y) for x, y in top)]
    inner = [(x * 0.88, y * 0.88) for x, y in outline]
    height = 0.0255
    shapes = [
        collision(Box((0.026, 0.029, height / 2)), (0.0, 0.0, height / 2)),
        visual(m.prism(outline, 0.0, height), CRUST, roughness=0.9),
        visual(m.flat(inner, height + 0.0004), CRUMB, roughness=0.95),
        visual(m.flat(m.ellipse(0.012, 0.011, 9, 0.3), height + 0.0008), srgb("#e3b876")),
    ]
    return build.stretched(shapes, 1.08, 1.05, 1.0), build.box_grasps(0.0281, 0.0305, 0.014, 0.5)


def _rye() -> Made:
    rx, ry, h = 0.0365, 0.0440, 0.035
    cuts = [_slash(rx, ry, h, 0.0, y, 0.050, 0.0055, 0.0) for y in (-0.022, -0.0075, 0.0075, 0.022)]
    return _bun(rx, ry, h, DARK_CRUST, cuts, FLOUR), (build.top_grasp((0.0, 0.0, 0.015), 0.0715),)


def _long_bun() -> Made:
    rx, ry, h = 0.0240, 0.0475, 0.0415
    cut = _slash(rx, ry, h, 0.0, 0.0, 0.066, 0.008, math.pi / 2)
    shapes = _bun(rx, ry, h, srgb("#d98f3d"), [cut], FLOUR, 0.8)
    return shapes, (build.top_grasp((0.0, 0.0, 0.017), 2 * rx),)


BREADS: tuple[tuple[Callable[[], Made], tuple[str, ...]], ...] = (
    (_loaf, (
        "loaf of bread", "crusty loaf", "brown bread loaf", "brick-shaped bread", "sandwich loaf",
        "boxy loaf of bread", "whole loaf of bread",
    )),
    (_roll, (
        "round bread roll", "bread roll", "round bun", "golden bread roll", "dinner roll",
        "bread roll with a cross cut", "small round bread",
    )),
    (_baguette, (
        "piece of baguette", "short baguette", "small French bread", "narrow baguette",
        "baguette with slanted cuts", "thin crusty bread", "mini baguette",
    )),
    (_croissant, (
        "croissant", "crescent-shaped bread", "curved pastry", "crescent roll",
        "butter croissant", "bread shaped like a crescent", "bent golden pastry",
    )),
    (_toast, (
        "slice of bread", "slice of toast", "flat slice of bread", "piece of toast",
        "toast bread slice", "single slice of white bread", "bread slice with a brown crust",
    )),
    (_rye, (
        "dark bread", "dark rye bread", "dark brown bread", "oval rye loaf",
        "dark bread with floury stripes", "brown oval bread", "dark oval loaf",
    )),
    (_long_bun, (
        "long bun", "hot dog bun", "long bread roll", "oblong bun", "long golden bun",
        "bun with a lengthwise cut", "long soft roll",
    )),
)  # fmt: skip


def bread(look: int, params: Params) -> ObjectModel:
    """One of seven kinds of bread."""
    make, phrases = BREADS[look]
    shapes, grasps = make()
    return build.model("bread", shapes, "bread", phrases, grasps)


ASSETS = build.library((hamburger, BURGERS), (french_fries, FRIES), (bread, BREADS))
