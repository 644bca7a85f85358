"""Upright round packages: `sauce_can`, `can`, `bottle`, `pill_bottle` and `glue`."""

import math

from robospa.geometry import yaw_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.shapes import Cylinder, Mesh, ObjectModel, Params, Shape

THIRDS = (-math.pi / 2, math.pi / 6, 5 * math.pi / 6)
"""Three directions about z, the first to the front."""


def around(polygon: m.Polygon, radius: float, height: float) -> Mesh:
    """`polygon` wrapped on a cylinder three times, once in each of `THIRDS`."""
    return m.merge(*(m.decal(polygon, radius, height, a) for a in THIRDS))


SAUCES = (
    ("red", "#f6f4ec", "#c8201c", "tomato sauce", "red", 0.036),
    ("green", "#f6f4ec", "#2f8f33", "pesto", "green", 0.0405),
    ("yellow", "#7a2b10", "#f5c816", "mustard sauce", "yellow", 0.039),
    ("orange", "#fff3d6", "#d9480f", "curry sauce", "orange", 0.0345),
    ("brown", "#f2e3bd", "#5a2f14", "gravy", "brown", 0.033),
)
"""Colours, content, colour word and radius [m]."""
SAUCE_HEIGHT, SAUCE_GRIP = 0.116, 0.088
"""Height of a sauce can, and how high it is grasped from above [m] (official)."""


def sauce_can(look: int, params: Params) -> ObjectModel:
    """A tin with a paper label, a round picture and a pull ring on its lid."""
    base, field, mark, content, word, r = SAUCES[look]
    h = SAUCE_HEIGHT
    rim = [(r - 0.002, 0.0), (r, 0.001), (r, 0.005), (r - 0.0012, 0.006)]
    rim += [(r - 0.0012, h - 0.006), (r, h - 0.005), (r, h), (r - 0.003, h), (r - 0.003, h - 0.003)]
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(rim, 16), build.STEEL, roughness=0.3, metallic=0.5),
        visual(m.lathe([(r, 0.010), (r, h - 0.010)], 16, False), colour(base), roughness=0.6),
        visual(around(m.ellipse(0.78 * r, 0.031, 12), r + 0.0006, h / 2), srgb(field)),
        visual(around(m.ellipse(0.48 * r, 0.019, 10), r + 0.0013, h / 2 - 0.003), srgb(mark)),
        visual(around(_sprig(1.5), r + 0.0019, h / 2 + 0.013), colour("green")),
        visual(_pull_ring(0.013, h - 0.0024), srgb("#8d9298"), roughness=0.3, metallic=0.4),
    ]
    phrases = build.fill_phrases(
        word, "{} sauce can", "{} tin of sauce", "can of sauce with a {} label", "{} sauce tin",
        "sauce can wrapped in {}", "{}-labelled can of sauce", f"{word} can of {content}",
    )  # fmt: skip
    grasps = build.round_grasps(2 * r, SAUCE_GRIP, 0.9)
    return build.model("sauce_can", parts, "sauce can", phrases, grasps, support=(0.0, 0.0, h))


def _sprig(size: float) -> list[m.Point]:
    ring = [(0.0, 0.0055), (-0.0012, 0.001), (-0.006, 0.0028), (-0.002, -0.002), (0.0, -0.0035),
            (0.002, -0.002), (0.006, 0.0028), (0.0012, 0.001)]  # fmt: skip
    return [(size * u, size * v) for u, v in ring]


def _pull_ring(size: float, z: float) -> Mesh:
    ring = m.tube([(size * x, size * 1.25 * y, z) for x, y in m.ellipse(1, 1, 9)], 0.0014, 4, True)
    return m.merge(ring, m.flat(m.ellipse(0.003, 0.003, 6), z + 0.0015, (0.0, size * 0.95)))


CANS = (
    ("red", "white", "wave", 0.0270), ("blue", "silver", "star", 0.0260),
    ("green", "yellow", "bubbles", 0.0275), ("orange", "white", "bubbles", 0.0300),
    ("black", "gold", "star", 0.0275), ("purple", "pink", "wave", 0.0260),
)  # fmt: skip
"""Colours, print and radius [m]."""
CAN_HEIGHT, CAN_GRIP = 0.0965, 0.071
"""Height of a drink can, and how high it is grasped from above [m] (official)."""


