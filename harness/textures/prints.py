"""Surfaces without a pattern (paper, plaster, paint, leather, metal, ground) and printed ones."""

import numpy as np
from numpy.typing import NDArray

from robospa.harness.textures import field as f

PAPERS = (
    ("e9e2d0", "f5f0e4"), ("c8a97e", "d6bb94"), ("f2f2ef", "fbfbf9"), ("d9cfc0", "e6dece"),
    ("b8c4c9", "cad4d8"), ("e6c9c0", "f0dad3"), ("c9d2bd", "dae1d0"), ("b59a7a", "c5ad90"),
)  # fmt: skip
PAINTS = (
    ("dcd7cc", "ebe7de"), ("a9b8b0", "bac7c0"), ("c7b1a0", "d6c3b5"), ("8fa3b5", "a3b5c5"),
    ("d9b48f", "e6c8a9"), ("b7a4b5", "c7b7c6"), ("e0cf9f", "ecdfb9"), ("7f8f7a", "95a490"),
    ("b56b57", "c6816e"), ("4f6473", "637887"), ("cfd6d9", "e0e5e7"), ("92727a", "a68a91"),
)  # fmt: skip
BARE = (("a9a196", "c2bbb0"), ("8c8781", "a5a09a"), ("c9bfae", "ddd5c6"), ("9c7a62", "b59680"))
HIDES = (
    ("4a2f22", "6b4633"), ("26221f", "3d3733"), ("8a5a36", "a87650"), ("5a2a26", "7a3e38"),
    ("b08d68", "c6a785"), ("3b4a45", "55665f"), ("cabfb0", "ded5c9"), ("5c4636", "7d6350"),
)  # fmt: skip
METALS = (
    ("8f959b", "b5bac0"), ("6b6f75", "8c9197"), ("a58a63", "c4aa82"), ("4c5055", "686d73"),
    ("a87a5f", "c59a80"), ("9fa8a6", "c3cac8"),
)  # fmt: skip
GREENS = (
    ("4a6b2f", "6d8f45", "8fae62"), ("3f5a34", "5a7848", "7d9660"), ("6b6a35", "8c8a4f", "aca86c"),
    ("c2a878", "d4bd92", "e4d2ae"), ("5b4a38", "776350", "958069"), ("9c8a68", "b5a480", "cabb9a"),
)  # fmt: skip


