"""Things that others lean on, stand on or hang from.

`phone_stand`, `display_stand`, `electronic_scale` and `mug_rack`.
"""

import math

from robospa.geometry import Pose, Vec3, axis_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.objects.gadgets import PHONE_LENGTH
from robospa.tasks.shapes import Box, Mesh, ObjectModel, Params

PHONE_STANDS = (
    ("silver", "black"), ("black", "grey"), ("blue", "light blue"), ("pink", "purple"),
    ("green", "dark green"), ("orange", "black"),
)  # fmt: skip
PHONE_STAND_SIZES = (
    (0.0767, 0.1380, 0.1937), (0.0854, 0.1315, 0.1701), (0.0872, 0.1104, 0.1420),
    (0.0800, 0.1036, 0.1266), (0.0710, 0.1278, 0.1542), (0.1080, 0.1100, 0.1542),
)  # fmt: skip
"""Width, depth and official height [m] of each look."""
PHONE_REST = (-0.0336, 0.1146)
"""y and z [m] where a phone's lower end rests on the first look (official functional point)."""
PHONE_SLOPE = 1.097
"""How far a phone on it is tipped from lying flat [rad] (official)."""


def phone_stand(look: int, params: Params) -> ObjectModel:
    """A desk stand: a foot, a stem and a steep back with a lip, on which a phone leans to charge.

    Frame "support": where the body frame of a phone goes, its screen up the slope. Frame "end":
    where its lower end comes to rest.
    """
    body, pad = PHONE_STANDS[look]
    c, s = math.cos(PHONE_SLOPE), math.sin(PHONE_SLOPE)
    wide, thick, long = 0.0280, 0.0035, 0.0885  # half width, half thickness, length of the back
    low_y, low_z = PHONE_REST

    def on_back(along: float, out: float) -> tuple[float, float]:
        """y and z [m] so far up the slope from the rest, and so far out of it."""
        return low_y + along * c - out * s, low_z + along * s + out * c

    def board(low: float, high: float, inner: float, outer: float) -> list[m.Point]:
        ends = ((low, inner), (low, outer), (high, outer), (high, inner))
        return [on_back(along, out) for along, out in ends]

    plate = m.side_prism(board(-0.0060, long, 0.0, -2 * thick), wide)
    lip = m.side_prism(board(-0.0060, 0.0, 0.0150, -2 * thick), wide)
    hooks = [
        m.moved(m.side_prism(board(-0.0060, 0.0130, 0.0190, 0.0130), 0.0085), (x, 0.0, 0.0))
        for x in (0.0085 - wide, wide - 0.0085)
    ]

    def shown(polygon: m.Polygon, out: float) -> Mesh:
        """`polygon` (to the right, up the slope) on the back, `out` [m] in front of it."""
        faces = m.triangulate(polygon)
        return m.mesh([(u, *on_back(0.049 + v, out)) for u, v in polygon], faces)

    bolt = [(0.003, 0.021), (-0.010, -0.004), (-0.001, -0.004), (-0.004, -0.021), (0.010, 0.005),
            (0.001, 0.005), (0.010, 0.021)]  # fmt: skip
    (knee_y, knee_z), (top_y, top_z) = (0.030, 0.010), on_back(0.035, -2 * thick)
    stem = m.tube(
        [(0.0, knee_y, knee_z), (0.0, knee_y + 0.004, 0.085), (0.0, top_y + 0.002, top_z)], 0.009, 8
    )
    parts = [
        collision(Box((0.0383, 0.069, 0.006)), (0.0, 0.0, 0.006)),
        *(collision(part) for part in (plate, lip)),
        collision(Box((0.008, 0.009, 0.045)), (0.0, knee_y + 0.002, 0.055)),
        visual(m.slab(0.0383, 0.069, 0.012, 0.034, 0.003, 5), colour(body), roughness=0.4),
        visual(m.merge(plate, lip), colour(body), roughness=0.4),
        visual(stem, build.STEEL if body != "silver" else build.DARK, roughness=0.3),
        visual(m.merge(*hooks, shown(m.ellipse(0.0255, 0.034, 14), 0.0006)), colour(pad)),
        visual(shown(bolt, 0.0012), build.PAPER),
    ]
    made = build.fitted(parts, PHONE_STAND_SIZES[look])
    _, fy, fz = made.factors
    slope = math.atan2(fz * s, fy * c)
    tilt = axis_rotation((1.0, 0.0, 0.0), slope)
    phrases = build.fill_phrases(
        body, "{} phone stand", "{} phone holder", "{} stand for a phone", "phone stand in {}",
        f"{body} phone stand with a {pad} pad", "{} mobile phone stand", "{} smartphone stand",
    )  # fmt: skip
    rest = (0.0, fy * low_y, fz * low_z)
    at = PHONE_LENGTH / 2 + 0.0015  # the phone's lower end is against the lip
    support = (
        0.0,
        rest[1] + at * math.cos(slope) - 0.0013 * math.sin(slope),
        rest[2] + at * math.sin(slope) + 0.0013 * math.cos(slope),
    )
    grip_y, grip_z = on_back(long - 0.016, -thick)
    grasps = (build.top_grasp(made.at(0.0, grip_y, grip_z), 2 * wide * made.factors[0], 0.0, 0.7),)
    stand = build.model("phone_stand", made.shapes, "phone stand", phrases, grasps, support=rest)
    leaning = Pose(support, tilt)
    end = leaning.apply((0.0, -PHONE_LENGTH / 2, 0.0))
    return build.with_frames(stand, support=leaning, end=Pose(end, tilt))


