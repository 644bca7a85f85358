"""Things of a desk: `stapler`, `seal` (a stamp), `mouse` (of a computer), `bell` and `fan`."""

import math
from collections.abc import Sequence

from robospa.geometry import Pose, axis_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.shapes import Box, Cylinder, Mesh, ObjectModel, Params, Shape

STAPLERS = (
    ("red", "black"), ("blue", "black"), ("black", "grey"), ("green", "white"),
    ("yellow", "black"), ("white", "navy"), ("purple", "silver"),
)  # fmt: skip
STAPLER_SIZES = (
    (0.0229, 0.0964, 0.0483), (0.0297, 0.0959, 0.0422), (0.0236, 0.0962, 0.0418),
    (0.0171, 0.0965, 0.0465), (0.0331, 0.0965, 0.0505), (0.0204, 0.0965, 0.0356),
    (0.0373, 0.0968, 0.0374),
)  # fmt: skip
"""Official width, length and height [m] of each look."""
STAPLER_PRESS = (0.0350, 0.0325, 0.0279, 0.0362, 0.0161, 0.0320, 0.0340)
"""How far towards the head from its middle each is pressed (official) [m]."""


def stapler(look: int, params: Params) -> ObjectModel:
    """A desk stapler along y, its pressing head towards -y."""
    top, base = STAPLERS[look]
    w = 0.0118
    arm = [(-0.0405, 0.0225), (-0.034, 0.0195), (0.030, 0.0140), (0.0405, 0.0140)]
    arm += [(0.0405, 0.0250), (0.033, 0.0335), (0.004, 0.0385), (-0.035, 0.0385), (-0.0405, 0.0345)]
    rail = [(-0.0385, 0.0155), (0.030, 0.0095), (0.030, 0.0145), (-0.0345, 0.0200)]
    rail += [(-0.0385, 0.0200)]
    ridge = m.prism(m.rectangle(0.0072, 0.0011), 0.0, 0.0009)
    ridges = [m.moved(ridge, (0.0, -0.036 + 0.0042 * i, 0.0384)) for i in range(4)]
    stripe = m.flat(m.rectangle(0.0016, 0.0135, 0.0, -0.006), 0.0390)
    axle = Cylinder(0.0048, 0.0128)
    parts = [
        collision(Box((w, 0.0412, 0.0035)), (0.0, 0.0, 0.0035)),
        collision(m.side_prism(arm, w)),
        collision(Box((w, 0.006, 0.008)), (0.0, 0.033, 0.013)),
        visual(m.slab(0.0124, 0.0415, 0.0075, 0.005, 0.0015), colour(base), roughness=0.5),
        visual(m.side_prism(rail, 0.0078), build.STEEL, roughness=0.3, metallic=0.5),
        visual(_rounded_arm(arm, w), colour(top), roughness=0.3),
        visual(m.merge(*ridges, stripe), colour(base) if base != "black" else srgb("#3a3c42")),
        visual(m.prism(m.rectangle(0.0062, 0.0045, 0.0, -0.034), 0.0074, 0.0084), build.STEEL),
        visual(axle, build.STEEL, (0.0, 0.0345, 0.0165), build.ALONG_X, 0.3, 0.4),
    ]
    phrases = build.fill_phrases(
        top, "{} stapler", "stapler with a {} top", "{} desk stapler", "stapler in {}",
        "{} paper stapler", "{} office stapler", "small {} stapler",
    )  # fmt: skip
    made = build.fitted(parts, STAPLER_SIZES[look])
    width = 2 * w * made.factors[0]
    grasps = tuple(build.top_grasp(made.at(0.0, y, 0.022), width) for y in (0.0, 0.012))
    _, _, top_z = made.at(0.0, 0.0, 0.0385)
    return build.model(
        "stapler", made.shapes, "stapler", phrases, grasps,
        press=(0.0, -STAPLER_PRESS[look], top_z), support=made.at(0.0, -0.010, 0.0385),
    )  # fmt: skip


def _rounded_arm(profile: m.Polygon, half: float) -> Mesh:
    """The arm with its long upper edges cut: a narrower copy on top of the full one."""
    lower = [(y, min(z, 0.0345 if y < 0.01 else z)) for y, z in profile]
    return m.merge(m.side_prism(lower, half), m.side_prism(profile, half - 0.0028))


