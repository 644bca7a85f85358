"""Small devices and a toy: `phone`, `remote_control`, `alarm_clock` and `toycar`."""

import math

from robospa.geometry import Pose, Vec3, axis_rotation
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.shapes import Box, Cylinder, Mesh, ObjectModel, Params, Shape

PHONES = (
    ("black", "#1f4f9c"), ("white", "#3aa6a0"), ("red", "#2b2e63"), ("gold", "#7a3d8f"),
    ("blue", "#d8703a"),
)  # fmt: skip
ICONS = ("#5ad35a", "#f6c12d", "#f05a4e", "#ffffff")
PHONE_SIZES = (
    (0.0700, 0.1509, 0.0161), (0.0642, 0.1510, 0.0142), (0.0700, 0.1509, 0.0157),
    (0.0700, 0.1509, 0.0189), (0.0700, 0.1509, 0.0183),
)  # fmt: skip
"""Width and official length and height [m] of each look."""
PHONE_LENGTH = 0.151
"""Of every look [m]."""


def phone(look: int, params: Params) -> ObjectModel:
    """A phone lying on its back, screen up, with rows of coloured icons.

    Frame "end": the middle of its lower end, on the underside (official functional point).
    """
    body, wall = PHONES[look]
    hx, hy, h = 0.0235, 0.0445, 0.0100
    icons: list[list[Mesh]] = [[] for _ in ICONS]
    square = m.rounded_rectangle(0.0033, 0.0033, 0.0009, 2)
    for row in range(4):
        for column in range(4):
            at = (-0.0141 + 0.0094 * column, 0.026 - 0.0115 * row)
            icons[(row * 3 + column + look) % 4].append(m.flat(square, h + 0.0011, at))
    screen = m.rounded_rectangle(hx - 0.0018, hy - 0.0018, 0.0045)
    lit = m.rounded_rectangle(hx - 0.0035, hy - 0.0040, 0.003)
    dock = m.flat(m.rounded_rectangle(0.0175, 0.0055, 0.002, 2), h + 0.0009, (0.0, -0.031))
    side = [
        m.upright(m.rectangle(s, 0.0013), (hx + 0.0004, y, h / 2), 0.0)
        for s, y in ((0.005, 0.018), (0.0085, 0.001))
    ]
    parts = [
        collision(Box((hx, hy, h / 2)), (0.0, 0.0, h / 2)),
        visual(m.slab(hx, hy, h, 0.006, 0.0015), colour(body), roughness=0.3),
        visual(m.flat(screen, h + 0.0003), srgb("#0c0d10")),
        visual(m.flat(lit, h + 0.0006), srgb(wall), roughness=0.2),
        visual(dock, srgb("#dfe5ee")),
        *(visual(m.merge(*p), srgb(c)) for p, c in zip(icons, ICONS, strict=True)),
        visual(m.merge(*side), build.DARK),
    ]
    phrases = build.fill_phrases(
        body, "{} phone", "{} mobile phone", "{} smartphone", "phone in a {} case", "{} cell phone",
        "phone with a {} frame", "{} touchscreen phone",
    )  # fmt: skip
    made = build.fitted(parts, PHONE_SIZES[look])
    width = 2 * hx * made.factors[0]
    grasps = tuple(build.top_grasp(made.at(0.0, y, 0.006), width, 0.0, 0.5) for y in (0.0, -0.012))
    phone = build.model("phone", made.shapes, "phone", phrases, grasps)
    return build.with_frames(phone, end=Pose((0.0, -PHONE_LENGTH / 2, 0.0)))


REMOTES = (
    ("black", "#d5d9de", "#cf2a24"), ("white", "#5a5f66", "#cf2a24"),
    ("grey", "#f2f2ee", "#cf2a24"),
    ("blue", "#f2f2ee", "#f5c816"), ("red", "#f2f2ee", "#1c1c20"), ("green", "#f2f2ee", "#cf2a24"),
    ("yellow", "#26282c", "#cf2a24"),
)  # fmt: skip
REMOTE_SIZES = (
    (0.0480, 0.1935, 0.0209), (0.0573, 0.1935, 0.0221), (0.0580, 0.1940, 0.0397),
    (0.0580, 0.1935, 0.0236), (0.0560, 0.1935, 0.0261), (0.0530, 0.1937, 0.0312),
    (0.0560, 0.1934, 0.0392),
)  # fmt: skip
"""Width and official length and height [m] of each look."""


