"""More things to pick: `cup`, `apple`, `perfume`, `coffee_box` and `payment_sign`."""

import math
import random

from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.boxes import SIDES, on_side
from robospa.tasks.objects.build import collision, colour, solid, srgb, visual
from robospa.tasks.shapes import Box, Cylinder, Mesh, ObjectModel, Params

CUPS = (
    ("red", "white", "dots", 0.0425, 0.0895), ("blue", "yellow", "bands", 0.0380, 0.0916),
    ("green", "white", "bands", 0.0385, 0.1115), ("yellow", "red", "dots", 0.0350, 0.0815),
    ("white", "navy", "bands", 0.0440, 0.1065), ("purple", "pink", "dots", 0.0390, 0.0814),
)  # fmt: skip
"""Colours, pattern, radius of the rim and height [m]."""
CUP_LEAN = 0.09
"""How far the wall of a cup leans outwards [rad]."""


def cup(look: int, params: Params) -> ObjectModel:
    """A drinking cup without handle, wider at the top, with painted dots or bands."""
    base, mark, style, rim, h = CUPS[look]
    foot, wall, floor = rim - h * math.tan(CUP_LEAN), build.RIM, 0.006

    def radius(z: float) -> float:
        return foot + z * math.tan(CUP_LEAN)

    top = radius(h)
    outer = [(0.0, 0.0), (foot - 0.0015, 0.0), (radius(0.0018), 0.0018), (top, h)]
    inner = [(top - wall, h), (radius(floor) - wall, floor), (0.0, floor)]
    glaze = colour("cream") if base == "white" else colour("white")
    if style == "dots":
        dot = m.ellipse(0.0075, 0.0075, 8)
        marks = [
            m.decal(dot, radius(z) + 0.0008, z, math.pi / 4 * (i + 0.5 * row))
            for row, z in enumerate((0.26 * h, 0.51 * h, 0.76 * h))
            for i in range(8)
        ]
    else:
        marks = [
            m.lathe([(radius(a) + 0.0005, a), (radius(b) + 0.0005, b)], 18, False)
            for a, b in ((0.18 * h, 0.26 * h), (0.66 * h, 0.84 * h))
        ]
    parts = [
        visual(m.lathe(outer, 18, False), colour(base), roughness=0.3),
        visual(m.lathe([(top, h), inner[0]], 18, False), colour(base), roughness=0.3),
        visual(m.lathe(inner, 18, False), glaze, roughness=0.3),
        visual(m.merge(*marks), colour(mark), roughness=0.3),
        collision(Cylinder(foot, floor / 2), (0.0, 0.0, floor / 2)),
        *build.wall_ring(radius(h / 2) - wall, wall, 0.0005, h - 0.0003, 12, CUP_LEAN),
    ]
    word = {"dots": "dotted", "bands": "striped"}[style]
    phrases = build.fill_phrases(
        base, "{} cup", "{} drinking cup", "cup in {}", "{} cup without a handle",
        f"{word} {base} cup", "{} tumbler", "round {} drinking cup",
        f"{base} cup with {mark} {style}",
    )  # fmt: skip
    z = h - 0.007
    grasps = build.rim_grasps(radius(z) - wall / 2, wall, z, 12, lean=CUP_LEAN)
    return build.model("cup", parts, "cup", phrases, grasps, support=(0.0, 0.0, floor))


APPLES = (
    ("#c4161f", "#8a3a14", "red", 1.0), ("#74b52c", "#5a6e1c", "green", 0.89),
    ("#efc52e", "#a9801a", "yellow", 1.0), ("#ee8f97", "#b06a4a", "pink", 0.89),
)  # fmt: skip
"""Colours, colour word, and size relative to an apple 5.7 cm wide and 6.3 high."""


