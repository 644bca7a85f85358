"""Things with a door: the `microwave`.

Its door hangs on the left, as seen from the robot, and opens towards the robot by its handle on the
right; inside are pale walls and a glass turntable. Body and door are boxes that a gripper feels.
There are two sizes, with the housing, hinge and handle of the two official models.
"""

import math
from dataclasses import dataclass, replace

from robospa.geometry import Pose, Vec3, look_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import colour, solid, srgb, visual
from robospa.tasks.shapes import Box, Color, Cylinder, Hinge, ObjectModel, Params, Shape

MICROWAVES = (
    ("#eceae4", "#26282c", "white", 0.0), ("#1f2024", "#3a3d44", "black", 0.0),
    ("#c3202a", "#f2e3bd", "red", 0.0), ("#b4b9be", "#26282c", "silver", 0.45),
    ("#6fb1dc", "#f6f4ec", "light blue", 0.0), ("#e0b21e", "#26282c", "yellow", 0.0),
)  # fmt: skip
"""Housing, control panel, word, metallic. Every other look is of the other size."""


@dataclass(frozen=True)
class Oven:
    """One size of microwave: planes of its body, door and handle [m], front towards -y.

    The door lies between `front` and `behind` and ends at `panel`, where the controls begin.
    """

    left: float
    right: float
    front: float
    behind: float
    back: float
    foot: float
    top: float
    panel: float
    hinge: tuple[float, float]
    """x and y of the door's axis."""
    bar: tuple[float, float]
    """x and y of the handle's middle."""
    bar_half: tuple[float, float]
    """Half of the handle's width and depth."""
    bar_ends: tuple[float, float]
    """Heights of the handle's ends."""
    held: float
    """Height at which it is taken."""


OVENS = (
    Oven(
        left=-0.1142, right=0.1193, front=-0.0774, behind=-0.0631, back=0.0851,
        foot=0.006, top=0.1396, panel=0.0685, hinge=(-0.1084, -0.0634),
        bar=(0.0571, -0.0911), bar_half=(0.0036, 0.0035), bar_ends=(0.0228, 0.1254), held=0.0743,
    ),
    Oven(
        left=-0.0996, right=0.0981, front=-0.0876, behind=-0.0797, back=0.1002,
        foot=0.004, top=0.1334, panel=0.0534, hinge=(-0.0965, -0.0822),
        bar=(0.0487, -0.0973), bar_half=(0.0050, 0.0025), bar_ends=(0.0120, 0.1220), held=0.0722,
    ),
)  # fmt: skip
"""The official models 7167 and 7310, from their bounding boxes, joints, contact points and sampled
surfaces; the second one's handle is a bow, here as far from the door as the bow's middle."""
WALL = 0.009
LIMIT = math.radians(90)
"""How far the door opens."""


