"""Upright round packages: `sauce_can`, `can`, `bottle`, `pill_bottle` and `glue`."""

from __future__ import annotations

import math

from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import (
    PAPER,
    STEEL,
    Asset,
    collision,
    colour,
    fill_phrases,
    model,
    round_grasps,
    srgb,
    top_grasp,
    visual,
)
from robospa.tasks.shapes import Cylinder, Mesh, ObjectModel, Params, Shape

THIRDS = (-math.pi / 2, math.pi / 6, 5 * math.pi / 6)
"""Three directions about z, the first to the front."""


def around(polygon: m.Polygon, radius: float, height: float) -> Mesh:
    """`polygon` wrapped on a cylinder three times, once in each of `THIRDS`."""
    return m.merge(*(m.decal(polygon, radius, height, a) for a in THIRDS))


SAUCES = (
    ("red", "#f6f4ec", "#c8201c", "tomato sauce", "red"),
    ("green", "#f6f4ec", "#2f8f33", "pesto", "green"),
    ("yellow", "#7a2b10", "#f5c816", "mustard sauce", "yellow"),
    ("orange", "#fff3d6", "#d9480f", "curry sauce", "orange"),
    ("brown", "#f2e3bd", "#5a2f14", "gravy", "brown"),
)


def sauce_can(look: int, params: Params) -> ObjectModel:
    """A short tin with a paper label, a round picture and a pull ring on its lid."""
    base, field, mark, content, word = SAUCES[look]
    r, h = 0.030, 0.072
    rim = [(r - 0.002, 0.0), (r, 0.001), (r, 0.004), (r - 0.0012, 0.005)]
    rim += [
        (r - 0.0012, h - 0.005),
        (r, h - 0.004),
        (r, h),
        (r - 0.0025, h),
        (r - 0.0025, h - 0.003),
    ]
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(rim, 16), STEEL, roughness=0.3, metallic=0.5),
        visual(m.lathe([(r, 0.008), (r, h - 0.008)], 16, False), colour(base), roughness=0.6),
        visual(around(m.ellipse(0.020, 0.019, 12), r + 0.0006, h / 2), srgb(field)),
        visual(around(m.ellipse(0.0125, 0.0115, 10), r + 0.0013, h / 2 - 0.002), srgb(mark)),
        visual(around(_sprig(), r + 0.0017, h / 2 + 0.008), colour("green")),
        visual(_pull_ring(0.010, h - 0.0024), srgb("#8d9298"), roughness=0.3, metallic=0.4),
    ]
    phrases = fill_phrases(
        word, "{} sauce can", "{} tin of sauce", "can of sauce with a {} label", "{} sauce tin",
        "sauce can wrapped in {}", "{}-labelled can of sauce",
    )  # fmt: skip
    phrases += (f"{word} can of {content}",)
    grasps = round_grasps(2 * r, 0.042, 0.9)
    return model("sauce_can", parts, "sauce can", phrases, grasps, 0.08, support=(0.0, 0.0, h))


def _sprig() -> list[m.Point]:
    return [(0.0, 0.0055), (-0.0012, 0.001), (-0.006, 0.0028), (-0.002, -0.002), (0.0, -0.0035),
            (0.002, -0.002), (0.006, 0.0028), (0.0012, 0.001)]  # fmt: skip


def _pull_ring(size: float, z: float) -> Mesh:
    ring = m.tube([(size * x, size * 1.25 * y, z) for x, y in m.ellipse(1, 1, 9)], 0.0014, 4, True)
    return m.merge(ring, m.flat(m.ellipse(0.003, 0.003, 6), z + 0.0015, (0.0, size * 0.95)))


CANS = (
    ("red", "white", "wave"), ("blue", "silver", "star"), ("green", "yellow", "bubbles"),
    ("orange", "white", "bubbles"), ("black", "gold", "star"), ("purple", "pink", "wave"),
)  # fmt: skip


def can(look: int, params: Params) -> ObjectModel:
    """A slim drink can with necked ends, a pull tab and a printed sign."""
    base, mark, sign = CANS[look]
    r, h = 0.027, 0.098
    body = [(r - 0.001, 0.009), (r, 0.012), (r, h - 0.015), (r - 0.001, h - 0.012)]
    bottom = [(r - 0.007, 0.0), (r - 0.005, 0.001), (r - 0.001, 0.009)]
    top = [(r - 0.001, h - 0.012), (r - 0.0055, h - 0.003), (r - 0.005, h), (r - 0.0068, h)]
    top += [(r - 0.0075, h - 0.003)]
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(body, 16, False), colour(base), roughness=0.35, metallic=0.2),
        visual(m.merge(m.lathe(bottom, 16), m.lathe(top, 16)), STEEL, roughness=0.3, metallic=0.5),
        visual(_sign(sign, r, h), colour(mark), roughness=0.4),
        visual(_tab(h - 0.0026), srgb("#7f858c"), roughness=0.3, metallic=0.4),
    ]
    phrases = fill_phrases(
        base, "{} drink can", "{} soda can", "can in {}", "{} can", "{} beverage can",
        "{} aluminium can", "can of soda with a {} body",
    )  # fmt: skip
    return model(
        "can", parts, "can", phrases, round_grasps(2 * r, 0.058, 1.2), 0.06,
        press=(0.0, 0.0, h), support=(0.0, 0.0, h),
    )  # fmt: skip