def apple(look: int, params: Params) -> ObjectModel:
    """An apple with a dimple, a stalk and a leaf; it stands on a small flat base."""
    skin, hollow, word, size = APPLES[look]
    base = [(0.0, 0.0), (0.0135, 0.0), (0.0205, 0.0045), (0.0262, 0.0145), (0.0288, 0.0260)]
    cheek = [(0.0292, 0.0325), (0.0282, 0.0400), (0.0250, 0.0470)]
    crown = [(0.0192, 0.0512), (0.0120, 0.0522), (0.0060, 0.0500), (0.0, 0.0455)]
    hull = [*base[1:], *cheek, *crown[:2]]
    leaf = [(0.0, 0.0), (0.006, -0.0042), (0.013, -0.0036), (0.0175, 0.0), (0.013, 0.0036),
            (0.006, 0.0042)]  # fmt: skip
    turned = m.moved(m.prism(leaf, -0.0004, 0.0004), (0.0, 0.0, 0.0545), (0.96, 0.0, -0.20, 0.20))
    parts = [
        collision(m.lathe(hull, 16)),
        visual(m.lathe([*base, *cheek, *crown], 20, False), srgb(skin), roughness=0.3),
        visual(m.lathe([(0.0072, 0.0518), (0.0, 0.0468)], 12, False), srgb(hollow), roughness=0.6),
        visual(m.tube([(0.0, 0.0, 0.044), (0.0008, 0.0, 0.054), (0.003, 0.0, 0.060)], 0.0012, 6),
              colour("brown"), roughness=0.8),
        visual(turned, srgb("#3c8a2e"), roughness=0.6),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} apple", "round {} apple", "apple with {} skin", "fresh {} apple", "apple in {}",
        "{} fruit", "ripe {} apple",
    )  # fmt: skip
    wide, high = 0.975 * size, 1.02 * size
    parts = build.stretched(parts, wide, wide, high)
    grasps = build.round_grasps(2 * 0.0292 * wide, 0.031 * high, 0.8)
    top = (0.0, 0.0, 0.052 * high)
    return build.model("apple", parts, "apple", phrases, grasps, mass=0.01, support=top)


PERFUMES = (
    ("#f0a9bd", "gold", "pink", "square"), ("#6fa8dc", "silver", "blue", "square"),
    ("#b48ad6", "silver", "purple", "round"), ("#8fce9f", "gold", "green", "round"),
    ("#2a2b31", "gold", "black", "square"), ("#f0c24e", "black", "yellow", "round"),
)  # fmt: skip
PERFUME = (0.050, 0.0205, 0.108)
"""Half width and half depth of a flask, and its height up to the collar [m]."""
PERFUME_CAP, PERFUME_HEIGHT, PERFUME_GRIP = 0.0165, 0.155, 0.132
"""Radius of the cap, height in all, and how high it is grasped by the cap [m] (official)."""