def remote_control(look: int, params: Params) -> ObjectModel:
    """A remote control lying on its back, its power button towards +y."""
    body, keys, power = REMOTES[look]
    hx, hy, h = 0.0155, 0.0385, 0.0145
    buttons = []
    key = m.rounded_rectangle(0.0030, 0.0020, 0.0008, 2)
    for row in range(4):
        for column in range(3):
            buttons.append(_key(key, h, (0.0084 * (column - 1), -0.031 + 0.0068 * row)))
    ring_out, ring_in = m.ellipse(0.0105, 0.0105, 16), m.ellipse(0.0042, 0.0042, 10)
    pad = m.moved(m.prism(ring_out, 0.0, 0.0010, under=False), (0.0, 0.0085, h - 0.0002))
    bars = [_key(m.rectangle(0.0016, 0.0042), h, (s * 0.009, 0.0255)) for s in (-1, 1)]
    eye = m.upright(m.rectangle(0.0075, 0.0035), (0.0, hy + 0.0003, h / 2), math.pi / 2)
    shade = srgb("#3a3d44") if body == "black" else build.DARK
    parts = [
        collision(Box((hx, hy, h / 2)), (0.0, 0.0, h / 2)),
        visual(m.slab(hx, hy, h, 0.006, 0.0025), colour(body), roughness=0.45),
        visual(m.merge(*buttons, *bars), srgb(keys), roughness=0.6),
        visual(pad, srgb(keys) if look % 2 else shade, roughness=0.5),
        visual(m.flat(ring_in, h + 0.0012, (0.0, 0.0085)), shade if look % 2 else srgb(keys)),
        visual(_key(m.ellipse(0.0036, 0.0036, 10), h, (0.0, 0.0310)), srgb(power)),
        visual(eye, srgb("#400c14")),
    ]
    phrases = build.fill_phrases(
        body, "{} remote control", "{} remote", "{} TV remote", "remote control in {}",
        "{} television remote", "{} remote with buttons", "{} TV control",
    )  # fmt: skip
    made = build.fitted(parts, REMOTE_SIZES[look])
    width = 2 * hx * made.factors[0]
    grasps = tuple(build.top_grasp(made.at(0.0, y, 0.008), width, 0.0, 0.6) for y in (0.0, 0.010))
    return build.model("remote_control", made.shapes, "remote control", phrases, grasps)


def _key(outline: m.Polygon, h: float, at: m.Point) -> Mesh:
    return m.moved(m.prism(outline, -0.0002, 0.0011, 0.9, under=False), (*at, h))


CLOCKS = (
    ("red", "gold"), ("blue", "silver"), ("green", "gold"),
    ("black", "silver"), ("yellow", "black"),
)  # fmt: skip
CLOCK_SIZES = (
    (0.1937, 0.0780, 0.1228), (0.1500, 0.0739, 0.1942), (0.0857, 0.0561, 0.0983),
    (0.1939, 0.0676, 0.1294), (0.1500, 0.0616, 0.1524),
)  # fmt: skip
"""Width, depth and official height [m] of each look."""
CLOCK_TOUCHED = (0.1112, 0.1650, 0.0895, 0.1112, 0.1395)
"""Height of the official contact point [m]."""
DIGITAL = (0, 3)
"""The looks with a lit read-out; the others have two bells."""


def alarm_clock(look: int, params: Params) -> ObjectModel:
    """An alarm clock facing -y: a wide one with a read-out, or a round one with two bells.

    Frame "touched": the official contact point, about which a gripper's contacts count.
    """
    body, metal = CLOCKS[look]
    own = ("{} digital alarm clock", "wide {} alarm clock", "{} clock with a digital display")
    if look not in DIGITAL:
        own = ("{} twin-bell alarm clock", "round {} alarm clock", "{} clock with two bells")
    phrases = build.fill_phrases(body, "{} alarm clock", "{} clock", "alarm clock in {}", *own)
    trim = "snooze button" if look in DIGITAL else "bells"
    phrases = (*phrases, f"{body} alarm clock with {'a ' if look in DIGITAL else ''}{metal} {trim}")
    parts, top = (_digital if look in DIGITAL else _two_bells)(body, metal)
    made = build.fitted(parts, CLOCK_SIZES[look])
    _, deep, _ = CLOCK_SIZES[look]
    z = 0.55 * CLOCK_SIZES[look][2]
    grasps = (build.top_grasp((0.0, 0.0, z), deep, math.pi / 2, 0.7),)
    press = made.at(0.0, 0.0, top)
    clock = build.model("alarm_clock", made.shapes, "alarm clock", phrases, grasps, support=press)
    return build.with_frames(clock, touched=Pose((0.0, 0.0, CLOCK_TOUCHED[look])))