SEALS = (
    ("#8a4f24", "#c8202a", "brown", "round", "red"),
    ("#1d1e22", "#1f55c4", "black", "round", "blue"),
    ("#c8202a", "#26282c", "red", "square", "black"),
    ("#e0b878", "#2c9a3f", "tan", "square", "green"),
    ("#1f55c4", "#f2f2ee", "blue", "round", "white"),
    ("#2c9a3f", "#26282c", "green", "square", "black"),
)  # fmt: skip
SEAL_SIZES = (
    (0.0500, 0.0500, 0.0964), (0.0325, 0.0325, 0.0778), (0.0380, 0.0380, 0.0774),
    (0.0350, 0.0270, 0.0772), (0.0520, 0.0520, 0.0774), (0.0380, 0.0380, 0.0774),
)  # fmt: skip
"""Width, depth and official height [m] of each look."""


def seal(look: int, params: Params) -> ObjectModel:
    """A hand stamp: a foot on coloured rubber, a thin neck and a grip with its print on top."""
    wood, edge, word, form, ink = SEALS[look]
    r, h = 0.0235, 0.064
    handle = [(0.0130, 0.0145), (0.0080, 0.020), (0.0080, 0.030), (0.0130, 0.039), (0.0150, 0.047)]
    handle += [(0.0150, 0.059), (0.0135, h - 0.0008), (0.0, h - 0.0008)]
    if form == "round":
        foot = m.lathe([(r, 0.0), (r, 0.008)], 18)
        block = m.lathe([(r - 0.002, 0.008), (r - 0.002, 0.0155)], 18)
        under: Shape = collision(Cylinder(r, 0.0077), (0.0, 0.0, 0.0077))
    else:
        foot = m.slab(r - 0.002, r - 0.002, 0.008, 0.002, 0.0, 2)
        block = m.moved(m.slab(r - 0.004, r - 0.004, 0.0075, 0.003, 0.0, 2), (0.0, 0.0, 0.008))
        under = collision(Box((r - 0.002, r - 0.002, 0.0077)), (0.0, 0.0, 0.0077))
    band = m.lathe([(0.0100, 0.0270), (0.0100, 0.032)], 10, False)
    sign = srgb(edge) if ink != "white" else srgb(wood)
    parts = [
        under,
        collision(Cylinder(0.0085, 0.011), (0.0, 0.0, 0.026)),
        collision(m.lathe([(0.0125, 0.037), (0.0150, 0.043), (0.0150, 0.049), (0.0085, h)], 12)),
        visual(foot, srgb(edge), roughness=0.9),
        visual(block, srgb(wood), roughness=0.4),
        visual(m.lathe(handle, 12, False), srgb(wood), roughness=0.3),
        visual(band, colour("gold"), roughness=0.3, metallic=0.4),
        visual(m.flat(m.ellipse(0.0128, 0.0128, 12), h - 0.0004), build.PAPER, roughness=0.8),
        visual(m.flat(m.star(0.0108, 0.0046), h), sign, roughness=0.8),
    ]
    phrases = build.fill_phrases(
        word, "{} stamp", "{} hand stamp", "{} seal", "stamp with a {} handle", "{} stamper",
        "{} rubber stamp", f"{word} stamp with a {ink} base",
    )  # fmt: skip
    made = build.fitted(parts, SEAL_SIZES[look])
    wide, deep, tall = made.factors
    ways = ((0.0, wide), (math.pi / 2, deep)) if wide != deep else ()
    grasps = tuple(build.top_grasp((0.0, 0.0, 0.046 * tall), 0.030 * f, a) for a, f in ways)
    grasps = grasps or build.round_grasps(0.030 * wide, 0.046 * tall, 0.7)
    return build.model("seal", made.shapes, "seal", phrases, grasps)


MICE = (
    ("#f0f0ec", "#b7bcc2", "white"), ("#26282c", "#4a4d54", "black"), ("#c3202a", "#26282c", "red"),
    ("#2257bd", "#d5d9de", "blue"), ("#8c9197", "#26282c", "grey"),
)  # fmt: skip
MOUSE_SIZES = (
    (0.0437, 0.0876, 0.0266), (0.0445, 0.0781, 0.0314), (0.0680, 0.1250, 0.0504),
    (0.0437, 0.0876, 0.0266), (0.0445, 0.0781, 0.0314),
)  # fmt: skip
"""Width and official length and height [m] of each look."""