def paper(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Fibres; corrugated card in style 1, crumpled in style 2."""
    t = (
        0.5 * f.noise(draw, 90, 90, 2)
        + 0.3 * f.noise(draw, 4, 4, 3)
        + 0.2 * f.noise(draw, 10, 120, 1)
    )
    picture = f.ramp(t, colors)
    if style % 3 == 1:
        return f.shaded(picture, 0.95 + 0.05 * f.wave(f.Y * draw.whole(24, 40)))
    if style % 3 == 2:
        folds = f.Cells(draw, *(draw.whole(6, 10),) * 2, 1.0)
        facet = f.each(draw, folds.number)
        slope = facet * 0.16 + folds.near * (f.each(draw, folds.number) - 0.5) * 0.2
        crease = f.smooth(folds.seam * 12)
        return f.shaded(picture, (0.86 + slope) * (0.93 + 0.07 * crease))
    return picture


def plaster(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Trowelled, or rough stucco in odd styles, lit from one side."""
    relief = f.noise(draw, 13, 19, 5) if style % 2 == 0 else f.noise(draw, 42, 42, 3)
    lit = relief[1:, 1:] - relief[:-1, :-1]
    light = np.ones(relief.shape, np.float32)
    light[1:, 1:] += lit * (2.2 if style % 2 == 0 else 0.9)
    return f.shaded(
        f.ramp(0.5 * f.noise(draw, 3, 3, 4) + 0.5 * relief, colors), np.clip(light, 0.6, 1.3)
    )


def worn(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Paint that has come off in places, over another paint or bare plaster."""
    other = draw.pick(BARE)
    top, under = f.ramp(f.noise(draw, 4, 4, 4), colors), f.ramp(f.noise(draw, 20, 20, 3), other)
    lumps = f.noise(draw, 7, 7, 5) if style % 2 == 0 else f.noise(draw, 3, 10, 5)
    gone = f.smooth((lumps - draw.number(0.66, 0.82)) * 14)
    edge = f.smooth((lumps - 0.55) * 5) * (1 - gone)
    return f.mix(f.shaded(top, 1 - 0.12 * edge), under, gone)


def leather(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Grained hide; quilted in odd styles."""
    grains = f.Cells(draw, *(draw.whole(34, 50),) * 2)
    bump = f.smooth(grains.seam * 3)
    picture = f.shaded(f.ramp(f.noise(draw, 5, 5, 4), colors), 0.72 + 0.3 * bump)
    if style % 2:
        count = draw.whole(4, 8)
        a, b = (f.X + f.Y) * count, (f.X - f.Y) * count
        near = np.minimum(np.abs(a - np.floor(a + 0.5)), np.abs(b - np.floor(b + 0.5)))
        picture = f.shaded(picture, 0.6 + 0.42 * f.smooth(near * 4))
    return picture


def cork(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Pressed crumbs of two sizes."""
    coarse = f.Cells(draw, *(draw.whole(26, 46),) * 2, 1.0)
    t = 0.6 * f.each(draw, coarse.number) + 0.4 * f.noise(draw, 80, 80, 2)
    picture = f.ramp(
        t, ("a8794a", "c69a66", "dcb887") if style % 2 == 0 else ("8a623c", "b0855a", colors[1])
    )
    crumbs = (f.each(draw, coarse.number) < 0.08).astype(np.float32) * f.smooth(coarse.seam * 5)
    return f.mix(picture, f.rgb("5e4128"), crumbs * 0.8)


def brushed(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Brushed metal; riveted or ribbed plates in odd styles."""
    picture = f.ramp(0.7 * f.noise(draw, 3, 120, 2) + 0.3 * f.noise(draw, 2, 2, 2), colors)
    if style % 2:
        count = draw.whole(2, 4)
        x, y = f.X * count, f.Y * count
        u, v = np.abs(x - np.floor(x) - 0.5), np.abs(y - np.floor(y) - 0.5)
        seam = f.smooth((0.5 - np.maximum(u, v)) * 40)
        p, q = u - 0.42, v - 0.42
        rivet = np.sqrt(p * p + q * q)
        bump = 1 + 0.22 * f.smooth((0.022 - rivet) * 90)
        picture = f.shaded(picture, (0.6 + 0.4 * seam) * bump)
    return picture


def ground(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Grass, moss, sand and soil seen from above; in odd styles with ripples or tufts."""
    t = (
        0.45 * f.noise(draw, 110, 110, 1)
        + 0.35 * f.noise(draw, 30, 30, 3)
        + 0.2 * f.noise(draw, 4, 4, 3)
    )
    if style % 2:
        t = t + 0.16 * f.wave(f.Y * draw.whole(7, 13) + f.noise(draw, 3, 3, 4) * 2.2)
    return f.ramp(t, colors)


INKS = (
    ("f3ead8", "2f4b6e", "c8553d", "e0a458"), ("21324a", "e8e2d0", "d98e73", "7fa99b"),
    ("fdf6ec", "d1495b", "edae49", "00798c"), ("dfe7e2", "3d5a50", "a3b8a4", "e07a5f"),
    ("3d405b", "f4f1de", "81b29a", "f2cc8f"), ("f7e1d7", "9d6b7a", "dd8a8a", "4a5759"),
    ("e9edc9", "606c38", "bc6c25", "dda15e"), ("222831", "eeeeee", "00adb5", "ffd369"),
    ("cfd8e3", "1d3557", "e63946", "f1faee"), ("efe6f5", "5e548e", "be95c4", "e0b1cb"),
    ("fffaf0", "264653", "2a9d8f", "e9c46a"), ("8d3b3b", "f2e3d0", "d9a066", "5a6b5d"),
)  # fmt: skip
SHARP = 40.0
"""How steep an edge of ink is, in units of a motif."""


def _paper(draw: f.Draw, picture: f.Picture) -> f.Picture:
    return f.shaded(picture, 0.95 + 0.07 * f.noise(draw, 60, 60, 3))


def _ink(distance: f.Field, scale: float = SHARP) -> f.Field:
    """1 where the signed distance is negative, with a soft edge."""
    return f.smooth(0.5 - distance * scale)


def stripes(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Bands of two to four colours: upright, lying, or slanting."""
    x, _ = ((f.X, f.Y), (f.Y, f.X), f.turned(0.4142))[style % 3]
    _, part = f.cell(x * draw.whole(4, 12))
    picture = f.filled(colors[0])
    for color in colors[1 : draw.whole(2, 4)]:
        start, wide = draw.number(0.0, 0.7), draw.number(0.06, 0.3)
        inside = np.abs(part - (start + wide / 2)) - wide / 2
        picture = f.mix(picture, f.rgb(color), _ink(inside, 30))
    return _paper(draw, picture)


def dots(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Spots in rows or staggered, of one or several colours; rings in style 2."""
    count = draw.whole(7, 16)
    row, v = f.cell(f.Y * count)
    column, u = f.cell(f.X * count + _every_other(row) * (style % 2))
    u, v = u - 0.5, v - 0.5
    radius = draw.number(0.17, 0.36)
    away = np.sqrt(u * u + v * v) - radius
    if style >= 2:
        away = np.abs(away) - draw.number(0.04, 0.08)
    which = np.floor(f.each(draw, row * 64 + column) * draw.whole(1, 3)).astype(np.int32)
    inks = np.stack([f.rgb(code) for code in colors[1:]])
    return _paper(draw, f.mix(f.filled(colors[0]), inks[which], _ink(away, 12)))


def zigzag(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Chevrons, or waves in odd styles, in two or three colours."""
    x, y = (f.X, f.Y) if style < 2 else (f.Y, f.X)
    swing = x * draw.whole(5, 11)
    tooth = np.abs(f.cell(swing)[1] - 0.5) * 2 if style % 2 == 0 else f.wave(swing) * 0.5
    _, part = f.cell(y * draw.whole(7, 14) + tooth * draw.number(0.5, 1.1))
    picture = f.mix(f.filled(colors[0]), f.rgb(colors[1]), _ink(np.abs(part - 0.25) - 0.2, 25))
    if draw.chance(0.5):
        picture = f.mix(picture, f.rgb(colors[2]), _ink(np.abs(part - 0.72) - 0.07, 25))
    return _paper(draw, picture)


def lozenges(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Argyle: diamonds of two colours, with thin lines across in odd styles."""
    a, b = (f.X * draw.number(0.9, 1.4) + f.Y), (f.X * 1.15 - f.Y)
    count = draw.whole(4, 9)
    (i, u), (j, v) = f.cell(a * count), f.cell(b * count)
    inks = np.stack([f.rgb(code) for code in colors])
    picture = inks[np.where((i + j) % 2 == 0, 0, 1 + (i % 2))]
    if style % 2:
        line = np.minimum(np.abs(u - 0.5), np.abs(v - 0.5)) - 0.02
        picture = f.mix(picture, f.rgb(colors[3]), _ink(line, 25))
    return _paper(draw, picture)


def _every_other(row: NDArray[np.int32]) -> f.Field:
    """Half a motif to the side in odd rows."""
    return (row % 2).astype(np.float32) * 0.5


def _petals(u: f.Field, v: f.Field, count: int, radius: float) -> f.Field:
    """Signed distance, roughly, from a flower of `count` (4, 6 or 8) petals."""
    best = np.full(u.shape, 9, np.float32)
    turns = {4: ((1, 0), (0, 1)), 6: ((1, 0), (0.5, 0.866), (-0.5, 0.866))}
    axes = turns.get(count, ((1, 0), (0, 1), (0.7071, 0.7071), (-0.7071, 0.7071)))
    for c, s in axes:
        along, aside = np.abs(u * c + v * s), np.abs(v * c - u * s)
        along = along - radius * 0.58
        best = np.minimum(best, np.sqrt(along * along + aside * aside * 4) - radius * 0.42)
    return best


def flowers(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Blossoms strewn evenly over a ground, large ones and, in odd styles, small ones between."""
    picture = f.filled(colors[0])
    layers = (
        ((draw.whole(4, 6), 0.40), (draw.whole(9, 13), 0.30))
        if style % 2
        else ((draw.whole(5, 9), 0.42),)
    )
    for k, (count, radius) in enumerate(layers):
        row, v = f.cell(f.Y * count)
        column, u = f.cell(f.X * count + _every_other(row))
        key = row * 64 + column
        u = u - 0.5 + (f.each(draw, key) - 0.5) * 0.25
        v = v - 0.5 + (f.each(draw, key) - 0.5) * 0.25
        size = 0.75 + 0.25 * f.each(draw, key)
        blossom = _petals(u / size, v / size, draw.pick((4, 6, 8)), radius)
        there = (f.each(draw, key) < (1.0 if k == 0 else 0.6)).astype(np.float32)
        picture = f.mix(picture, f.rgb(colors[1 + k]), _ink(blossom, 14) * there)
        heart = np.sqrt(u * u + v * v) - radius * 0.24
        picture = f.mix(picture, f.rgb(colors[3]), _ink(heart, 14) * there)
    return _paper(draw, picture)


def leaves(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Leaves along stems that run up the wall, or strewn in odd styles."""
    count = draw.whole(6, 11)
    picture = f.filled(colors[0])
    column, u = f.cell(f.X * count)
    u = u - 0.5 + f.wave(f.Y * 3 + f.each(draw, column)) * 0.08
    row, v = f.cell(f.Y * count * 1.4 + f.each(draw, column))
    v = v - 0.5
    if style % 2:
        key = row * 64 + column
        slope = f.each(draw, key) * 2 - 1
        p, q = u + v * slope, v - u * slope
        leaf = np.sqrt(p * p * 5 + q * q) - 0.36
        rib = np.maximum(np.abs(p) - 0.02, np.abs(q) - 0.3)
    else:
        picture = f.mix(picture, f.rgb(colors[2]), _ink(np.abs(u) - 0.025, 14))
        p, q = np.abs(u) - 0.22, v + np.abs(u) * 0.9
        leaf = np.sqrt(p * p * 1.6 + q * q * 6) - 0.24
        rib = np.maximum(np.abs(q) - 0.015, np.abs(p) - 0.2)
    picture = f.mix(picture, f.rgb(colors[1]), _ink(leaf, 14))
    return _paper(draw, f.mix(picture, f.rgb(colors[2]), _ink(rib, 20)))


def shapes(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Triangles, quarter circles or half circles in a grid, each in a colour of its own."""
    count = draw.whole(5, 10)
    (i, v), (j, u) = f.cell(f.Y * count), f.cell(f.X * count)
    key = i * 64 + j
    u = np.where(f.each(draw, key) < 0.5, u, 1 - u)
    v = np.where(f.each(draw, key) < 0.5, v, 1 - v)
    if style % 3 == 0:
        away = u - v
    elif style % 3 == 1:
        away = np.sqrt(u * u + v * v) - draw.number(0.75, 0.98)
    else:
        away = np.maximum(np.sqrt((u - 0.5) * (u - 0.5) + v * v) - 0.48, -v)
    inks = np.stack([f.rgb(code) for code in colors])
    first = np.floor(f.each(draw, key) * 4).astype(np.int32)
    second = (first + 1 + np.floor(f.each(draw, key) * 3).astype(np.int32)) % 4
    return _paper(draw, f.mix(inks[first], inks[second], _ink(away, 16)))


def scales(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Overlapping fans of rings, as on Japanese cloth; filled fans in odd styles."""
    count = draw.whole(6, 11)
    picture = f.filled(colors[0])
    top, down = f.cell(f.Y * count * 2)
    rings = 0 if style % 2 else draw.whole(2, 3)
    for back in (2, 1, 0):  # nearer rows are drawn over farther ones
        row = top - back + 1
        column, u = f.cell(f.X * count + _every_other(row))
        u, v = u - 0.5, (down + (back - 1)) * 0.5
        away = np.sqrt(u * u + v * v) * 2
        inside = _ink(away - 1, 12)
        other = (f.each(draw, row * 64 + column) < 0.4).astype(np.float32)
        body = f.mix(f.filled(colors[1]), f.rgb(colors[2]), other)
        line = _ink(np.abs(away - 0.93) - 0.05, 10)
        for k in range(rings):
            line = np.maximum(line, _ink(np.abs(away - 0.93 + 0.25 * (k + 1)) - 0.05, 10))
        picture = f.mix(
            picture, f.mix(body, f.rgb(colors[3] if style % 2 else colors[0]), line), inside
        )
    return _paper(draw, picture)