def can(look: int, params: Params) -> ObjectModel:
    """A slim drink can with necked ends, a pull tab and a printed sign."""
    base, mark, sign, r = CANS[look]
    h = CAN_HEIGHT
    body = [(r - 0.001, 0.009), (r, 0.012), (r, h - 0.015), (r - 0.001, h - 0.012)]
    bottom = [(r - 0.007, 0.0), (r - 0.005, 0.001), (r - 0.001, 0.009)]
    top = [(r - 0.001, h - 0.012), (r - 0.0055, h - 0.003), (r - 0.005, h), (r - 0.0068, h)]
    top += [(r - 0.0075, h - 0.003)]
    ends = m.merge(m.lathe(bottom, 16), m.lathe(top, 16))
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(body, 16, False), colour(base), roughness=0.35, metallic=0.2),
        visual(ends, build.STEEL, roughness=0.3, metallic=0.5),
        visual(_sign(sign, r, h), colour(mark), roughness=0.4),
        visual(_tab(h - 0.0026), srgb("#7f858c"), roughness=0.3, metallic=0.4),
    ]
    phrases = build.fill_phrases(
        base, "{} drink can", "{} soda can", "can in {}", "{} can", "{} beverage can",
        "{} aluminium can", "can of soda with a {} body",
    )  # fmt: skip
    grasps = build.round_grasps(2 * r, CAN_GRIP, 1.2)
    return build.model("can", parts, "can", phrases, grasps, support=(0.0, 0.0, h))


def _sign(sign: str, r: float, h: float) -> Mesh:
    if sign == "star":
        return around(m.star(0.021, 0.0095), r + 0.0012, h / 2)
    if sign == "bubbles":
        dots = [(0.0, 0.012, 0.011), (-0.012, -0.006, 0.007), (0.011, -0.012, 0.008)]
        return m.merge(*(m.decal(m.ellipse(s, s, 8), r + 0.0008, h / 2 + v, a + u / r)
                         for a in THIRDS for u, v, s in dots))  # fmt: skip
    faces, vertices = [], []
    n = 16
    for i in range(n + 1):
        a = 2 * math.pi * i / n
        z = h / 2 + 0.010 * math.sin(2 * a)
        for dz in (-0.009, 0.009):
            vertices.append(((r + 0.0006) * math.cos(a), (r + 0.0006) * math.sin(a), z + dz))
        if i < n:
            k = 2 * i
            faces += [(k, k + 2, k + 3), (k, k + 3, k + 1)]
    return m.mesh(vertices, faces)


def _tab(z: float) -> Mesh:
    ring = m.flat(m.ellipse(0.0055, 0.0085, 10), z + 0.0006, (0.0, 0.004))
    hole = m.flat(m.ellipse(0.0065, 0.0045, 8), z + 0.0003, (0.0, -0.010))
    return m.merge(ring, hole)


BOTTLES = (
    ("#2f8f4a", "yellow", "white", "green", "yellow label", 0.0325, 0.216, 0.080),
    ("#7fbfe6", "blue", "blue", "light blue", "blue label", 0.0340, 0.227, 0.082),
    ("#4a1d0c", "red", "red", "brown", "red label", 0.0330, 0.248, 0.122),
    ("#f39a2d", "white", "orange", "orange", "white label", 0.0345, 0.220, 0.117),
)
"""Colours, colour word, detail, radius, height and where it is grasped from the side [m]."""


def bottle(look: int, params: Params) -> ObjectModel:
    """A standing drink bottle with shoulder, neck, screw cap and a wrapped label."""
    glass, label, cap, word, detail, r, h, grip = BOTTLES[look]
    wall, shoulder, neck, screw = 0.60 * h, 0.80 * h, 0.0125, 0.0145
    body = [(r - 0.004, 0.0), (r, 0.004), (r, wall), (r * 0.82, 0.69 * h), (neck + 0.001, shoulder)]
    body += [(neck, 0.92 * h)]
    lid = [(screw, 0.88 * h), (screw, h - 0.001), (screw - 0.001, h)]
    middle = 0.36 * h
    wrap = [(r + 0.0004, middle - 0.15 * h), (r + 0.0004, middle + 0.15 * h)]
    emblem = {"white": colour("red"), "yellow": colour("green")}.get(label, build.PAPER)
    parts = [
        collision(Cylinder(r, wall / 2), (0.0, 0.0, wall / 2)),
        collision(m.lathe([(r * 0.97, wall), (screw, shoulder)], 10)),
        collision(Cylinder(screw, (h - shoulder) / 2), (0.0, 0.0, (h + shoulder) / 2)),
        visual(m.lathe(body, 16), srgb(glass), roughness=0.15),
        visual(m.lathe(wrap, 16, False), colour(label)),
        visual(around(m.ellipse(0.0145, 0.021, 10), r + 0.0011, middle), emblem),
        visual(m.lathe(lid, 12), colour(cap), roughness=0.4),
    ]
    phrases = build.fill_phrases(
        word, "{} bottle", "{} drink bottle", "bottle in {}", "{} plastic bottle",
        f"{word} bottle with a {detail}", "{} bottle with a cap", "tall {} bottle",
    )  # fmt: skip
    grasps = build.side_grasps(2 * r, grip)
    top = (0.0, 0.0, h)
    return build.model("bottle", parts, "bottle", phrases, grasps, support=top)