DISPLAYS = (
    ("white", "navy", "white"), ("black", "gold", "black"), ("brown", "cream", "wooden"),
    ("gold", "red", "gold"), ("blue", "silver", "blue"), ("green", "cream", "green"),
)  # fmt: skip
DISPLAY_SIZES = (
    (0.1935, 0.1064, 0.0742), (0.1935, 0.1240, 0.0732), (0.1918, 0.1315, 0.0714),
    (0.1933, 0.0623, 0.0448), (0.1935, 0.1376, 0.0431), (0.1935, 0.1064, 0.0742),
)  # fmt: skip
"""Official width, depth and height [m] of each look."""


def display_stand(look: int, params: Params) -> ObjectModel:
    """A wide plinth for showing one thing, with a waist and a felt top in another colour."""
    base, felt, word = DISPLAYS[look]
    hx, hy, h = 0.0967, 0.0600, 0.0700
    waist = m.moved(m.slab(hx - 0.010, hy - 0.010, h - 0.024, 0.008, 0.0, 3), (0.0, 0.0, 0.012))
    shine = 0.4 if base == "gold" else 0.0
    parts = [
        collision(Box((hx, hy, h / 2)), (0.0, 0.0, h / 2)),
        visual(m.merge(m.slab(hx, hy, 0.014, 0.012, 0.003, 4),
                       m.moved(m.slab(hx, hy, 0.014, 0.012, 0.003, 4), (0.0, 0.0, h - 0.014))),
               colour(base), roughness=0.4, metallic=shine),
        visual(waist, colour(felt), roughness=0.6),
        visual(m.flat(m.rounded_rectangle(hx - 0.008, hy - 0.008, 0.008), h + 0.0004),
               colour(felt), roughness=0.95),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} display stand", "{} display platform", "wide {} display stand", "{} plinth",
        f"{word} display stand with a {felt} top", "{} pedestal", "{} exhibition stand",
    )  # fmt: skip
    made = build.fitted(parts, DISPLAY_SIZES[look])
    top = made.at(0.0, 0.0, h)
    return build.model("display_stand", made.shapes, "display stand", phrases, support=top)


SCALES = (("white", "#c6f6a0"), ("black", "#7fe8ff"), ("blue", "#c6f6a0"), ("red", "#ffe08a"),
          ("green", "#ffffff"))  # fmt: skip