def _digital(body: str, metal: str) -> tuple[list[Shape], float]:
    """A block with a dark screen on both broad sides, 10:10 in bright bars, and a long button."""
    hx, hy, h, top = 0.097, 0.036, 0.110, 0.1228
    outline = m.moved(m.slab(hx, h / 2, 2 * hy - 0.0016, 0.022, 0.004, 3), rotation=build.ALONG_Y)
    block = m.moved(outline, (0.0, hy - 0.0008, h / 2))
    screen = m.rounded_rectangle(0.088, 0.046, 0.012)
    digits = [
        *(m.rectangle(0.0065, 0.034, x) for x in (-0.066, 0.022)),
        *(m.rectangle(0.019, 0.0055, x, z) for x in (-0.030, 0.058) for z in (-0.0285, 0.0285)),
        *(m.rectangle(0.0055, 0.034, x + u) for x in (-0.030, 0.058) for u in (-0.0135, 0.0135)),
        *(m.rectangle(0.0050, 0.0050, -0.003, z) for z in (-0.013, 0.013)),
    ]
    button = m.moved(m.slab(0.048, 0.016, top - h + 0.002, 0.012, 0.003), (0.0, 0.0, h - 0.0024))
    half = [(0.008, 0.005), (0.008, 0.009), (-0.008, 0.009), (-0.008, 0.005), (0.002, 0.005)]
    letter = [*half, *((-x, -y) for x, y in half)]
    sides = ((-1, -math.pi / 2), (1, math.pi / 2))
    parts = [
        collision(Box((hx, hy, h / 2)), (0.0, 0.0, h / 2)),
        collision(Box((0.048, 0.016, (top - h) / 2)), (0.0, 0.0, (top + h) / 2)),
        visual(block, colour(body), roughness=0.4),
        visual(m.merge(*(m.upright(screen, (0.0, s * (hy - 0.0004), h / 2), a) for s, a in sides)),
               srgb("#10151a"), roughness=0.2),
        visual(m.merge(*(m.upright(d, (0.0, s * hy, h / 2), a) for s, a in sides for d in digits)),
               srgb("#ff8a3c") if body != "red" else srgb("#7dff9a")),
        visual(button, colour(metal), roughness=0.4),
        visual(m.merge(*(m.flat(letter, top, (x, 0.0)) for x in (-0.027, 0.0, 0.027))), build.DARK),
        build.outline(m.mesh([(-0.082, -0.0366, h / 2), (0.082, -0.0366, h / 2),
                              (-0.0525, -0.0371, h / 2), (0.067, -0.0371, h / 2)], ())),
    ]  # fmt: skip
    return parts, top