def perfume(look: int, params: Params) -> ObjectModel:
    """A flat flask of thick clear glass, square or round, with a spray bulb and a stopper."""
    glass, cap, word, form = PERFUMES[look]
    pale = "#f6efe6" if word != "black" else "#d6a52c"
    hx, hy, h = PERFUME
    half = (hx, hy, h / 2)
    faces = (SIDES[0], SIDES[2])
    if form == "square":
        body = m.moved(m.slab(hx - 0.003, hy - 0.0006, 0.076, 0.004, 0.0, 2), (0.0, 0.0, 0.008))
        flank = m.rounded_rectangle(hx, hy, 0.006, 2)
        glass_parts = [
            m.prism(flank, 0.0, 0.010),
            m.prism(flank, 0.084, 0.094),
            m.moved(m.prism(flank, 0.0, h - 0.094, 0.55), (0.0, 0.0, 0.094)),
        ]
        felt = collision(Box(half), (0.0, 0.0, h / 2))
        label = m.merge(*(on_side(m.rectangle(0.030, 0.024), half, s) for s in faces))
    else:
        rim = [(x, max(h / 2 * (1 + z), 0.0)) for x, z in m.ellipse(hx, 1.07, 22, 0.07)]
        disc = m.front_prism([(x, min(z, h)) for x, z in rim], hy, -hy)
        body = m.front_prism([(0.98 * x, z) for x, z in rim if z < 0.088], hy - 0.0006, 0.0006 - hy)
        rest = [(x, min(z, h)) for x, z in rim if z > 0.083]
        glass_parts = [m.front_prism(rest, hy, -hy)]
        felt = collision(disc)
        label = m.merge(*(on_side(m.ellipse(0.030, 0.028, 16), half, s) for s in faces))
    line = m.merge(
        *(on_side(m.rectangle(0.020, 0.0022, 0.0, v), half, s, 0.0009)
          for s in faces for v in (0.009, 0.0, -0.009))
    )  # fmt: skip
    r, top = PERFUME_CAP, PERFUME_HEIGHT
    body_grip = build.top_grasp((0.0, 0.0, 0.085), 2 * hy, math.pi / 2)
    grasps = (*build.round_grasps(2 * r, PERFUME_GRIP, 0.7), body_grip)
    collar = [(0.012, h - 0.001), (0.012, h + 0.006)]
    lid = [(0.006, h + 0.006), (0.006, h + 0.012), (r, h + 0.017), (r, top - 0.012), (0.010, top)]
    x, z = 0.037, h + 0.010
    hose = m.tube([(0.0, 0.0, h + 0.009), (0.018, 0.0, h + 0.013), (x, 0.0, z)], 0.0028, 5)
    ball = m.lathe([(0.0, -0.009), (0.011, -0.004), (0.011, 0.004), (0.0, 0.009)], 10, False)
    bulb = m.moved(ball, (x, 0.0, z), build.ALONG_X)
    thin = tuple(0.5 * c + (0.4 if word != "black" else 0.06) for c in srgb(glass))
    shine = 0.4 if cap != "black" else 0.0
    parts = [
        felt,
        collision(Cylinder(r, (top - h) / 2), (0.0, 0.0, (top + h) / 2)),
        visual(body, srgb(glass), roughness=0.1),
        visual(label, srgb(pale), roughness=0.5),
        visual(line, colour("brown") if word != "black" else srgb("#2a2b31")),
        visual(m.lathe(collar, 12), build.STEEL, roughness=0.25, metallic=0.4),
        visual(m.merge(m.lathe(lid, 8), hose, bulb), colour(cap), roughness=0.25, metallic=shine),
        *(visual(part, (thin[0], thin[1], thin[2]), roughness=0.1) for part in glass_parts),
    ]
    phrases = build.fill_phrases(
        word, "{} perfume", "{} perfume bottle", "bottle of {} perfume", "{} fragrance bottle",
        f"{word} perfume with a {cap} cap", "perfume in {} glass", "{} scent bottle",
    )  # fmt: skip
    return build.model("perfume", parts, "perfume bottle", phrases, grasps)


COFFEES = (
    ("brown", "cream", "brown", (0.0660, 0.0560, 0.0962)),
    ("red", "cream", "red", (0.0560, 0.0520, 0.0768)),
    ("dark green", "gold", "green", (0.0690, 0.0620, 0.0694)),
    ("black", "orange", "black", (0.0690, 0.0500, 0.0690)),
    ("navy", "light blue", "blue", (0.0460, 0.0480, 0.0772)),
)  # fmt: skip
"""Colours, colour word and sizes [m]."""
COFFEE_BOX = (0.058, 0.042, 0.084)
"""Sizes [m] that a coffee box is drawn with, before it is stretched to its own."""


