"""Stone (marble, granite, terrazzo, concrete, layers, gravel), tiles and masonry."""

from __future__ import annotations

import numpy as np

from robospa.harness.textures.field import (
    Cells,
    Draw,
    Field,
    Picture,
    X,
    Y,
    cell,
    each,
    filled,
    mix,
    noise,
    ramp,
    rgb,
    shaded,
    smooth,
    turned,
    wave,
)

MARBLES = (
    ("f2f0ec", "dedcd8", "8d8c8c"), ("2b2c30", "3a3b40", "d8d4cc"), ("e9dcc8", "d9c6a8", "9c7b55"),
    ("2f4a3e", "3f5f50", "b9cfc0"), ("e8c9bf", "d9ada0", "9c5f55"), ("c9ccd2", "b2b7bf", "5b626d"),
    ("5c2b2b", "6f3a38", "d9b8ae"), ("f4efe6", "e8ddc8", "c29a4a"),
)  # fmt: skip
GRANITES = (
    ("3c3c40", "77777b", "b9b7b4"), ("8a6f68", "b79a8f", "e0cdc4"), ("5d5750", "9a9186", "d6cec0"),
    ("26282b", "44474c", "8d9297"), ("6d7580", "9aa3ad", "cfd5da"), ("7b4f43", "a87464", "d9b3a4"),
    ("c9c5bd", "aaa69e", "e4e0d8"), ("4f5a50", "7f8b7e", "b8c2b4"),
)  # fmt: skip
GROUNDS = ("e8e4dc", "d5d2cc", "3c3f44", "cfc3b2", "f1ece2", "b9c1bf", "8f8b86", "e6d3c8")
CHIPS = (
    ("b5573e", "e0b189", "6f7d74", "3e444a"),
    ("2f4858", "86bbd8", "f6ae2d", "f26419"),
    ("7a7a7a", "a9a9a9", "4a4a4a", "d0d0d0"),
    ("8a3b3b", "d99a8f", "efdcc8", "54605a"),
    ("3f5b4a", "87a58f", "cfd8c0", "b08d57"),
    ("c98f6b", "8f6b52", "e8d6c0", "5c6670"),
)
EARTHS = (
    ("b79a72", "cdb38c", "dcc7a4"), ("a4a29d", "b6b4af", "c6c5c1"), ("c4a58a", "d4b99f", "e2cdb6"),
    ("7d7c7a", "908f8c", "a2a19e"), ("9a6b4f", "b58467", "c99c80"), ("5d6266", "70767a", "848a8e"),
    ("d6d0c4", "c6bfb2", "e2ddd4"), ("6a5f55", "80746a", "988c81"),
)  # fmt: skip


