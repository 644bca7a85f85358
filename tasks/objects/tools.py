"""Things to work with: `hammer`, `t_block`, `wooden_block`, and `pad`, a flat square to put on."""

import math

from robospa.geometry import Pose
from robospa.tasks.colors import NAMED, nearest
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.boxes import SIDES, on_side
from robospa.tasks.objects.build import collision, colour, solid, srgb, visual
from robospa.tasks.shapes import Box, Mesh, ObjectModel, Params, Shape

HAMMERS = (
    ("black", "tan", "black"), ("red", "tan", "red"), ("brown", "tan", "wooden"),
    ("blue", "yellow", "blue"), ("silver", "black", "metal"), ("green", "grey", "green"),
)  # fmt: skip
HAMMER_STRIKES = 0.0632
"""How far [m] the striking face is from where the handle is held (official points)."""
HAMMER_HANDLE = 0.0514
"""How high [m] the handle is above the striking face (official points)."""
CLAW = (
    (0.0000, 0.0150, -0.020, 0.022, 0.068), (0.0010, 0.0140, -0.013, 0.014, 0.092),
    (0.0040, 0.0135, -0.017, 0.004, 0.116), (0.0070, 0.0128, -0.024, -0.018, 0.1365),
)  # fmt: skip
"""Sections of half a hammer's claw: from x to x, from y to y, and height [m]."""


def hammer(look: int, params: Params) -> ObjectModel:
    """A hammer standing on its striking face, its handle level and towards -y.

    Its head is a thick end to strike with and a claw, up. Frame "head": the middle of the
    face that strikes, where the hammer stands (z up).
    """
    head, shaft, word = HAMMERS[look]
    y, z, h = HAMMER_STRIKES, HAMMER_HANDLE, 0.1365
    hx, hy, thin, neck = 0.0158, 0.0250, 0.0090, 0.074  # half sizes; height of the thick end
    bar, near, far = 0.0068, y - hy, -0.086
    ring = m.rounded_rectangle(hx, hy, 0.006, 3)
    cap = m.rounded_rectangle(hx - 0.0006, hy - 0.0008, 0.0055, 3)
    waist = m.rounded_rectangle(0.7 * hx, 0.7 * hy, 0.004, 2)

    def layer(outline: m.Polygon, low: float, high: float, top: float = 1.0) -> Mesh:
        return m.moved(m.prism(outline, low, high, top), (0.0, y, 0.0))

    claw = [
        m.loft([[(s * a, y + far, at), (s * b, y + far, at), (s * b, y + near, at),
                 (s * a, y + near, at)][::s] for a, b, near, far, at in CLAW])
        for s in (1, -1)
    ]  # fmt: skip

    handle = m.rounded_rectangle(bar, (near - far) / 2 + 0.002, 0.003, 2)
    grip = m.prism(m.rounded_rectangle(bar + 0.0004, 0.026, 0.003, 2), -bar - 0.0004, bar + 0.0004)
    steel = build.STEEL if head != "silver" else build.DARK
    metallic = 0.5 if head == "silver" else 0.0
    middle, up = (near + far) / 2, (h - neck) / 2
    parts = [
        collision(Box((hx, hy, neck / 2)), (0.0, y, neck / 2)),
        collision(Box((hx - 0.003, thin, up)), (0.0, y, neck + up)),
        collision(Box((bar, (near - far) / 2, bar)), (0.0, middle, z)),
        visual(m.merge(layer(ring, 0.036, neck - 0.006), layer(waist, 0.014, 0.036),
                       m.moved(grip, (0.0, far + 0.026, z))),
               colour(head), roughness=0.4, metallic=metallic),
        visual(layer(cap, 0.0, 0.014), steel, roughness=0.4, metallic=0.4),
        visual(m.merge(*claw), steel, roughness=0.4, metallic=0.4),
        visual(m.moved(m.prism(handle, -bar, bar), (0.0, middle, z)), colour(shaft), roughness=0.6),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} hammer", "{} mallet", "{} hammer with a handle", "hammer with a {} head",
        "small {} hammer", "{} hand hammer", f"{word} hammer with a {shaft} handle",
    )  # fmt: skip
    grasps = tuple(build.top_grasp((0.0, at, z), 2 * bar, 0.0, 0.7) for at in (0.0, -0.018, -0.036))
    made = build.model("hammer", parts, "hammer", phrases, grasps, mass=0.035, support=(0.0, y, h))
    return build.with_frames(made, head=Pose((0.0, y, 0.0)))


PADS = (
    *("red", "green", "blue", "yellow", "cyan", "magenta", "black", "gray", "orange", "purple"),
    *("brown", "pink", "lime", "olive", "teal", "maroon", "navy", "coral", "turquoise", "indigo"),
    *("beige", "tan", "silver"),
)
"""The official colours of pads, in the official order: look k is colour k."""


def pad(look: int, params: Params) -> ObjectModel:
    """A flat square on the table; params "half" [m], "color" (linear RGB) and "solid".

    Only drawn unless "solid" is true: what is not solid must be fixed in its scene.
    """
    half = build.three_numbers(params.get("half", (0.035, 0.035, 0.0005)), "pad half sizes")
    color = build.three_numbers(params.get("color", NAMED[PADS[look]]), "pad color")
    if min(half) <= 0:
        raise ValueError(f"pad half sizes must be positive, not {list(half)}")
    word = nearest(color)
    at = Pose((0.0, 0.0, half[2]))
    shape = Shape(Box(half), at, color, collision=bool(params.get("solid")), roughness=0.8)
    phrases = build.fill_phrases(
        word, "{} pad", "{} square", "pad in {}", "flat {} pad", "{} square pad", "{} mat",
    )  # fmt: skip
    grasps = build.box_grasps(half[0], half[1], half[2]) if half[2] > 0.005 else ()
    return build.model("pad", [shape], "pad", phrases, grasps)


