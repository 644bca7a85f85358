"""Kitchen things that others are put into or onto: `kitchen_pot`, `plate`, `coaster`, `tray`."""

import math

from robospa.geometry import Pose
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, srgb, visual
from robospa.tasks.shapes import Box, Color, Cylinder, Mesh, ObjectModel, Params

POTS: tuple[tuple[Color, Color, str, float], ...] = (
    (build.STEEL, build.DARK, "silver", 0.5), (colour("red"), build.DARK, "red", 0.0),
    (colour("blue"), build.STEEL, "blue", 0.0), (srgb("#2b2d31"), colour("brown"), "black", 0.0),
    (colour("yellow"), build.DARK, "yellow", 0.0),
    (colour("dark green"), build.STEEL, "green", 0.0),
)  # fmt: skip
POT_RADIUS, POT_HEIGHT = 0.075, 0.078
HANDLE_HEIGHT, HANDLE_OUT, HANDLE_HALF, HANDLE_THICK = 0.058, 0.033, 0.028, 0.0045
"""Of a pot's handles: height, reach from the wall, half their length, half their thickness [m].

Between wall and bar there is room for an open finger."""


def kitchen_pot(look: int, params: Params) -> ObjectModel:
    """An open cooking pot with two loop handles, on its left (-x) and right (+x).

    Grasp 0 holds the left handle, grasp 1 the right one; frames "left" and "right" are there too.
    """
    body, grip, word, metallic = POTS[look]
    r, h, wall, floor = POT_RADIUS, POT_HEIGHT, 0.0030, 0.0050
    outer = [(0.0, 0.0), (r - 0.006, 0.0), (r, 0.006), (r, h - 0.004), (r + 0.0025, h - 0.003)]
    outer += [(r + 0.0025, h)]
    inner = [(r - wall, h), (r - wall, floor + 0.004), (r - 0.007, floor), (0.0, floor)]
    loops = []
    parts = [
        visual(m.lathe(outer, 28, False), body, roughness=0.3, metallic=metallic),
        visual(m.lathe([outer[-1], inner[0]], 28, False), body, roughness=0.3, metallic=metallic),
        visual(m.lathe(inner, 28, False), srgb("#9aa0a6"), roughness=0.45, metallic=0.2),
        visual(m.lathe([(r + 0.0004, 0.018), (r + 0.0004, 0.022)], 28, False), grip),
        collision(Cylinder(r - 0.004, floor / 2), (0.0, 0.0, floor / 2)),
        *build.wall_ring(r - wall, wall, 0.001, h, 16),
    ]
    for side in (-1.0, 1.0):
        t = HANDLE_THICK
        bar, root, tip = HANDLE_HALF - t, r - 0.002, r + HANDLE_OUT - t
        path = [(root, bar), (tip - 0.006, bar), (tip, bar - 0.006), (tip, 0.006 - bar)]
        path += [(tip - 0.006, -bar), (root, -bar)]
        loops.append(m.tube([(side * x, y, HANDLE_HEIGHT) for x, y in path], t, 6))
        parts.append(collision(Box((t, HANDLE_HALF - 0.004, t)), (side * tip, 0.0, HANDLE_HEIGHT)))
        for y in (-bar, bar):
            out = HANDLE_OUT / 2 - 0.002
            parts.append(collision(Box((out, t, t)), (side * (r + out - 0.001), y, HANDLE_HEIGHT)))
    parts.append(visual(m.merge(*loops), grip, roughness=0.4))
    phrases = build.fill_phrases(
        word, "{} pot", "{} cooking pot", "{} kitchen pot", "pot in {}", "{} pot with two handles",
        "{} soup pot", "open {} cooking pot",
    )  # fmt: skip
    hold = r + HANDLE_OUT - HANDLE_THICK
    points = {"left": (-hold, 0.0, HANDLE_HEIGHT), "right": (hold, 0.0, HANDLE_HEIGHT)}
    grasps = [build.top_grasp(p, 2 * HANDLE_THICK, 0.0, 0.7) for p in points.values()]
    made = build.model(
        "kitchen_pot", parts, "pot", phrases, grasps, mass=0.12, support=(0.0, 0.0, floor)
    )
    return build.with_frames(made, **{side: Pose(p) for side, p in points.items()})


PLATES = (
    ("white", "blue", "white"), ("light blue", "navy", "blue"), ("green", "cream", "green"),
    ("pink", "purple", "pink"), ("yellow", "orange", "yellow"), ("red", "cream", "red"),
)  # fmt: skip


def plate(look: int, params: Params) -> ObjectModel:
    """A shallow round plate with a raised rim and two painted rings."""
    base, stripe, word = PLATES[look]
    r, flat, h, low = 0.0815, 0.050, 0.0275, 0.0045
    outer = [(0.0, 0.0), (0.044, 0.0), (0.050, 0.0015), (r, h - 0.002), (r, h)]
    inner = [(r - 0.001, h), (flat, low), (0.0, low)]

    def ring(a: float, b: float) -> Mesh:
        up = (h - low) / (r - 0.001 - flat)
        ends = [(x, low + (x - flat) * up + 0.0005) for x in (b, a)]
        return m.lathe(ends, 28, False)

    red, g, b = colour(base)
    slope = math.atan2(h - low, r - 0.001 - flat)
    parts = [
        visual(m.lathe(outer, 28, False), colour(base), roughness=0.25),
        visual(m.lathe([outer[-1], inner[0]], 28, False), colour(base), roughness=0.25),
        visual(m.lathe(inner[:2], 28, False), colour(base), roughness=0.25),
        visual(m.lathe(inner[1:], 28, False), (0.78 * red, 0.78 * g, 0.78 * b), roughness=0.25),
        visual(m.merge(ring(0.0710, 0.0785), ring(0.0550, 0.0575)), colour(stripe), roughness=0.25),
        collision(Cylinder(flat, low / 2), (0.0, 0.0, low / 2)),
        *build.wall_ring(0.0632, 0.0035, low, h - 0.001, 24, math.pi / 2 - slope),
    ]
    phrases = build.fill_phrases(
        word, "{} plate", "{} dinner plate", "round {} plate", "plate in {}",
        f"{word} plate with {stripe} rings", "{} dish", "{} ceramic plate",
    )  # fmt: skip
    return build.model("plate", parts, "plate", phrases, support=(0.0, 0.0, low))