def microwave(look: int, params: Params) -> ObjectModel:
    """A small microwave oven, closed; see the module's docstring."""
    housing, trim, word, metallic = MICROWAVES[look]
    oven = OVENS[look % len(OVENS)]
    paints = (srgb(housing), metallic)
    parts = [*_housing(oven, *paints), *_inside(oven), *_controls(oven, srgb(trim))]
    hinge = Hinge(
        shapes=(*_door(oven, *paints), *_handle(oven, metallic)),
        point=(*oven.hinge, 0.0),
        axis=(0.0, 0.0, -1.0),
        upper=LIMIT,
        friction=0.05,
        damping=0.08,
        mass=0.01,
    )
    phrases = build.fill_phrases(
        word, "{} microwave", "{} microwave oven", "microwave in {}", "small {} microwave",
        "{} kitchen microwave", "microwave with a {} housing",
    )  # fmt: skip
    top = (0.0, 0.0, oven.top)
    made = build.model("microwave", parts, "microwave", phrases, support=top, hinge=hinge)
    handle = Pose((*oven.bar, oven.held), look_rotation((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    return build.with_frames(made, handle=handle)


def _box(
    x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]
) -> tuple[Box, Vec3]:
    (a, b), (c, d), (e, f) = x, y, z
    return Box(((b - a) / 2, (d - c) / 2, (f - e) / 2)), ((a + b) / 2, (c + d) / 2, (e + f) / 2)


def _housing(oven: Oven, color: Color, metallic: float) -> list[Shape]:
    """Floor, top, sides and back around the cavity, the block behind the panel, feet, vents."""
    wide, deep = (oven.left, oven.panel), (oven.behind, oven.back)
    high = (oven.foot, oven.top)
    boxes = (
        _box(wide, deep, (oven.foot, oven.foot + WALL)),
        _box(wide, deep, (oven.top - WALL, oven.top)),
        _box((oven.left, oven.left + WALL), deep, high),
        _box(wide, (oven.back - WALL, oven.back), high),
        _box((oven.panel, oven.right), (oven.front, oven.back), high),
    )
    shell = [solid(box, color, at, roughness=0.35, metallic=metallic) for box, at in boxes]
    feet = [
        solid(Cylinder(0.008, oven.foot / 2), build.DARK, (x, y, oven.foot / 2))
        for x in (oven.left + 0.025, oven.right - 0.025)
        for y in (oven.behind + 0.015, oven.back - 0.02)
    ]
    x = oven.panel + 0.28 * (oven.right - oven.panel)
    slits = [m.flat(m.rectangle(0.018, 0.0014, x, 0.012 + 0.009 * i), 0.0) for i in range(5)]
    vents = visual(m.merge(*slits), srgb("#3a3d44"), (0.0, 0.0, oven.top + 0.0004))
    return [*shell, *feet, vents]


def _inside(oven: Oven) -> list[Shape]:
    pale, left, right = srgb("#e9e6da"), oven.left + WALL, oven.panel
    middle, half = (left + right) / 2, (right - left) / 2
    low, high = oven.foot + WALL, oven.top - WALL
    rear = oven.back - WALL
    centre, deep = (oven.behind + rear) / 2, (rear - oven.behind) / 2 - 0.001
    tall, z = (high - low) / 2, (low + high) / 2
    side = m.rectangle(deep, tall)
    lining = m.merge(
        m.flat(m.rectangle(half, deep, middle, centre), low + 0.0003),
        m.upright(m.rectangle(half, tall), (middle, rear - 0.0003, z)),
        m.upright(side, (left + 0.0003, centre, z), 0.0),
        m.upright(side, (right - 0.0003, centre, z), math.pi),
    )
    plate = m.lathe([(0.052, 0.0), (0.056, 0.004), (0.053, 0.005), (0.0, 0.002)], 24)
    return [
        visual(lining, pale, roughness=0.6),
        visual(plate, srgb("#9cc4d8"), (middle, centre, low + 0.002), roughness=0.15),
        visual(Cylinder(0.012, 0.002), srgb("#6d7f8a"), (middle, centre, low + 0.0052)),
    ]


def _controls(oven: Oven, trim: Color) -> list[Shape]:
    x, half = (oven.panel + oven.right) / 2 + 0.001, (oven.right - oven.panel) / 2 - 0.004
    front, top = oven.front, oven.top
    dark_panel = sum(trim) < 0.6
    plate = m.upright(m.rectangle(half, top / 2 - 0.012), (x, front - 0.0006, top / 2 + 0.003))
    display = m.upright(m.rectangle(half - 0.004, 0.010), (x, front - 0.0010, top - 0.022))
    digits = [
        m.upright(m.rectangle(0.0018, 0.0052), (x + u, front - 0.0014, top - 0.022))
        for u in (-0.0105, -0.005, 0.005, 0.0105)
    ]
    keys = [
        m.upright(m.rectangle(0.0045, 0.0042), (x + u, front - 0.0010, top - z))
        for u in (-0.012, 0.0, 0.012)
        for z in (0.043, 0.055)
    ]
    ink = srgb("#c9ced4") if dark_panel else srgb("#5a5f66")
    dial = m.lathe([(0.0145, 0.0), (0.0135, 0.009), (0.0, 0.0095)], 20)
    return [
        visual(plate, trim, roughness=0.3),
        visual(display, srgb("#101418"), roughness=0.2),
        visual(m.merge(*digits), srgb("#35e07a")),
        visual(m.merge(*keys), ink),
        visual(dial, build.STEEL, (x, front, 0.042), build.ALONG_Y, 0.3, 0.3),
        visual(m.upright(m.rectangle(0.0015, 0.006), (x, front - 0.0102, 0.048)), srgb("#c8202a")),
    ]


def _door(oven: Oven, color: Color, metallic: float) -> list[Shape]:
    deep, tall = (oven.front, oven.behind), (oven.foot, oven.top)
    box, at = _box((oven.left, oven.panel - 0.001), deep, tall)
    right = oven.bar[0] - 0.012
    wide, high = (right - oven.left - 0.014) / 2, box.half[2] - 0.020
    window = m.rounded_rectangle(wide, high, 0.008)
    glint = [(-0.035, -0.026), (-0.020, -0.026), (0.015, 0.026), (0.0, 0.026)]
    x, z = right - wide, at[2]
    dark = srgb("#14171b")
    return [
        solid(box, color, at, roughness=0.35, metallic=metallic),
        visual(m.upright(window, (x, oven.front - 0.0005, z)), dark, roughness=0.1),
        visual(m.upright(glint, (x, oven.front - 0.0009, z)), srgb("#2c343c"), roughness=0.1),
        visual(m.upright(window, (x, oven.behind + 0.0005, z), math.pi / 2), srgb("#1c2024")),
    ]


def _handle(oven: Oven, metallic: float) -> list[Shape]:
    (x, y), (wide, deep), (low, high) = oven.bar, oven.bar_half, oven.bar_ends
    half = (high - low) / 2
    profile = [(0.0, -half), (1.0, -half + 0.002), (1.0, half - 0.002), (0.0, half)]
    turned = m.lathe(profile, 14, False)
    color = colour("silver") if metallic == 0.0 else build.DARK
    (bar,) = build.stretched([solid(turned, color, roughness=0.3)], wide, deep, 1.0)
    posts = [
        _box((x - wide, x + wide), (y, oven.front), (end - 0.004, end + 0.004))
        for end in (low + 0.004, high - 0.004)
    ]
    return [
        replace(bar, pose=Pose((x, y, (low + high) / 2))),
        *(solid(box, build.DARK, at) for box, at in posts),
    ]


ASSETS = build.library((microwave, MICROWAVES))