SCALE_SIZES = (
    (0.1170, 0.1561, 0.0406), (0.1102, 0.1542, 0.0538), (0.1280, 0.1546, 0.1005),
    (0.1312, 0.1548, 0.0242), (0.0985, 0.1549, 0.0638),
)  # fmt: skip
"""Official width, depth and height [m] of each look."""


def electronic_scale(look: int, params: Params) -> ObjectModel:
    """A kitchen scale: a flat body, a steel plate to weigh on and a lit read-out in front."""
    word, light = SCALES[look]
    hx, hy, h, top = 0.047, 0.058, 0.017, 0.021
    plate_y, size = 0.012, 0.0415
    steel = m.moved(m.slab(size, size, top - h, 0.012, 0.001, 4), (0.0, plate_y, h))
    window = (0.0, -0.0445)
    zeros = [_zero(h + 0.0012, x, window[1], 0.0052, 0.0098) for x in (-0.0150, -0.0042, 0.0066)]
    point = m.flat(m.rectangle(0.0008, 0.0008), h + 0.0012, (-0.0096, window[1] - 0.0048))
    button = m.moved(m.prism(m.ellipse(0.0046, 0.0046, 12), 0.0, 0.0012), (0.035, window[1], h))
    units = m.flat(m.rectangle(0.0016, 0.0022), h + 0.0012, (0.0150, window[1] - 0.003))
    parts = [
        collision(Box((hx, hy, h / 2)), (0.0, 0.0, h / 2)),
        collision(Box((size, size, (top - h) / 2)), (0.0, plate_y, (top + h) / 2)),
        visual(m.slab(hx, hy, h, 0.012, 0.003, 4), colour(word), roughness=0.4),
        visual(steel, build.STEEL, roughness=0.3, metallic=0.5),
        visual(m.flat(m.rounded_rectangle(0.0245, 0.0088, 0.003), h + 0.0004, window), build.DARK),
        visual(m.flat(m.rectangle(0.0225, 0.0072), h + 0.0008, window), srgb(light), roughness=0.9),
        visual(m.merge(*zeros, point, units), srgb("#101418")),
        visual(button, colour("red") if word != "red" else build.DARK),
    ]
    phrases = build.fill_phrases(
        word, "{} electronic scale", "{} digital scale", "{} kitchen scale",
        "electronic scale in {}",
        "{} weighing scale", "{} scale with a digital display", "{} scale",
    )  # fmt: skip
    made = build.fitted(parts, SCALE_SIZES[look])
    on_top = made.at(0.0, plate_y, top)
    return build.model("electronic_scale", made.shapes, "electronic scale", phrases, support=on_top)


def _zero(z: float, x: float, y: float, w: float, h: float) -> Mesh:
    """A zero of six bars lying at `z`, `w` by `h` [m] around (`x`, `y`)."""
    t = 0.0007
    level, steep = m.rectangle(w / 2 - t, t), m.rectangle(t, h / 4 - t * 0.6)
    places = (
        (level, 0.0, h / 2), (steep, w / 2, h / 4), (steep, w / 2, -h / 4),
        (level, 0.0, -h / 2), (steep, -w / 2, -h / 4), (steep, -w / 2, h / 4),
    )  # fmt: skip
    return m.merge(*(m.flat(bar, z, (x + u, y + v)) for bar, u, v in places))


RACKS = (
    ("#d9ae72", "tan", "light wooden"), ("#74482a", "brown", "dark wooden"),
    ("#2a2c31", "grey", "black"), ("#2f62b0", "silver", "blue"), ("#b8322a", "black", "red"),
    ("#2c6b45", "tan", "green"),
)  # fmt: skip
PEG_RADIUS = 0.0038
POST_Y = 0.028
"""How far behind the foot's middle the post of a mug rack stands [m], clear of a mug on its peg."""
RACK_POINT = (0.0652, 0.1945)
"""Where the peg of a mug rack ends: out of the foot's middle and up [m] (official)."""
PEG_RISE, ROOT_RISE = 0.9, -0.1
"""How far the outer half of the peg points up [rad] (official), and the half at the post: on a
straight one that rises 0.4 rad a mug slides to the post."""