PILLS = (
    ("#e8780f", "white", "orange", 0.0340), ("#f2f2ee", "blue", "white", 0.0385),
    ("#6a3413", "white", "brown", 0.0355), ("#2f9a4c", "white", "green", 0.0325),
    ("#2b62c9", "white", "blue", 0.0335),
)  # fmt: skip
"""Colours of bottle and cap, colour word and radius [m]."""
PILL_HEIGHT, PILL_GRIP = 0.155, 0.125
"""Height of a pill bottle, and how high it is grasped from above [m] (official)."""
PILL_TURNS = (0.6 + math.pi, 0.6)
"""How the halves of the capsule on its cap are turned [rad]."""


def pill_bottle(look: int, params: Params) -> ObjectModel:
    """A medicine bottle with a neck, a capsule on its wide ribbed cap, and a cross on its label."""
    shell, cap, word, r = PILLS[look]
    h = PILL_HEIGHT
    body = [(0.0, 0.0), (r - 0.002, 0.0), (r, 0.002), (r, 0.088), (r * 0.68, 0.108)]
    body += [(r * 0.68, 0.124)]
    label = srgb("#cfe0f4") if word == "white" else build.PAPER
    cross = m.rectangle(0.0052, 0.0170), m.rectangle(0.0134, 0.0052)
    cross_before = m.rectangle(0.0042, 0.0140), m.rectangle(0.0140, 0.0042)
    red = srgb("#c8202a")
    top = h - 0.0010
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(body, 16, False), srgb(shell), roughness=0.2),
        visual(m.lathe([(r + 0.0004, 0.016), (r + 0.0004, 0.080)], 16, False), label),
        visual(m.merge(*(around(c, r + 0.0009, 0.048) for c in cross)),
               red if word != "orange" else srgb("#1f55c4")),
        visual(_ribbed(r - 0.0015, 0.122, top), colour(cap), roughness=0.5),
        visual(m.merge(*(_half_pill(0.78 * r, top + 0.0003, t) for t in PILL_TURNS)), build.DARK),
        visual(_half_pill(0.66 * r, top + 0.0006, PILL_TURNS[0]), build.PAPER),
        visual(_half_pill(0.66 * r, top + 0.0006, PILL_TURNS[1]), red),
        build.outline(m.lathe([(r + 0.0004, 0.022), (r + 0.0004, h)], 16)),
        build.outline(m.merge(*(around(c, r + 0.0012, 0.047) for c in cross_before))),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} pill bottle", "{} medicine bottle", "{} bottle of pills", "pill bottle in {}",
        "{} plastic medicine bottle", "{} pill container", f"{word} pill bottle with a {cap} cap",
    )  # fmt: skip
    grasps = build.round_grasps(2 * r, PILL_GRIP, 1.0)
    return build.model("pill_bottle", parts, "pill bottle", phrases, grasps, support=(0.0, 0.0, h))


def _half_pill(long: float, z: float, turn: float) -> Mesh:
    """Half a capsule lying at `z`, `long` [m] from the capsule's middle to its end."""
    wide = 0.46 * long
    arc = [(long - wide + wide * math.cos(t), wide * math.sin(t)) for t in (-1.57, -0.8, 0.8, 1.57)]
    end = m.flat([(0.0, -wide), *arc, (0.0, wide)], z)
    return m.moved(end, rotation=yaw_rotation(turn))


def _ribbed(radius: float, low: float, high: float) -> Mesh:
    n = 24
    rim = [
        (radius * s * math.cos(2 * math.pi * i / n), radius * s * math.sin(2 * math.pi * i / n))
        for i in range(n)
        for s in ((1.0, 0.94)[i % 2],)
    ]
    disc = [(x * 0.93, y * 0.93) for x, y in rim]
    return m.loft([m.ring(rim, low), m.ring(rim, high - 0.001), m.ring(disc, high)])