def _two_bells(body: str, metal: str) -> tuple[list[Shape], float]:
    """A drum whose dials, one to either side, slope so that the hours show from its edge, too."""
    r, z, deep = 0.0310, 0.0385, 0.0150
    at = (0.0, 0.0, z)
    edge, low, flat, high = r - 0.002, 0.0052, 0.0150, deep - 0.0012
    drum = [(edge, -low), (r, -0.004), (r, 0.004), (edge, low)]
    dial = m.lathe([(edge, low), (flat, high), (0.0, high)], 20, False)
    slope = (high - low) / (edge - flat)
    ticks = []
    for i in range(12):
        c, s = math.cos(math.pi / 6 * i), math.sin(math.pi / 6 * i)
        half, inner = (0.0022, 0.0185) if i % 3 == 0 else (0.0012, 0.0215)
        bar = m.rectangle((r - 0.0035 - inner) / 2, half, (r - 0.0035 + inner) / 2)
        turned = [(u * c - v * s, u * s + v * c, low + slope * (edge - u) + 0.0006) for u, v in bar]
        ticks.append(m.mesh(turned, ((0, 1, 2), (0, 2, 3))))
    shown, before = (
        [_hand(length, half, math.radians(turn), up) for length, half, turn in hands]
        for up, hands in (
            (0.0143, ((0.0120, 0.0036, 150), (0.0185, 0.0028, 30))),
            (0.0159, ((0.0115, 0.0020, 150), (0.0175, 0.0014, 30))),
        )
    )
    marks = m.merge(*ticks, *shown)
    over = axis_rotation((0.0, 1.0, 0.0), math.pi)
    domes = []
    for s in (-1, 1):
        cap = m.lathe([(0.0105, 0.0), (0.0090, 0.0050), (0.0, 0.0085)], 10)
        tip = axis_rotation((0.0, 1.0, 0.0), s * 0.65)
        domes.append(m.moved(cap, (s * 0.0190, 0.0, z + r - 0.0055), tip))
    legs = m.merge(*(m.tube([(s * 0.016, 0.0, z - r + 0.010), (s * 0.0225, 0.0, 0.0008)], 0.0036, 5)
                     for s in (-1, 1)))  # fmt: skip
    standing = [(x, y, max(0.0, up)) for x, y, up in legs.vertices]
    arch = ((-0.007, -0.001), (-0.0045, 0.011), (0.0045, 0.011), (0.007, -0.001))
    handle = m.tube([(x, 0.0, z + r + up) for x, up in arch], 0.0016, 5)
    trim = colour(metal)
    shine = 0.4 if metal != "black" else 0.0
    reach = [(0.031, 0.0145), (0.0275, 0.0153), (0.025, 0.0156)]
    corners = m.mesh([(s * x, 0.0, y) for x, y in reach for s in (-1, 1)], ())
    parts = [
        collision(Cylinder(r, deep), at, build.ALONG_Y),
        collision(Box((0.025, 0.012, 0.011)), (0.0, 0.0, 0.011)),
        collision(Box((0.024, 0.010, 0.007)), (0.0, 0.0, z + r)),
        visual(m.lathe(drum, 22, False), colour(body), at, build.ALONG_Y, 0.35),
        visual(dial, build.PAPER, at, build.ALONG_Y),
        visual(m.moved(dial, rotation=over), build.PAPER, at, build.ALONG_Y),
        visual(marks, build.DARK, at, build.ALONG_Y),
        visual(m.moved(marks, rotation=over), build.DARK, at, build.ALONG_Y),
        visual(m.merge(*domes, handle), trim, roughness=0.3, metallic=shine),
        visual(m.mesh(standing, legs.faces), trim, roughness=0.4),
        build.outline(m.merge(corners, *before), at, build.ALONG_Y),
    ]
    return parts, z + r + 0.007


def _hand(length: float, half: float, angle: float, z: float) -> Mesh:
    bar = [(-0.003, -half / 2), (length, -half / 3), (length, half / 3), (-0.003, half / 2)]
    c, s = math.cos(angle), math.sin(angle)
    return m.flat([(u * c - v * s, u * s + v * c) for u, v in bar], z)


CARS = (
    ("red", "white"), ("blue", "white"), ("yellow", "black"), ("green", "white"),
    ("white", "red"), ("orange", "black"), ("purple", "yellow"),
)  # fmt: skip
CAR_SIZES = (
    (0.0598, 0.0966, 0.0529), (0.0446, 0.0959, 0.0272), (0.0478, 0.0962, 0.0465),
    (0.0477, 0.0968, 0.0256), (0.0537, 0.0962, 0.0497), (0.0514, 0.0965, 0.0425),
    (0.0478, 0.0962, 0.0465),
)  # fmt: skip
"""Official width, length and height [m] of each look."""