def _sign(sign: str, r: float, h: float) -> Mesh:
    """The print on a drink can."""
    if sign == "star":
        return around(m.star(0.021, 0.0095), r + 0.0012, h / 2)
    if sign == "bubbles":
        dots = [(0.0, 0.012, 0.011), (-0.012, -0.006, 0.007), (0.011, -0.012, 0.008)]
        return m.merge(
            *(
                m.decal(m.ellipse(s, s, 8), r + 0.0008, h / 2 + v, a + u / r)
                for a in THIRDS
                for u, v, s in dots
            )
        )
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
    ("#2f8f4a", "yellow", "white", "green", "yellow label", 0.0255),
    ("#7fbfe6", "blue", "blue", "light blue", "blue label", 0.0245),
    ("#4a1d0c", "red", "red", "brown", "red label", 0.0250),
    ("#f39a2d", "white", "orange", "orange", "white label", 0.0260),
)


def bottle(look: int, params: Params) -> ObjectModel:
    """A standing drink bottle with shoulder, neck, screw cap and a wrapped label."""
    glass, label, cap, word, detail, r = BOTTLES[look]
    h = 0.136
    body = [(r - 0.003, 0.0), (r, 0.003), (r, 0.078), (r * 0.82, 0.093), (0.0105, 0.108)]
    body += [(0.0095, 0.122)]
    parts = [
        collision(Cylinder(r, 0.042), (0.0, 0.0, 0.042)),
        collision(m.lathe([(r * 0.95, 0.084), (0.0125, 0.107)], 10)),
        collision(Cylinder(0.01225, 0.0155), (0.0, 0.0, h - 0.0155)),
        visual(m.lathe(body, 16), srgb(glass), roughness=0.15),
        visual(m.lathe([(r + 0.0004, 0.028), (r + 0.0004, 0.068)], 16, False), colour(label)),
        visual(around(m.ellipse(0.0105, 0.0135, 10), r + 0.0011, 0.048), _emblem(label)),
        visual(_cap(0.0122, 0.118, h), colour(cap), roughness=0.4),
    ]
    phrases = fill_phrases(
        word, "{} bottle", "{} drink bottle", "bottle in {}", "{} plastic bottle",
        "{} bottle with a cap", "tall {} bottle",
    )  # fmt: skip
    phrases = (*phrases[:4], f"{word} bottle with a {detail}", *phrases[4:])
    grasps = [*round_grasps(2 * r, 0.076, 1.2), *round_grasps(0.0245, 0.121, 0.9)]
    top = (0.0, 0.0, h)
    return model("bottle", parts, "bottle", phrases, grasps, 0.06, support=top)


def _emblem(label: str) -> tuple[float, float, float]:
    return colour("red") if label == "white" else PAPER if label != "yellow" else colour("green")


def _cap(radius: float, low: float, high: float) -> Mesh:
    profile = [(radius, low), (radius, high - 0.001), (radius - 0.001, high)]
    return m.lathe(profile, 12)


PILLS = (
    ("#e8780f", "white", "orange"), ("#f2f2ee", "blue", "white"), ("#6a3413", "white", "brown"),
    ("#2f9a4c", "white", "green"), ("#2b62c9", "white", "blue"),
)  # fmt: skip


def pill_bottle(look: int, params: Params) -> ObjectModel:
    """A stubby medicine bottle with a wide ribbed cap and a white label."""
    shell, cap, word = PILLS[look]
    r, h = 0.0215, 0.070
    body = [(r - 0.0015, 0.0), (r, 0.0015), (r, 0.047), (r * 0.84, 0.054)]
    label = srgb("#cfe0f4") if word == "white" else PAPER
    cross = m.rectangle(0.0024, 0.0075), m.rectangle(0.0075, 0.0024)
    print_color = srgb("#c8202a") if word != "orange" else srgb("#1f55c4")
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(body, 16), srgb(shell), roughness=0.2),
        visual(m.lathe([(r + 0.0004, 0.009), (r + 0.0004, 0.030)], 16, False), label),
        visual(m.merge(*(around(c, r + 0.0009, 0.0195) for c in cross)), print_color),
        visual(_ribbed(r - 0.0022, 0.053, h), colour(cap), roughness=0.5),
    ]
    phrases = fill_phrases(
        word, "{} pill bottle", "{} medicine bottle", "{} bottle of pills", "pill bottle in {}",
        "small {} medicine bottle", "{} pill container",
    )  # fmt: skip
    phrases = (*phrases, f"{word} pill bottle with a {cap} cap")
    grasps = round_grasps(2 * r, 0.042, 1.0)
    return model("pill_bottle", parts, "pill bottle", phrases, grasps, 0.05, support=(0.0, 0.0, h))