TEES = ("red", "blue", "green", "yellow", "orange", "purple")


def t_block(look: int, params: Params) -> ObjectModel:
    """A flat block shaped like a T, its bar towards +y and its stem towards -y.

    Param "kind": 0 has square ends, 1 round ends and a pale dot on its bar; same sizes.
    """
    kind = params.get("kind", 0)
    if kind not in (0, 1):
        raise ValueError(f"t_block kind must be 0 or 1, not {kind!r}")
    word = TEES[look]
    end, arm, h = 0.035, 0.012, 0.030  # half of its length, half a bar's width, height
    low = end - 2 * arm  # where bar and stem meet
    outline = _tee(end, arm, low, round_ends=kind == 1)
    levels = ((0.0, 1.0), (h - 0.0012, 1.0), (h, 0.965))
    body = m.loft([m.ring(outline, z, scale) for z, scale in levels])
    parts = [
        collision(Box((end, arm, h / 2)), (0.0, end - arm, h / 2)),
        collision(Box((arm, (low + end) / 2, h / 2)), (0.0, (low - end) / 2, h / 2)),
        visual(body, colour(word), roughness=0.5),
    ]
    if kind:
        dot = m.flat(m.ellipse(0.0055, 0.0055, 12), h + 0.0004, (0.0, end - arm))
        parts.append(visual(dot, build.PAPER))
    phrases = build.fill_phrases(
        word, "{} T-shaped block", "{} T block", "{} block in the shape of a T",
        "T-shaped {} block",
        "block shaped like a {} T", "{} letter T",
    )  # fmt: skip
    z = 0.017
    grasps = (
        build.top_grasp((0.0, -0.004, z), 2 * arm, 0.0, 0.6),
        build.top_grasp((0.0235, end - arm, z), 2 * arm, math.pi / 2, 0.6),
        build.top_grasp((-0.0235, end - arm, z), 2 * arm, math.pi / 2, 0.6),
    )
    return build.model("t_block", parts, "T-shaped block", phrases, grasps, mass=0.01)


def _tee(end: float, arm: float, low: float, round_ends: bool) -> list[m.Point]:
    foot = [(-arm, -end), (arm, -end)]
    right, left = [(end, low), (end, end)], [(-end, end), (-end, low)]
    if round_ends:
        turns = [math.pi / 6 * i for i in range(7)]
        arc = [(arm * math.sin(t), -arm * math.cos(t)) for t in turns]
        right = [(end - arm + x, end - arm + y) for x, y in arc]
        left = [(arm - end - x, end - arm - y) for x, y in arc]
        foot = [(y, arm - end - x) for x, y in arc]
    return [*foot, (arm, low), *right, *left, (-arm, low)]


WOODS = (
    ("#dcb47c", "#c0935a", "light"), ("#7d4e2a", "#5f381c", "dark"), ("#b8322a", "#dcb47c", "red"),
    ("#2f62b0", "#dcb47c", "blue"), ("#3d8c47", "#dcb47c", "green"),
)  # fmt: skip
WOOD_SIZES = (
    (0.1507, 0.0379, 0.0522), (0.0560, 0.0560, 0.1018), (0.1507, 0.0379, 0.0522),
    (0.0560, 0.0560, 0.1018), (0.1507, 0.0379, 0.0522),
)  # fmt: skip
"""Official length, width and height [m] of each look; wider official blocks fit in no gripper."""


def wooden_block(look: int, params: Params) -> ObjectModel:
    """A toy block of wood with grain on its sides; some are painted on top."""
    paint_code, grain, word = WOODS[look]
    half = (0.0260, 0.0180, 0.0180)
    wood = "#dcb47c" if look > 1 else paint_code
    lines = "#c0935a" if look > 1 else grain
    rows = (-0.0105, -0.0035, 0.0030, 0.0095)
    streaks = [
        on_side(m.rectangle(w * span, 0.0007, 0.0015 * (k % 3 - 1), v), half, side)
        for side in SIDES
        for span in (half[0] if round(math.sin(side)) else half[1],)
        for k, (v, w) in enumerate(zip(rows, (0.8, 0.55, 0.7, 0.45), strict=True))
    ]
    cap = m.moved(m.slab(half[0], half[1], 0.0008, 0.002, 0.0, 2), (0.0, 0.0, 2 * half[2] - 0.0002))
    parts = [
        solid(Box(half), srgb(wood), (0.0, 0.0, half[2]), roughness=0.8),
        visual(m.merge(*streaks), srgb(lines), roughness=0.9),
        visual(cap, srgb(paint_code), roughness=0.6),
    ]
    if look < 2:
        rings = [
            m.flat(m.rectangle(half[0] * w, 0.0007, 0.0, y), 2 * half[2] + 0.0010)
            for y, w in ((-0.009, 0.75), (-0.002, 0.85), (0.006, 0.6))
        ]
        parts.append(visual(m.merge(*rings), srgb(lines), roughness=0.9))
    phrases = build.fill_phrases(
        word, "{} wooden block", "{} toy block of wood", "{} block of wood", "{} piece of wood",
        "wooden block with a {} top", "{} wood block", "{} wooden toy block",
    )  # fmt: skip
    made = build.fitted(parts, WOOD_SIZES[look])
    x, y, z = made.at(*half)
    grasps = build.box_grasps(x, y, 1.1 * z)[::-1]
    return build.model("wooden_block", made.shapes, "wooden block", phrases, grasps)


ASSETS = build.library(
    (t_block, TEES), (wooden_block, WOODS), (hammer, HAMMERS),
    (pad, PADS),
    t_block={"kind"}, pad={"half", "color", "solid"},
)  # fmt: skip
