"""Boxes: `block`, `rubikscube`, cartons `tea_box`, `tissue_box`, `playing_cards`, a `soap` bar."""

import math
import random
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from robospa.geometry import Vec3
from robospa.tasks.colors import NAMED, nearest
from robospa.tasks.objects import build
from robospa.tasks.objects import meshes as m
from robospa.tasks.objects.build import collision, colour, solid, srgb, visual
from robospa.tasks.shapes import Box, Color, Mesh, ObjectModel, Params, Shape

SIDES = (-math.pi / 2, 0.0, math.pi / 2, math.pi)
"""Directions of an upright box's four faces: front (-y), right, back, left."""


def on_side(polygon: m.Polygon, half: Vec3, side: float, gap: float = 0.0004) -> Mesh:
    """`polygon` (right, up from the box's middle) laid on one face of a box standing on z = 0."""
    x, y = round(math.cos(side)), round(math.sin(side))
    at = (x * (half[0] + gap), y * (half[1] + gap), half[2])
    return m.upright(polygon, at, side)


def leaf(size: float) -> list[m.Point]:
    """A pointed oval, tip up."""
    ring = [(0.0, -1.0), (0.5, -0.45), (0.62, 0.1), (0.4, 0.6), (0.0, 1.0)]
    ring += [(-0.4, 0.6), (-0.62, 0.1), (-0.5, -0.45)]
    return [(size * u, size * v) for u, v in ring]


TEAS: tuple[tuple[str, str, str], ...] = (
    ("dark green", "#8fc35a", "green"), ("red", "#f5c816", "red"), ("yellow", "#8a3b12", "yellow"),
    ("purple", "#e7b7ef", "purple"), ("navy", "#7fbde8", "blue"), ("cream", "#5b8a3c", "cream"),
)  # fmt: skip
TEA_SIZES = (
    (0.0550, 0.0850, 0.0719), (0.0550, 0.0600, 0.0676), (0.0433, 0.0525, 0.0967),
    (0.0560, 0.0560, 0.0697), (0.0540, 0.0570, 0.0679), (0.0552, 0.0552, 0.0760),
)  # fmt: skip
"""Width, depth and official height [m] of each look."""


def tea_box(look: int, params: Params) -> ObjectModel:
    """A standing carton of tea bags, with a leaf in a pale oval on every side."""
    base, mark, word = TEAS[look]
    half = (0.026, 0.034, 0.038)  # as designed
    ovals, leaves, bands = [], [], []
    for side in SIDES:
        width = half[0] if round(math.sin(side)) else half[1]
        ovals.append(on_side(m.ellipse(0.017, 0.021, 14), half, side))
        leaves.append(on_side(leaf(0.014), half, side, 0.0009))
        bands.append(on_side(m.rectangle(width, 0.004, 0.0, 0.0315), half, side, 0.0003))
    lid = m.flat(m.rounded_rectangle(0.02, 0.028, 0.004), 2 * half[2] + 0.0004)
    badge = m.flat(leaf(0.017), 2 * half[2] + 0.0008)
    parts = [
        solid(Box(half), colour(base), (0.0, 0.0, half[2]), roughness=0.7),
        visual(m.merge(*ovals, lid), build.PAPER),
        visual(m.merge(*leaves, badge), srgb(mark) if base != "cream" else colour("green")),
        visual(m.merge(*bands), srgb(mark)),
    ]
    phrases = build.fill_phrases(
        word, "{} tea box", "{} box of tea", "{} carton of tea bags", "tea box in {} cardboard",
        "{} package of tea", "box of tea with {} sides", "{} tea carton",
    )  # fmt: skip
    wide, deep, tall = TEA_SIZES[look]
    made = build.fitted(parts, TEA_SIZES[look])
    grasps = build.box_grasps(wide / 2, deep / 2, 0.58 * tall)
    return build.model("tea_box", made.shapes, "tea box", phrases, grasps)