GLUES = (
    ("white", "orange", "bottle", "white glue bottle with an orange tip", (0.038, 0.0335)),
    ("yellow", "black", "stick", "yellow glue stick with a black cap", (0.0215, 0.0215)),
    ("blue", "white", "stick", "blue glue stick with a white cap", (0.0190, 0.0190)),
    ("red", "white", "bottle", "red glue bottle with a white tip", (0.0300, 0.0250)),
)
"""Colours, kind, its own phrase, and half sizes in x and y [m]."""


def glue(look: int, params: Params) -> ObjectModel:
    """A glue stick (cylinder with cap) or a squeeze bottle with a pointed nozzle."""
    base, tip, kind, extra, (rx, ry) = GLUES[look]
    noun = f"glue {kind}"
    phrases = (
        f"{base} {noun}", extra, f"{base} glue", f"{noun} in {base}", f"{kind} of glue in {base}",
        f"{base} paper glue", f"{base} school {noun}",
    )  # fmt: skip
    if kind == "stick":
        shapes, grasps = _glue_stick(base, tip, rx), build.round_grasps(2 * rx, 0.090, 1.0)
    else:
        shapes, z = _glue_bottle(base, tip, rx, ry), 0.110
        grasps = (
            build.top_grasp((0.0, 0.0, z), 2 * ry, math.pi / 2, 0.8),
            build.top_grasp((0.0, 0.0, z), 2 * rx, 0.0, 0.8),
        )
    return build.model("glue", shapes, "glue", phrases, grasps, mass=0.01)


def _glue_stick(base: str, cap: str, r: float) -> list[Shape]:
    h = 0.155
    body, stick = r - 0.0025, r - 0.0045
    dial = [(0.0, 0.0), (r, 0.0), (r, 0.020), (body, 0.020)]
    tube = [(body, 0.020), (body, 0.096), (stick, 0.096)]
    lid = [(r, 0.108), (r, h - 0.008), (r - 0.004, h - 0.001), (0.0, h - 0.001)]
    return [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(tube, 14, False), colour(base)),
        *(visual(m.lathe(end, 14, False), colour(cap)) for end in (dial, lid)),
        visual(m.lathe([(stick, 0.096), (stick, 0.110)], 14, False), build.PAPER),
        visual(m.lathe([(body + 0.0003, 0.034), (body + 0.0003, 0.080)], 14, False), build.PAPER),
        visual(around(_drop(0.020), r - 0.0012, 0.056), srgb("#c8202a")),
        *(build.outline(m.lathe([(r, 0.0), (r, h)], n)) for n in (12, 14)),
    ]


def _glue_bottle(base: str, tip: str, rx: float, ry: float) -> list[Shape]:
    h, wall, shoulder = 0.193, 0.126, 0.144
    levels = [(rx, ry, 0.0), (rx, ry, wall), (0.7 * rx, 0.75 * ry, shoulder - 0.004)]
    levels += [(0.013, 0.013, shoulder)]
    nozzle = [(0.0140, shoulder - 0.001), (0.0140, shoulder + 0.010), (0.0085, shoulder + 0.016)]
    nozzle += [(0.0035, h)]
    label = m.rounded_rectangle(0.62 * rx, 0.036, 0.006)
    sides = [m.upright(label, (0.0, s * (ry + 0.0006), 0.066), s * math.pi / 2) for s in (-1, 1)]
    drop = _drop(0.021)
    signs = [m.upright(drop, (0.0, s * (ry + 0.0011), 0.066), s * math.pi / 2) for s in (-1, 1)]
    panel = colour("blue") if base == "white" else build.PAPER
    return [
        collision(m.pillow(levels[:3], 12, 0.7)),
        collision(Cylinder(0.009, (h - shoulder) / 2), (0.0, 0.0, (h + shoulder) / 2)),
        visual(m.pillow(levels, 16, 0.7), colour(base)),
        visual(m.lathe(nozzle, 10), colour(tip)),
        visual(m.merge(*sides), panel),
        visual(m.merge(*signs), build.PAPER if base == "white" else colour("red")),
    ]


def _drop(size: float) -> list[m.Point]:
    ring = [(0.0, 1.1), (-0.45, 0.3), (-0.62, -0.25), (-0.42, -0.75), (0.0, -0.95)]
    ring += [(0.42, -0.75), (0.62, -0.25), (0.45, 0.3)]
    return [(u * size, v * size) for u, v in ring]


ASSETS = build.library(
    (sauce_can, SAUCES), (can, CANS), (bottle, BOTTLES), (pill_bottle, PILLS), (glue, GLUES),
)  # fmt: skip