def coffee_box(look: int, params: Params) -> ObjectModel:
    """A standing carton of coffee with a steaming cup on its broad sides and a bean on its lid."""
    base, mark, word, size = COFFEES[look]
    half = (COFFEE_BOX[0] / 2, COFFEE_BOX[1] / 2, COFFEE_BOX[2] / 2)
    bowl = [(-0.011, 0.006), (-0.0085, -0.008), (-0.005, -0.010), (0.005, -0.010), (0.0085, -0.008),
            (0.011, 0.006)]  # fmt: skip
    saucer = m.rectangle(0.014, 0.0012, 0.0, -0.0125)
    ear = m.rectangle(0.0022, 0.0042, 0.0125, -0.0005)
    steam = [
        [(x - 0.0011, 0.010), (x + 0.0011, 0.010), (x + 0.0024, 0.014), (x + 0.0011, 0.019),
         (x - 0.0011, 0.019), (x + 0.0002, 0.014)]
        for x in (-0.005, 0.0, 0.005)
    ]  # fmt: skip
    broad = (SIDES[0], SIDES[2])
    icon = [on_side(p, half, s, 0.0008) for s in broad for p in (bowl, saucer, ear, *steam)]
    field = [on_side(m.rounded_rectangle(0.021, 0.024, 0.004), half, s) for s in broad]
    beans = [on_side(m.ellipse(0.0075, 0.011, 12), half, s) for s in (SIDES[1], SIDES[3])]
    seams = [on_side(m.rectangle(0.0009, 0.0095), half, s, 0.0008) for s in (SIDES[1], SIDES[3])]
    bands = [
        on_side(m.rectangle(half[0] if s in broad else half[1], 0.0035, 0.0, v), half, s, 0.0003)
        for s in SIDES
        for v in (0.0345, -0.0345)
    ]
    top = 2 * half[2]
    lid = m.flat(m.ellipse(0.013, 0.010, 14), top + 0.0004)
    cut = m.flat(m.rectangle(0.0115, 0.0009), top + 0.0008)
    parts = [
        solid(Box(half), colour(base), (0.0, 0.0, half[2]), roughness=0.7),
        visual(m.merge(*field), build.PAPER),
        visual(m.merge(*icon), colour(base) if base != "black" else srgb("#5a2f14")),
        visual(m.merge(*beans, lid, *bands), colour(mark)),
        visual(m.merge(*seams, cut), colour(base)),
    ]
    phrases = build.fill_phrases(
        word, "{} coffee box", "{} box of coffee", "{} carton of coffee", "coffee box in {}",
        "{} package of coffee", "coffee carton with {} sides", "{} coffee package",
    )  # fmt: skip
    x, y, z = (round(s / drawn, 4) for s, drawn in zip(size, COFFEE_BOX, strict=True))
    parts = build.stretched(parts, x, y, z)
    grasps = build.box_grasps(half[0] * x, half[1] * y, 0.65 * size[2])[::-1]
    return build.model("coffee_box", parts, "coffee box", phrases, grasps)


SIGNS = (
    ("blue", 0.0370, 0.0165, 0.0966), ("green", 0.0430, 0.0340, 0.1522),
    ("red", 0.0360, 0.0310, 0.1542), ("orange", 0.0370, 0.0165, 0.0966),
    ("purple", 0.0360, 0.0310, 0.1542),
)  # fmt: skip
"""Colour, half width, half depth of the foot, and height [m]."""