TISSUES = (
    ("light blue", "white", "light blue"), ("pink", "white", "pink"), ("green", "yellow", "green"),
    ("purple", "pink", "purple"),
)  # fmt: skip
TISSUE_SIZES = (
    (0.1160, 0.0681, 0.0630), (0.1161, 0.0700, 0.0770), (0.1144, 0.0593, 0.0729),
    (0.0776, 0.0591, 0.0473),
)  # fmt: skip
"""Official length, width and height [m] of each look, the tissue included."""


def tissue_box(look: int, params: Params) -> ObjectModel:
    """A low carton with a paper tissue sticking out of its slot."""
    base, mark, word = TISSUES[look]
    half = (0.042, 0.0295, 0.023)
    dots = [on_side(m.ellipse(0.0065, 0.0065, 8, 0.2), half, side) for side in SIDES]
    for side in SIDES:
        u = 0.026 if round(math.sin(side)) else 0.017
        dots += [
            on_side([(a + x, b + y) for a, b in m.ellipse(0.005, 0.005, 8)], half, side)
            for x in (-u, u)
            for y in (-0.011, 0.011)
        ]
    slot = m.flat(m.ellipse(0.027, 0.012, 14), 2 * half[2] + 0.0004)
    parts = [
        solid(Box(half), colour(base), (0.0, 0.0, half[2]), roughness=0.8),
        visual(m.merge(*dots), colour(mark)),
        visual(slot, srgb("#3a3f46")),
        visual(_tissue(2 * half[2]), srgb("#ffffff"), roughness=0.9),
    ]
    phrases = build.fill_phrases(
        word, "{} tissue box", "{} box of tissues", "tissue box in {}",
        "{} carton of paper tissues",        "{} box with a tissue sticking out",
        "box of tissues with {} sides", "{} facial tissue box",
    )  # fmt: skip
    made = build.fitted(parts, TISSUE_SIZES[look])
    x, y, z = made.at(half[0], half[1], 0.024)
    top = made.at(0.0, 0.0, 2 * half[2])
    grasps = build.box_grasps(x, y, z)
    return build.model("tissue_box", made.shapes, "tissue box", phrases, grasps, support=top)


def _tissue(z: float) -> Mesh:
    low = [(0.021, 0.004), (0.0, 0.006), (-0.021, 0.004)]
    low += [(-0.02, -0.004), (0.0, -0.006), (0.02, -0.004)]
    mid = [(0.016, 0.011), (0.002, 0.005), (-0.018, 0.009)]
    mid += [(-0.015, -0.006), (-0.002, -0.01), (0.017, -0.004)]
    top = [(0.019, 0.002, 0.024), (0.001, 0.009, 0.02), (-0.013, 0.003, 0.027)]
    top += [(-0.019, -0.002, 0.022), (0.003, -0.004, 0.017), (0.009, -0.006, 0.025)]
    edge = [(x, y, z + h) for x, y, h in top]
    return m.loft([m.ring(low, z), m.ring(mid, z + 0.011), edge])


CARDS = (("red", "#ffffff", "red"), ("blue", "#ffffff", "blue"), ("black", "#d6a52c", "black"),
         ("green", "#f6f4ec", "green"))  # fmt: skip
CARD_SIZES = (
    (0.0602, 0.0967, 0.0217), (0.0668, 0.0967, 0.0205), (0.0643, 0.0968, 0.0200),
    (0.0602, 0.0967, 0.0217),
)  # fmt: skip
"""Official width, length and height [m] of each look."""