def mouse(look: int, params: Params) -> ObjectModel:
    """A wireless computer mouse, its buttons towards +y (away from the hand's heel)."""
    shell, detail, word = MICE[look]
    levels = (
        (0.0185, 0.0345, 0.0), (0.0205, 0.0375, 0.004), (0.0200, 0.0365, 0.011),
        (0.0180, 0.0330, 0.018), (0.0135, 0.0255, 0.0235), (0.0075, 0.0150, 0.026),
    )  # fmt: skip
    body = m.pillow(levels, 16, 0.85)
    belt = m.pillow([(0.0207, 0.0377, 0.0045), (0.0203, 0.0370, 0.0085)], 16, 0.85)
    parts = [
        collision(m.pillow(levels[:5], 14, 0.85)),
        visual(body, srgb(shell), roughness=0.35),
        visual(belt, srgb(detail), roughness=0.5),
        visual(m.merge(*_seams(levels)), srgb(detail)),
        visual(Cylinder(0.0052, 0.0024), build.DARK, (0.0, 0.020, 0.0215), build.ALONG_X),
    ]
    phrases = build.fill_phrases(
        word, "{} computer mouse", "{} mouse", "mouse in {}", "{} wireless mouse",
        "computer mouse with a {} shell", "{} PC mouse",
    )  # fmt: skip
    made = build.fitted(parts, MOUSE_SIZES[look])
    width = made.factors[0]
    grasps = (
        build.top_grasp(made.at(0.0, 0.0, 0.010), 0.0405 * width, 0.0, 0.6),
        build.top_grasp(made.at(0.0, -0.006, 0.010), 0.040 * width, 0.0, 0.6),
    )
    return build.model("mouse", made.shapes, "computer mouse", phrases, grasps)


def _seams(levels: Sequence[tuple[float, float, float]]) -> list[Mesh]:

    def height(x: float, y: float) -> float:
        inside = [
            (max(abs(x) / rx, abs(y) / ry, math.hypot(x / rx, y / ry) * 0.97), z)
            for rx, ry, z in levels
        ]
        fits = [(s, z) for s, z in inside if s <= 1]
        if len(fits) == len(levels):
            return levels[-1][2]
        s1, z1 = max(fits, key=lambda p: p[1])
        s2, z2 = min((p for p in inside if p[1] > z1), key=lambda p: p[1])
        return z1 + (z2 - z1) * (1 - s1) / (s2 - s1)

    strips = []
    long = [(0.0, -0.001 + 0.0045 * i) for i in range(8)]
    wide = [(-0.017 + 0.034 * i / 8, -0.001) for i in range(9)]
    for line, dx, dy in ((long, 0.0007, 0.0), (wide, 0.0, 0.0007)):
        points = []
        for x, y in line:
            z = height(x, y) + 0.0006
            points += [(x - dx, y + dy, z), (x + dx, y - dy, z)]
        strips.append(m.strip(points))
    return strips


BELLS = (
    ("#cfd3d8", "#1c1c20", "silver", "black", 0.55), ("#d9a62a", "#5a3216", "gold", "brown", 0.45),
    ("#c8202a", "#1c1c20", "red", "black", 0.0), ("#2257bd", "#d5d9de", "blue", "silver", 0.0),
)  # fmt: skip
BELL_SIZES = ((0.0780, 0.0676), (0.0734, 0.0530), (0.0780, 0.0676), (0.0734, 0.0530))
"""Diameter and official height [m] of each look: officially bells stand 8 cm apart."""


def bell(look: int, params: Params) -> ObjectModel:
    """A call bell: a steep round dome over a dark foot, with the button on top.

    Frame "touched": the official contact point, about which a gripper's contacts count.
    """
    dome, foot, word, low, metallic = BELLS[look]
    r, body, h = 0.0462, 0.0350, 0.0676
    shell = [(body, 0.0110), (body, 0.0300), (0.0338, 0.0370), (0.0300, 0.0440)]
    shell += [(0.0225, 0.0500), (0.0120, 0.0536), (0.0040, 0.0546)]
    parts = [
        collision(m.lathe([(r, 0.0), (r, 0.0060), (0.0420, 0.0115)], 20)),
        collision(m.lathe([(body, 0.0100), *shell[1:]], 20)),
        collision(Cylinder(0.0095, 0.0085), (0.0, 0.0, h - 0.0085)),
        visual(m.lathe([(r, 0.0), (r, 0.0060), (0.0420, 0.0115)], 24), srgb(foot), roughness=0.5),
        visual(m.lathe(shell, 24, False), srgb(dome), roughness=0.25, metallic=metallic),
        visual(m.lathe([(0.0055, 0.0530), (0.0055, 0.0600)], 8, False), build.STEEL, roughness=0.3),
        visual(m.lathe([(0.0095, 0.0575), (0.0100, 0.0640), (0.0060, h), (0.0, h)], 14),
               srgb(foot)),
    ]  # fmt: skip
    wide, tall = BELL_SIZES[look]
    made = build.fitted(parts, (wide, wide, tall))
    phrases = build.fill_phrases(
        word, "{} bell", "{} call bell", "{} desk bell", "bell with a {} dome", "{} service bell",
        "{} reception bell", f"{word} bell on a {low} base",
    )  # fmt: skip
    grasps = build.round_grasps(2 * body * made.factors[0], 0.024 * made.factors[2], 0.6)
    bell = build.model("bell", made.shapes, "bell", phrases, grasps, press=(0.0, 0.0, tall))
    touched = (0.0380, 0.0258)[look % 2]
    return build.with_frames(bell, touched=Pose((0.0, 0.0, touched)))