def toycar(look: int, params: Params) -> ObjectModel:
    """A toy car, its bonnet towards -y."""
    body, stripe = CARS[look]
    w = 0.0165
    low = [(-0.0365, 0.0075), (0.0365, 0.0075), (0.0365, 0.0185), (0.031, 0.0215), (-0.012, 0.0220)]
    low += [(-0.032, 0.0190), (-0.0365, 0.0150)]
    glass, felt = (
        _taper((0.0148, 0.0195, low_z), (0.0122, 0.0126, high_z))
        for low_z, high_z in ((0.0216, 0.0328), (0.0210, 0.0350))
    )
    roof = _taper((0.0124, 0.0128, 0.0326), (0.0108, 0.0112, 0.0350))
    bonnet = m.rectangle(0.004, 0.0095, y=-0.022)
    bands = [
        m.flat(m.rectangle(0.0040, 0.0098, 0.0, 0.0075), 0.0354),
        m.mesh(
            [(x, y, 0.0194 if y < -0.02 else 0.0224) for x, y in bonnet], [(0, 1, 2), (0, 2, 3)]
        ),
        m.flat(m.rectangle(0.0040, 0.0038, 0.0, 0.0270), 0.0219),
    ]
    leans = [(s * 0.0138, axis_rotation((0.0, 1.0, 0.0), -s * 0.19)) for s in (-1, 1)]
    posts = [m.box_mesh((0.0013, 0.0022, 0.0056), (x, 0.0085, 0.0272), turn) for x, turn in leans]
    lamp = m.ellipse(0.0030, 0.0022, 8)
    lamps = [m.upright(lamp, (s * 0.0115, -0.0369, 0.0120)) for s in (-1, 1)]
    tail = m.rectangle(0.0028, 0.0017)
    tails = [m.upright(tail, (s * 0.0120, 0.0369, 0.0150), math.pi / 2) for s in (-1, 1)]
    bumper = [m.box_mesh((0.0160, 0.0011, 0.0018), (0.0, s * 0.0366, 0.0085)) for s in (-1, 1)]
    wheels = [(s * 0.0150, y) for s in (-1, 1) for y in (-0.0225, 0.0225)]
    tyre = m.lathe([(0.0084, -0.0035), (0.0088, -0.002), (0.0088, 0.002), (0.0084, 0.0035)], 12)
    hub = m.lathe([(0.0046, -0.0039), (0.0046, 0.0039)], 8)
    tyres, hubs = (
        m.merge(*(m.moved(part, (x, y, 0.0088), build.ALONG_X) for x, y in wheels))
        for part in (tyre, hub)
    )
    parts: list[Shape] = [
        collision(Box((0.0183, 0.0360, 0.0105)), (0.0, 0.0, 0.0105)),
        collision(felt),
        visual(m.side_prism(low, w), colour(body), roughness=0.25),
        visual(glass, srgb("#1d2a3a"), roughness=0.15),
        visual(m.merge(roof, *posts), colour(body), roughness=0.25),
        visual(m.merge(*bands), colour(stripe), roughness=0.3),
        visual(m.merge(*lamps), srgb("#fff3b0")),
        visual(m.merge(*tails), srgb("#a3101a") if body != "red" else srgb("#ffb0a0")),
        visual(m.merge(*bumper), build.STEEL, roughness=0.3, metallic=0.3),
        visual(tyres, srgb("#18181a"), roughness=0.9),
        visual(hubs, srgb("#cfd3d8"), roughness=0.3),
    ]
    phrases = build.fill_phrases(
        body, "{} toy car", "{} car", "small {} car", "toy car in {}", "{} model car",
        "{} racing car", f"{body} toy car with a {stripe} stripe",
    )  # fmt: skip
    made = build.fitted(parts, CAR_SIZES[look])
    width = 0.0366 * made.factors[0]
    grasps = tuple(build.top_grasp(made.at(0.0, y, 0.012), width, 0.0, 0.6) for y in (0.0, 0.010))
    return build.model("toycar", made.shapes, "toy car", phrases, grasps)


def _taper(*levels: Vec3) -> Mesh:
    """Rounded rectangles, each of half sizes (x, y) at a height z, behind the car's middle."""
    outlines = [(m.rounded_rectangle(hx, hy, 0.004, 2), z) for hx, hy, z in levels]
    return m.loft([[(x, y + 0.0075, z) for x, y in outline] for outline, z in outlines])


ASSETS = build.library(
    (phone, PHONES), (remote_control, REMOTES), (alarm_clock, CLOCKS), (toycar, CARS),
)  # fmt: skip