def payment_sign(look: int, params: Params) -> ObjectModel:
    """A tent on a foot, to pay by phone: a square code in front, radio waves on all sides."""
    word, hx, foot, z1 = SIGNS[look]
    hy, z0 = 0.0060, 0.006
    middle = (z0 + z1) / 2
    half = (hx, hy, middle)
    front, back = SIDES[0], SIDES[2]
    cell = 0.112 * hx
    low = 0.012 - middle + cell
    dots = [
        on_side(m.rectangle(cell * n / 2, cell / 2, cell * (c + n / 2 - 5.5), low + cell * r), half,
                front, 0.0011)
        for r, row in enumerate(_code(look))
        for c, n in row
    ]  # fmt: skip
    paper = 6.83 * cell
    field = [(x, y + low + 5 * cell) for x, y in m.rounded_rectangle(paper, paper, cell)]
    room = (middle + low + 5 * cell + paper, z1)  # between the code and the upper edge
    size = min(hx / 0.027, (room[1] - room[0]) / 0.024)
    lean = (0.85 * foot - hy) / (z1 - z0)

    def tent(part: Mesh) -> Mesh:
        """What is drawn on an upright plate, on two that lean on each other."""
        leaning = [(x, y + math.copysign(lean * (z1 - z), y), z) for x, y, z in part.vertices]
        return m.mesh(leaning, part.faces)

    wide = hx - 0.0008
    large, narrow = min(hx / 0.010, z1 / 0.032), (hy + lean * (z1 - 0.036)) / 0.0085
    waves = (
        tent(_waves(half, front, size, sum(room) / 2 - middle)),
        tent(_waves(half, back, large, 0.0)),
        *(_waves((wide, hy, middle), side, narrow, 0.030 - middle) for side in SIDES[1::2]),
    )
    parts = [
        collision(Box((hx, foot, z0 / 2)), (0.0, 0.0, z0 / 2)),
        collision(Box((hx, hy, (z1 - z0) / 2)), (0.0, 0.0, middle)),
        visual(m.slab(hx, foot, z0, 0.004, 0.0015), srgb("#d9dde2"), roughness=0.3),
        visual(tent(m.moved(m.prism(m.rectangle(wide, hy), 0.0, z1 - z0), (0.0, 0.0, z0))),
               colour(word), roughness=0.3),
        visual(tent(on_side(field, half, front, 0.0006)), build.PAPER),
        visual(tent(m.merge(*dots)), srgb("#16171a")),
        visual(m.merge(*waves), colour("white")),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} payment sign", "{} sign for paying by phone", "{} payment stand",
        "payment sign in {}", "{} sign with a square code", "{} QR code sign", "{} pay sign",
    )  # fmt: skip
    grasps = (build.top_grasp((0.0, 0.0, z1 - 0.016), 2 * hy, math.pi / 2, 0.6),)
    return build.model("payment_sign", parts, "payment sign", phrases, grasps)


def _code(seed: int) -> list[list[tuple[int, int]]]:
    """An 11 x 11 square code, bottom row first, as (first column, length) of its dark runs."""
    rng = random.Random(40 + seed)
    rows = []
    for r in range(11):
        cells = [rng.random() < 0.5 for _ in range(11)]
        for low in (0, 8):
            for corner in (0, 8):
                if (low, corner) != (0, 8) and low <= r < low + 3:
                    cells[corner : corner + 3] = [True, r != low + 1, True]
        edges = [i for i in range(12) if (i < 11 and cells[i]) != (i > 0 and cells[i - 1])]
        rows.append([(a, b - a) for a, b in zip(edges[::2], edges[1::2], strict=True)])
    return rows


def _waves(half: tuple[float, float, float], side: float, size: float, at: float) -> Mesh:
    """Three arcs of radio waves of relative `size`, `at` [m] above the middle of the sign."""
    arcs = []
    for r in (0.004 * size, 0.008 * size, 0.012 * size):
        angles = [math.radians(-42 + 84 * i / 3) for i in range(4)]
        outer = [(r * math.cos(a), r * math.sin(a)) for a in angles]
        thin = r - 0.0018 * size
        inner = [(thin * math.cos(a), thin * math.sin(a)) for a in reversed(angles)]
        ring = [(x - 0.006 * size, y + at) for x, y in [*outer, *inner]]
        arcs.append(on_side(ring, half, side, 0.0006))
    return m.merge(*arcs)


ASSETS = build.library(
    (cup, CUPS), (apple, APPLES), (perfume, PERFUMES), (coffee_box, COFFEES), (payment_sign, SIGNS),
)  # fmt: skip