def playing_cards(look: int, params: Params) -> ObjectModel:
    """A pack of cards lying flat: a framed panel with a big spade-like suit sign on top."""
    base, mark, word = CARDS[look]
    half = (0.0175, 0.0262, 0.0105)
    top = 2 * half[2]
    frame = m.flat(m.rounded_rectangle(0.0145, 0.0232, 0.003), top + 0.0003)
    panel = m.flat(m.rounded_rectangle(0.0128, 0.0215, 0.0025), top + 0.0006)
    diamond = m.flat([(0.0085, 0.0), (0.0, 0.013), (-0.0085, 0.0), (0.0, -0.013)], top + 0.001)
    corner = [(0.0025, 0.0), (0.0, 0.0035), (-0.0025, 0.0), (0.0, -0.0035)]
    small = [m.flat(corner, top + 0.001, at) for at in ((0.009, 0.0165), (-0.009, -0.0165))]
    widths = zip(SIDES, 2 * half[:2], strict=True)
    edges = [on_side(m.rectangle(w - 0.004, 0.0045), half, side) for side, w in widths]
    parts = [
        solid(Box(half), colour(base), (0.0, 0.0, half[2])),
        visual(m.merge(frame, diamond, *small, *edges), srgb(mark)),
        visual(panel, colour(base)),
    ]
    phrases = build.fill_phrases(
        word, "{} pack of playing cards", "{} card box", "{} deck of cards", "{} playing cards",
        "boxed deck of cards in {}", "{} box of playing cards", "card pack with a {} back",
    )  # fmt: skip
    wide, long, tall = CARD_SIZES[look]
    made = build.fitted(parts, CARD_SIZES[look])
    grasps = build.box_grasps(wide / 2, long / 2, tall / 2, 0.6)
    noun = "pack of playing cards"
    return build.model("playing_cards", made.shapes, noun, phrases, grasps, mass=0.01)


SOAPS: tuple[tuple[Color, str], ...] = (
    (srgb("#f3a6bf"), "pink"), (srgb("#56a868"), "green"), (srgb("#f1e7c4"), "cream"),
    (srgb("#8fc0ea"), "light blue"), (srgb("#f0c257"), "yellow"),
)  # fmt: skip
SOAP_SIZES = (
    (0.0967, 0.0311, 0.0214), (0.0963, 0.0483, 0.0218), (0.0966, 0.0600, 0.0392),
    (0.0962, 0.0520, 0.0367), (0.0963, 0.0483, 0.0218),
)  # fmt: skip
"""Official length, width and height [m] of each look."""


def soap(look: int, params: Params) -> ObjectModel:
    """A bar of soap with softened edges and a pressed oval on top."""
    color, word = SOAPS[look]
    half = (0.0285, 0.0168, 0.0118)
    dark: Color = (color[0] * 0.72, color[1] * 0.72, color[2] * 0.72)
    pale: Color = (min(1, color[0] * 1.12), min(1, color[1] * 1.12), min(1, color[2] * 1.12))
    top = 2 * half[2]
    bars = [m.rectangle(0.0022, 0.0026, 0.006 * i - 0.009) for i in range(4)]
    parts = [
        collision(Box((half[0], half[1] - 0.0005, half[2])), (0.0, 0.0, half[2])),
        visual(m.slab(half[0], half[1], top, 0.008, 0.004, 4), color, roughness=0.35),
        visual(m.flat(m.ellipse(0.019, 0.0088, 18), top + 0.0003), dark),
        visual(m.flat(m.ellipse(0.0172, 0.0073, 18), top + 0.0006), pale),
        visual(m.merge(*(m.flat(bar, top + 0.0009) for bar in bars)), dark),
    ]
    phrases = build.fill_phrases(
        word, "{} soap bar", "{} bar of soap", "bar of {} soap", "{} soap", "soap bar in {}",
        "{} hand soap", "{} block of soap",
    )  # fmt: skip
    made = build.fitted(parts, SOAP_SIZES[look])
    x, y, z = made.at(half[0], half[1] - 0.0005, 0.011)
    return build.model("soap", made.shapes, "soap", phrases, build.box_grasps(x, y, z, 0.6)[::-1])


BLOCK_COLORS = (
    *("red", "green", "blue", "yellow", "cyan"),
    *("magenta", "orange", "purple", "white", "black"),
)
"""Look k of a block has colour k."""


def block(look: int, params: Params) -> ObjectModel:
    """A plain cuboid around its origin; params "half" [m] and "color" (linear RGB)."""
    half = build.three_numbers(params.get("half", (0.02, 0.02, 0.02)), "block half")
    color = build.three_numbers(params.get("color", NAMED[BLOCK_COLORS[look]]), "block color")
    if min(half) <= 0:
        raise ValueError(f"block half sizes must be positive, not {list(half)}")
    shape = solid(Box(half), color, roughness=0.6)
    return replace(_plain_block(half), shapes=(shape,), phrases=_block_phrases(color))