def _ribbed(radius: float, low: float, high: float) -> Mesh:
    """A cap whose rim is notched."""
    n = 24
    rim = [
        (radius * s * math.cos(2 * math.pi * i / n), radius * s * math.sin(2 * math.pi * i / n))
        for i in range(n)
        for s in ((1.0, 0.94)[i % 2],)
    ]
    disc = [(x * 0.93, y * 0.93) for x, y in rim]
    rings = [(rim, low), (rim, high - 0.001), (disc, high)]
    return m.loft([[(x, y, z) for x, y in ring] for ring, z in rings])


GLUES = (
    ("white", "orange", "bottle", "white glue bottle with an orange tip"),
    ("yellow", "black", "stick", "yellow glue stick with a black cap"),
    ("blue", "white", "stick", "blue glue stick with a white cap"),
    ("red", "white", "bottle", "red glue bottle with a white tip"),
)


def glue(look: int, params: Params) -> ObjectModel:
    """A glue stick (cylinder with cap) or a squeeze bottle with a pointed nozzle."""
    base, tip, kind, extra = GLUES[look]
    shapes, width, z, tilt = _glue_stick(base, tip) if kind == "stick" else _glue_bottle(base, tip)
    noun = f"glue {kind}"
    phrases = (
        f"{base} {noun}", extra, f"{base} glue", f"{noun} in {base}", f"{kind} of glue in {base}",
        f"{base} paper glue", f"small {base} {noun}",
    )  # fmt: skip
    if kind == "stick":
        grasps = round_grasps(width, z, tilt)
    else:
        grasps = (
            top_grasp((0.0, 0.0, z), width, math.pi / 2, tilt),
            top_grasp((0.0, 0.0, z), 0.046),
        )
    return model("glue", shapes, "glue", phrases, grasps, mass=0.04)


def _glue_stick(base: str, cap: str) -> tuple[list[Shape], float, float, float]:
    r, h = 0.0145, 0.082
    profile = [(r, 0.0), (r, 0.007), (r - 0.0015, 0.0075), (r - 0.0015, 0.054)]
    label = around(m.rectangle(0.0085, 0.014), r - 0.0007, 0.030)
    drop = around(_drop(0.0075), r - 0.0001, 0.030)
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(profile, 14), colour(base)),
        visual(_cap(r, 0.053, h), colour(cap)),
        visual(label, PAPER),
        visual(drop, srgb("#c8202a") if base != "red" else srgb("#1f55c4")),
    ]
    return parts, 2 * r, 0.048, 1.0


def _glue_bottle(base: str, tip: str) -> tuple[list[Shape], float, float, float]:
    rx, ry = 0.023, 0.015
    levels = ((rx, ry, 0.0), (rx, ry, 0.052), (rx * 0.75, ry * 0.8, 0.063), (0.009, 0.009, 0.066))
    nozzle = [(0.0095, 0.065), (0.0095, 0.074), (0.0055, 0.078), (0.0028, 0.098)]
    label = m.rounded_rectangle(0.015, 0.017, 0.004)
    sides = [m.upright(label, (0.0, s * (ry + 0.0006), 0.029), s * math.pi / 2) for s in (-1, 1)]
    signs = [
        m.upright(_drop(0.011), (0.0, s * (ry + 0.0011), 0.029), s * math.pi / 2) for s in (-1, 1)
    ]
    panel = colour("blue") if base == "white" else PAPER
    parts = [
        collision(m.pillow(levels[:3], 12, 0.7)),
        collision(Cylinder(0.006, 0.0175), (0.0, 0.0, 0.0805)),
        visual(m.pillow(levels, 16, 0.7), colour(base)),
        visual(m.lathe(nozzle, 10), colour(tip)),
        visual(m.merge(*sides), panel),
        visual(m.merge(*signs), PAPER if base == "white" else colour("red")),
    ]
    return parts, 2 * ry, 0.036, 0.8


def _drop(size: float) -> list[m.Point]:
    ring = [(0.0, 1.1), (-0.45, 0.3), (-0.62, -0.25), (-0.42, -0.75), (0.0, -0.95)]
    ring += [(0.42, -0.75), (0.62, -0.25), (0.45, 0.3)]
    return [(u * size, v * size) for u, v in ring]


ASSETS = {
    "sauce_can": Asset(len(SAUCES), sauce_can),
    "can": Asset(len(CANS), can),
    "bottle": Asset(len(BOTTLES), bottle),
    "pill_bottle": Asset(len(PILLS), pill_bottle),
    "glue": Asset(len(GLUES), glue),
}