def marble(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Clouds with thin veins; in odd styles a second, finer set crosses them."""
    x, y = turned(draw.number(0.1, 0.9))
    warp = noise(draw, 2, 2, 5) * draw.number(1.0, 1.8)
    picture = ramp(noise(draw, 3, 3, 5), colors[:2])
    for k in range(1 + style % 2):
        turns = x * (1.6 + 1.8 * k) + y * 0.4 + warp * (1 + k)
        thin = 1 - np.abs(wave(turns))
        thin = smooth((thin - (0.86 + 0.05 * k)) * 7) * noise(draw, 4, 4, 3)
        picture = mix(picture, rgb(colors[2]), thin * (0.85 - 0.3 * k))
    return picture


def granite(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Grains of three tones; coarse in odd styles."""
    across = draw.whole(70, 90) if style % 2 == 0 else draw.whole(38, 55)
    grains = Cells(draw, across, across)
    tone = each(draw, grains.number)
    t = 0.75 * tone + 0.25 * noise(draw, 5, 5, 3)
    return ramp(t, colors)


def terrazzo(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Chips of stone in a plain ground, small or large."""
    ground = draw.pick(GROUNDS)
    picture = shaded(filled(ground), 0.96 + 0.06 * noise(draw, 40, 40, 2))
    for across, share in ((36, 0.55), (18, 0.5)) if style % 2 == 0 else ((22, 0.6), (12, 0.55)):
        chips = Cells(draw, across, across)
        there = each(draw, chips.number) < (share)
        size = 0.12 + each(draw, chips.number) * 0.25
        inside = smooth((chips.seam - size) * 8) * there
        tone = ramp(each(draw, chips.number), colors)
        picture = mix(picture, tone, inside)
    return picture


def concrete(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Cast and smoothed, with pores; in odd styles in slabs."""
    t = 0.65 * noise(draw, 3, 3, 5) + 0.35 * noise(draw, 60, 60, 2)
    picture = ramp(t, colors)
    pores = smooth((noise(draw, 55, 55, 1) - 0.93) * 20)
    picture = shaded(picture, 1 - 0.35 * pores)
    if style % 2:
        x, y = X * draw.whole(2, 4), Y * draw.whole(2, 3)
        edge = np.minimum(np.abs(x - np.floor(x + 0.5)), np.abs(y - np.floor(y + 0.5)))
        picture = shaded(picture, 0.6 + 0.4 * smooth(edge * 50))
    return picture


def layered(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Sandstone's or travertine's bands."""
    low, high = ((-0.08, 0.08), (0.3, 0.5))[style % 2]
    _, y = turned(draw.number(low, high))
    bands = y * draw.number(5, 10) + noise(draw, 2, 4, 4) * 1.4
    t = 0.5 + 0.25 * wave(bands) + 0.2 * wave(bands * 2.7)
    grit = noise(draw, 100, 100, 1)
    return shaded(ramp(t, colors), 0.92 + 0.12 * grit)


def gravel(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Pebbles, or a wall of field stones in odd styles."""
    across = draw.whole(16, 26) if style % 2 == 0 else draw.whole(9, 14)
    stones = Cells(draw, across, across, 0.8)
    gap = smooth(stones.seam * (4 if style % 2 == 0 else 7))
    t = 0.7 * each(draw, stones.number) + 0.3 * noise(draw, 20, 20, 3)
    dome = 1.08 - 0.35 * stones.near * stones.near
    return shaded(ramp(t, colors), (0.4 + 0.6 * gap) * dome)


GLAZES = (
    ("dfe9ee", "f3f8fa"), ("20639b", "3a7fb8"), ("f0e4d0", "fbf4e6"), ("2d6a4f", "479a77"),
    ("b5533c", "cf7356"), ("3c3f46", "555962"), ("e3b7a8", "f0cec2"), ("8fb8b5", "b2d3d0"),
    ("d6a23c", "e8bd62"), ("6d5a7a", "8c789a"), ("c9cdd1", "e2e5e8"), ("7a8f5a", "9bb078"),
)  # fmt: skip
BRICKS = (
    ("8e3b2a", "a94f3a", "bf6a52"), ("a86b4a", "bf8562", "d19e7e"), ("6f5a50", "877166", "a08c80"),
    ("c7b59c", "d8c9b3", "e6dac8"), ("e4e1dc", "efedea", "d4d0ca"), ("5a4a48", "6f5c58", "86716c"),
    ("9c4a35", "7e3526", "b8664c"), ("b08a62", "9a744e", "c6a37e"),
)  # fmt: skip
GROUTS = ("d8d4cc", "b9b5ae", "8c8984", "efece6", "5c5a57")


def _edge(x: Field, y: Field, wide: float) -> Field:
    """Distance from a tile's edge, in units of the shorter side; `wide` is length over height."""
    u, v = np.minimum(x, 1 - x) * (wide), np.minimum(y, 1 - y)
    return np.minimum(u, v)


def _laid(draw: Draw, tile: Picture, edge: Field, joint: float) -> Picture:
    """Tiles with a bevel in a joint of grout."""
    ground = shaded(
        np.broadcast_to(rgb(draw.pick(GROUTS)), tile.shape),
        0.9 + 0.15 * noise(draw, 80, 80, 1),
    )
    face = smooth((edge - (joint)) * 30)
    bevel = 0.86 + 0.14 * smooth((edge - (joint)) * 9)
    return mix(ground, shaded(tile, bevel), face)


def square(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Glazed squares; in odd styles some carry a second colour."""
    count = draw.whole(7, 14)
    x, y = X * count, Y * (count if style < 2 else max(4, count - 4))
    (i, v), (j, u) = cell(y), cell(x)
    tone = each(draw, i * 64 + j)
    tile = ramp(0.75 * tone + 0.25 * noise(draw, 6, 6, 3), colors)
    if style % 2:
        other = draw.pick(GLAZES)
        tile = mix(tile, rgb(other[0]), (each(draw, i * 64 + j) < 0.16).astype(np.float32))
    return _laid(draw, tile, _edge(u, v, 1.0), draw.number(0.02, 0.05))


def chequer(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """A floor of two colours of tiles, straight or on its point."""
    count = draw.whole(6, 12)
    x, y = (X, Y) if style % 2 == 0 else ((X + Y) * 0.75, (X - Y + 1) * 0.75)
    x, y = x * count, y * count
    (i, v), (j, u) = cell(y), cell(x)
    other = draw.pick(GLAZES)
    while other == colors:
        other = draw.pick(GLAZES)
    cloud = noise(draw, 5, 5, 4)
    even = ((i + j) % 2 == 0).astype(np.float32)
    tile = mix(ramp(cloud, colors), ramp(cloud, other), even)
    return _laid(draw, tile, _edge(u, v, 1.0), draw.number(0.008, 0.025))


def brick(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Courses of bricks in mortar, half a brick apart; a third in odd styles."""
    rows = draw.whole(10, 18)
    i, v = cell(Y * rows)
    shift = (i % (2 + style % 2)).astype(np.float32) / (2 + style % 2)
    j, u = cell(X * (rows / draw.number(2.4, 3.2)) + shift)
    rough = noise(draw, 70, 70, 2)
    t = 0.65 * each(draw, i * 64 + j) + 0.35 * rough
    wobble = (noise(draw, 25, 25, 2) - 0.5) * 0.05
    tile = shaded(ramp(t, colors), 0.85 + 0.2 * rough)
    return _laid(draw, tile, _edge(u, v, 2.6) + wobble, draw.number(0.05, 0.09))


def hexagons(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Hexagonal tiles: one glaze, or a few darker ones among them in odd styles."""
    count = draw.whole(7, 14)
    root = 1.7320508
    x, y = X * count, Y * count
    best, number = np.full_like(X, 9), np.zeros(X.shape, np.int32)
    for shift in (0.0, 0.5):  # hexagons are the cells of two interlaced grids
        h = shift
        j, i = np.floor(x - h + 0.5), np.floor((y / root) - h + 0.5)
        dx, dy = x - (j + h), y - (i + h) * root
        gap = np.maximum(np.abs(dx), 0.5 * np.abs(dx) + 0.8660254 * np.abs(dy))
        nearer = gap < best
        best = np.minimum(best, gap)
        index = ((i * 2 + shift * 2) * 64 + j).astype(np.int32)
        number = np.where(nearer, index, number)
    tone = each(draw, number)
    tile = ramp(0.8 * tone + 0.2 * noise(draw, 8, 8, 2), colors)
    if style % 2:
        dark = (each(draw, number) < 0.25).astype(np.float32)
        tile = mix(tile, rgb(draw.pick(GLAZES)[0]), dark)
    return _laid(draw, tile, 0.5 - best, draw.number(0.02, 0.05))


def mosaic(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Small pieces of two or three glazes, square or broken."""
    second, third = draw.pick(GLAZES), draw.pick(GLAZES)
    palette = (colors[0], colors[1], second[0], colors[0], third[1])
    if style % 2 == 0:
        count = draw.whole(16, 26)
        x, y = X * count, Y * count
        (i, v), (j, u) = cell(y), cell(x)
        number, edge = i * 64 + j, _edge(u, v, 1.0)
    else:
        pieces = Cells(draw, *(draw.whole(12, 20),) * 2)
        number, edge = pieces.number, pieces.seam * 0.5
    tile = ramp(np.floor(each(draw, number) * 5) / 4, palette)
    tile = shaded(tile, 0.9 + 0.15 * each(draw, number))
    return _laid(draw, tile, edge, 0.06)