@lru_cache(maxsize=1024)
def _block_phrases(color: Color) -> tuple[str, ...]:
    """Noun phrases of a block: by the nearest colour that has a word."""
    word = nearest(color)
    return (
        f"{word} block", f"{word} box", f"block that is {word}", f"{word} building block",
        f"{word}-coloured block", f"block painted {word}", f"block with {word} sides",
    )  # fmt: skip


@lru_cache(maxsize=1024)
def _plain_block(half: Vec3) -> ObjectModel:
    """A block of that size: what does not depend on its colour, which is new in many a scene."""
    # at half height; a tall block is taken higher, where the palm still clears its top
    grasps = build.box_grasps(half[0], half[1], max(0.0, half[2] - 0.035))
    if half[1] < half[0]:
        grasps = grasps[::-1]
    shape, top = solid(Box(half), (1.0, 1.0, 1.0), roughness=0.6), (0.0, 0.0, half[2])
    return build.model("block", [shape], "block", (), grasps, mass=0.01, support=top)


CUBE_HALF = 0.028
STICKERS: Mapping[str, Color] = {
    "white": srgb("#f4f4f0"), "red": srgb("#c41e2a"), "blue": srgb("#1648b8"),
    "green": srgb("#109a48"), "orange": srgb("#f77a10"), "yellow": srgb("#ffd812"),
}  # fmt: skip
CUBES: tuple[tuple[str, bool, int, tuple[str, ...]], ...] = (
    ("#141416", True, 3, (
        "scrambled Rubik's cube", "mixed-up puzzle cube", "black puzzle cube with mixed colours",
        "unsolved Rubik's cube", "colourful scrambled magic cube", "jumbled colour cube",
    )),
    ("#141416", False, 0, (
        "solved Rubik's cube", "finished puzzle cube", "puzzle cube with one colour per side",
        "Rubik's cube with matching sides", "completed magic cube", "sorted colour cube",
    )),
    ("#8d939a", True, 2, (
        "grey-framed Rubik's cube", "puzzle cube with a grey frame", "magic cube in grey",
        "grey puzzle cube with mixed colours", "Rubik's cube with grey edges",
        "colour cube on a grey body",
    )),
)  # fmt: skip


def rubikscube(look: int, params: Params) -> ObjectModel:
    """A 3 x 3 puzzle cube of 5.6 cm."""
    body, mixed, seed, phrases = CUBES[look]
    h = CUBE_HALF
    faces = ("white", "red", "orange", "blue", "green")  # top, -y, +y, +x, -x
    colors = [name for name in faces for _ in range(9)]
    if mixed:
        colors = random.Random(seed).sample([n for n in STICKERS for _ in range(9)], 45)
        colors[4::9] = list(faces)
    patches: dict[str, list[Mesh]] = {}
    cell = 2 * h / 3
    tile = m.rounded_rectangle(cell * 0.43, cell * 0.43, cell * 0.1, 2)
    for i, name in enumerate(colors):
        u, v = (i % 3 - 1) * cell, (i // 3 % 3 - 1) * cell
        side, lift = i // 9, h + 0.0004
        if side == 0:
            patch = m.flat(tile, 2 * h + 0.0004, (u, v))
        else:
            at = ((u, -lift), (u, lift), (lift, u), (-lift, u))[side - 1]
            facing = (-math.pi / 2, math.pi / 2, 0.0, math.pi)[side - 1]
            patch = m.upright(tile, (at[0], at[1], h + v), facing)
        patches.setdefault(name, []).append(patch)
    parts: list[Shape] = [solid(Box((h, h, h)), srgb(body), (0.0, 0.0, h), roughness=0.4)]
    parts += [visual(m.merge(*p), STICKERS[n], roughness=0.35) for n, p in patches.items()]
    grasps, top = build.box_grasps(h, h, h), (0.0, 0.0, 2 * h)
    return build.model("rubikscube", parts, "Rubik's cube", phrases, grasps, support=top)


ASSETS = build.library(
    (tea_box, TEAS), (tissue_box, TISSUES), (playing_cards, CARDS), (soap, SOAPS),
    (block, BLOCK_COLORS), (rubikscube, CUBES),
    block={"half", "color"},
)  # fmt: skip