COASTERS = (
    ("tan", "brown"), ("red", "white"), ("blue", "white"), ("green", "yellow"),
    ("black", "grey"), ("purple", "pink"),
)  # fmt: skip


def coaster(look: int, params: Params) -> ObjectModel:
    """A thin round coaster with a darker edge and rings on top."""
    base, mark = COASTERS[look]
    r, h = 0.0535, 0.0082
    edge = [(r - 0.0008, 0.0), (r, 0.0010), (r, h - 0.0010), (r - 0.0010, h)]
    rings = [
        m.lathe([(b, h + 0.0003), (a, h + 0.0003)], 24, False)
        for a, b in ((0.0450, 0.0490), (0.0, 0.0130), (0.0205, 0.0230))
    ]
    parts = [
        collision(Cylinder(r, h / 2), (0.0, 0.0, h / 2)),
        visual(m.lathe(edge, 24), colour(base), roughness=0.9),
        visual(m.merge(*rings), colour(mark), roughness=0.9),
    ]
    phrases = build.fill_phrases(
        base, "{} coaster", "round {} coaster", "coaster in {}", "{} drink coaster",
        "{} cup coaster", "flat {} coaster", "{} cup mat",
    )  # fmt: skip
    return build.model("coaster", parts, "coaster", phrases, support=(0.0, 0.0, h))


TRAYS = (
    ("brown", "tan"), ("red", "white"), ("blue", "light blue"), ("green", "cream"),
    ("black", "grey"), ("orange", "cream"),
)  # fmt: skip
TRAY_SIZES = (
    (0.3070, 0.1870, 0.0312), (0.3069, 0.1927, 0.0384), (0.3069, 0.2234, 0.0381),
    (0.3068, 0.2351, 0.0411), (0.3070, 0.1870, 0.0312), (0.3069, 0.1927, 0.0384),
)  # fmt: skip
"""Official length, depth and height [m] of each look."""


def tray(look: int, params: Params) -> ObjectModel:
    """A wide serving tray with a low rim and two grips.

    Frames "left" and "right" are the two places on it, either side of its middle.
    """
    base, lining = TRAYS[look]
    hx, hy, h, wall, floor = 0.145, 0.085, 0.016, 0.006, 0.004
    outer = m.rounded_rectangle(hx, hy, 0.022, 5)
    foot = [(x * 0.97, y * 0.955) for x, y in outer]
    inner = m.rounded_rectangle(hx - wall, hy - wall, 0.017, 5)
    well = [(x * 0.975, y * 0.96) for x, y in inner]
    field = m.rounded_rectangle(hx - 0.024, hy - 0.022, 0.010, 4)
    levels = ((foot, 0.0), (outer, h), (inner, h), (well, floor))
    shell = m.loft([m.ring(polygon, z) for polygon, z in levels], False)
    grips = [
        m.moved(m.prism(m.rounded_rectangle(0.003, 0.024, 0.0029, 3), 0.0, 0.0012), (x, 0.0, h))
        for x in (wall / 2 - hx, hx - wall / 2)
    ]
    parts = [
        collision(Box((hx * 0.98, hy * 0.97, floor / 2)), (0.0, 0.0, floor / 2)),
        visual(shell, colour(base), roughness=0.5),
        visual(m.flat(well, floor), colour(base), roughness=0.5),
        visual(m.flat(field, floor + 0.0005), colour(lining), roughness=0.7),
        visual(m.merge(*grips), colour(lining), roughness=0.5),
    ]
    for sign in (-1.0, 1.0):
        side = (sign * (hx - wall / 2 - 0.001), 0.0, h / 2)
        parts.append(collision(Box((wall / 2, hy - 0.008, h / 2)), side))
        front = (0.0, sign * (hy - wall / 2 - 0.001), h / 2)
        parts.append(collision(Box((hx - 0.008, wall / 2, h / 2)), front))
    phrases = build.fill_phrases(
        base, "{} tray", "{} serving tray", "tray in {}", "{} food tray",
        f"{base} tray with a {lining} lining", "wide {} tray", "{} meal tray",
    )  # fmt: skip
    sized = build.fitted(parts, TRAY_SIZES[look])
    middle = sized.at(0.0, 0.0, floor)
    made = build.model("tray", sized.shapes, "tray", phrases, support=middle)
    places = {"left": sized.at(-0.068, 0.0, floor), "right": sized.at(0.068, 0.0, floor)}
    return build.with_frames(made, **{side: Pose(p) for side, p in places.items()})


ASSETS = build.library((kitchen_pot, POTS), (plate, PLATES), (coaster, COASTERS), (tray, TRAYS))