def mug_rack(look: int, params: Params) -> ObjectModel:
    """A post on a foot with a peg towards -y, from which a mug hangs by its handle.

    Frame "hang" is on the peg's axis, where the middle of the handle goes: half as far out as the
    peg's end (official), where the peg bends; its y axis runs along the outer half, inwards. Frame
    "tip" is the peg's end.
    """
    code, trim, word = RACKS[look]
    post_y, tall, wood = POST_Y, 0.257, srgb(code)
    tilt = axis_rotation((1.0, 0.0, 0.0), -PEG_RISE)
    level = axis_rotation((1.0, 0.0, 0.0), -ROOT_RISE)
    out, end_z = RACK_POINT
    knee_z = end_z - out / 2 * math.tan(PEG_RISE)
    root_z = knee_z - (out / 2 + post_y) * math.tan(ROOT_RISE)
    root, knee, tip = (0.0, post_y, root_z), (0.0, -out / 2, knee_z), (0.0, -out, end_z)
    inner, outer = math.dist(root, knee) / 2, math.dist(knee, tip) / 2
    back = [(0.0, post_y, root_z + 0.030), (0.0, post_y + 0.030, root_z + 0.042)]
    pegs = m.merge(m.tube([root, knee, tip], PEG_RADIUS, 10), m.tube(back, PEG_RADIUS, 10))
    knob = [(0.0, -0.0052), (0.0036, -0.0037), (0.0052, 0.0), (0.0036, 0.0037), (0.0, 0.0052)]
    head = [(0.0065, tall - 0.010), (0.0095, tall - 0.003), (0.0065, tall + 0.004)]
    head += [(0.0, tall + 0.006)]
    knobs = [m.moved(m.lathe(knob, 10), p) for p in (tip, back[1])]
    arms = [
        m.tube([(0.0, post_y, at), (s * 0.0315, post_y + 0.014, at + 0.008),
                (s * 0.044, post_y + 0.021, at + 0.024)], 0.0045, 6)
        for at in (0.085, 0.150)
        for s in (-1, 1)
    ]  # fmt: skip
    parts = [
        collision(Box((0.052, 0.052, 0.007)), (0.0, 0.0, 0.007)),
        collision(Box((0.0065, 0.0065, (tall - 0.014) / 2)), (0.0, post_y, (tall + 0.014) / 2)),
        collision(Box((PEG_RADIUS * 0.8, inner, PEG_RADIUS * 0.9)), _middle(root, knee), level),
        collision(Box((PEG_RADIUS * 0.8, outer, PEG_RADIUS * 0.9)), _middle(knee, tip), tilt),
        visual(m.slab(0.052, 0.052, 0.014, 0.012, 0.003, 4), wood, roughness=0.6),
        visual(m.moved(m.lathe([(0.0095, 0.013), (0.0065, 0.022), (0.0065, tall - 0.010)], 12),
                      (0.0, post_y, 0.0)), wood, roughness=0.6),
        visual(m.moved(m.lathe(head, 12), (0.0, post_y, 0.0)), colour(trim), roughness=0.5),
        visual(m.merge(pegs, *arms), wood, roughness=0.6),
        visual(m.merge(*knobs), colour(trim), roughness=0.5),
    ]  # fmt: skip
    phrases = build.fill_phrases(
        word, "{} mug rack", "{} mug holder", "{} mug tree", "{} rack for mugs", "{} cup rack",
        "{} stand for hanging mugs",
    )  # fmt: skip
    made = build.model("mug_rack", parts, "mug rack", phrases, support=knee)
    return build.with_frames(made, hang=Pose(knee, tilt), tip=Pose(tip, tilt))


def _middle(a: Vec3, b: Vec3) -> Vec3:
    return ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2)


ASSETS = build.library(
    (display_stand, DISPLAYS), (electronic_scale, SCALES), (mug_rack, RACKS),
    (phone_stand, PHONE_STANDS),
)  # fmt: skip