FANS = (
    ("white", "blue"), ("pink", "purple"), ("black", "red"), ("teal", "yellow"),
)  # fmt: skip
FAN_SIZES = (
    (0.1125, 0.0844, 0.1548), (0.1300, 0.1000, 0.1635), (0.1055, 0.0900, 0.1614),
    (0.1200, 0.0900, 0.1476),
)  # fmt: skip
"""Width, depth and official height [m] of each look."""


def fan(look: int, params: Params) -> ObjectModel:
    """A desk fan blowing towards -y: blades in a cage, whose nose and motor show from the side."""
    frame, blade = FANS[look]
    r, z, deep = 0.0540, 0.1010, 0.0140
    foot = [(0.042, 0.0), (0.042, 0.006), (0.014, 0.015)]
    ring = [(r - 0.0050, 0.0), (r, -0.006), (r, 0.006)]
    nose = [(0.013, -0.006), (0.013, 0.013), (0.008, 0.022), (0.0, 0.023)]
    motor = [(0.0, -0.038), (0.011, -0.036), (0.017, -0.028), (0.017, -0.008)]
    cage = []
    for end in (-0.022, 0.019):
        wires = [((0.052 * c, 0.052 * s, 0.2 * end), (0.012 * c, 0.012 * s, end))
                 for c, s in m.ellipse(1.0, 1.0, 8, 0.2)]  # fmt: skip
        cage.append(m.merge(*(m.tube(wire, 0.0012, 3, caps=False) for wire in wires)))
    frames = ([*ring, ring[0]], 20), (nose, 10), (motor, 10)
    at = (0.0, 0.0, z)
    pale = srgb("#8fa0ad") if frame == "white" else srgb("#eef1f4")
    parts = [
        collision(Cylinder(0.042, 0.0085), (0.0, 0.0, 0.0085)),
        collision(Cylinder(0.011, 0.018), (0.0, 0.0, 0.033)),
        collision(Cylinder(r, deep), at, build.ALONG_Y),
        visual(m.lathe(foot, 22), colour(frame), roughness=0.4),
        visual(m.lathe([(0.009, 0.010), (0.007, 0.050)], 8, False), colour(frame), roughness=0.4),
        visual(m.merge(*(m.lathe(profile, n, False) for profile, n in frames)), colour(frame), at,
               build.ALONG_Y, 0.4),
        visual(cage[0], pale, at, build.ALONG_Y, 0.4),
        visual(_blades(), colour(blade), at, build.ALONG_Y, 0.5),
        visual(cage[1], pale, at, build.ALONG_Y, 0.4),
        visual(m.lathe([(0.006, 0.0), (0.006, 0.003)], 8), colour("red"), (0.0, -0.029, 0.0090)),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        frame, "{} fan", "small {} fan", "{} desk fan", "fan with a {} frame", "{} electric fan",
        "{} table fan", f"{frame} fan with {blade} blades",
    )  # fmt: skip
    made = build.fitted(parts, FAN_SIZES[look])
    thick = 2 * deep * made.factors[1]
    grasps = (build.top_grasp(made.at(0.0, 0.0, z + 0.032), thick, math.pi / 2, 0.8),)
    return build.model("fan", made.shapes, "fan", phrases, grasps, mass=0.01)


def _blades() -> Mesh:
    parts = []
    petal = [(0.006, -0.010), (0.032, -0.031), (0.045, 0.000), (0.038, 0.022), (0.006, 0.008)]
    for i in range(3):
        turn = axis_rotation((0.0, 0.0, 1.0), 2 * math.pi / 3 * i + 0.5)
        twist = m.moved(m.prism(petal, 0.0, 0.0016), rotation=axis_rotation((1.0, 0.0, 0.0), 0.2))
        parts.append(m.moved(twist, (0.0, 0.0, 0.002), turn))
    return m.merge(*parts)


ASSETS = build.library(
    (stapler, STAPLERS), (seal, SEALS), (mouse, MICE), (bell, BELLS), (fan, FANS),
)  # fmt: skip
