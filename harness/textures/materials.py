"""Wood, cloth, stone, tiles and masonry: what has a grain, threads, grains or joints."""

import numpy as np

from robospa.harness.textures import field as f

WOODS = (
    ("6b4423", "8f6138", "a97a4a"), ("c49a6c", "d8b384", "e6c79c"), ("3e2718", "57382a", "6e4a36"),
    ("a5683a", "bf8350", "d39a66"), ("d9c3a0", "e6d5b8", "efe3cc"), ("7a3b22", "974e2f", "ad6440"),
    ("8a7a68", "a3937f", "b8a995"), ("b08a5a", "c8a470", "d7b888"), ("5a4a3c", "766352", "8f7b68"),
    ("9b5b2b", "b87a3e", "cf9a58"), ("4a3a30", "3a2c24", "5c493c"), ("cbb08a", "b99a70", "dcc8a6"),
)  # fmt: skip


def _grain(draw: f.Draw, along: f.Field, across: f.Field, rings: float) -> f.Field:
    """Rings 0..1 that run along one direction, with pores; `across` in boards' widths."""
    bend = f.noise(draw, 2, 3, 3) if along is f.X else f.noise(draw, 3, 2, 3)
    fine = f.noise(draw, 5, 90, 2) if along is f.X else f.noise(draw, 90, 5, 2)
    _, saw = f.cell((across + bend * 0.22) * rings)
    lines = np.where(saw < 0.8, saw * 1.25, (1 - saw) * 5)
    result: f.Field = 0.5 * lines + 0.5 * fine
    return result


def veneer(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """One sheet with its grain along x, or along y."""
    along, across = (f.X, f.Y) if style % 2 == 0 else (f.Y, f.X)
    grain = _grain(draw, along, across, draw.number(10, 20))
    broad = f.noise(draw, 2, 2, 2)
    t = 0.65 * grain + 0.35 * broad
    if style >= 2:  # a flat-sawn heart: arches along the middle
        off = np.abs(across - draw.number(0.35, 0.65))
        arch = (off * off * 9 + along * 0.8 + f.noise(draw, 2, 2, 3) * 0.25) * 6
        _, saw = f.cell(arch)
        t = 0.5 * t + 0.5 * saw * saw
    return f.ramp(1 - t, colors)


def boards(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Boards side by side, each with its own tone; in styles 2 and 3 with butt joints."""
    along, across = (f.X, f.Y) if style % 2 == 0 else (f.Y, f.X)
    count = draw.whole(5, 11)
    board, part = f.cell(across * count)
    edge = np.minimum(part, 1 - part)
    seam = f.smooth(edge / 0.03 - 0.2)
    if style >= 2:
        start = f.each(draw, board)
        length = draw.number(1.6, 2.6)
        piece, part = f.cell(along * length + start * 3)
        end = np.minimum(part, 1 - part) / length * count
        seam = seam * f.smooth(end / 0.03 - 0.2)
        board = board * 31 + piece
    tone = f.each(draw, board)
    shift = f.each(draw, board)
    grain = _grain(draw, along, across + shift * 3, draw.number(10, 22))
    t = 0.5 * grain + 0.5 * tone
    return f.shaded(f.ramp(1 - t, colors), 0.45 + 0.55 * seam)


def parquet(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Basket weave of short strips, or a chequer of turned squares."""
    count = draw.whole(5, 10)
    strips = draw.whole(3, 5)
    (i, v), (j, u) = f.cell(f.Y * count), f.cell(f.X * count)
    flat = (i + j) % 2 == 0
    strip, part = f.cell(np.where(flat, v, u) * strips)
    edge = np.minimum(part, 1 - part) / strips
    ends = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1 - v))
    seam = f.smooth(np.minimum(edge, ends) / 0.02)
    tone = f.each(draw, (i * 97 + j * 13) * (1 if style % 2 else 7) + strip)
    fine = np.where(flat, f.noise(draw, 12, 110, 2), f.noise(draw, 110, 12, 2))
    t = 0.6 * tone + 0.4 * fine
    return f.shaded(f.ramp(t, colors), 0.55 + 0.45 * seam)


def slats(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Rounded slats with dark gaps, upright or lying."""
    across = f.X if style % 2 == 0 else f.Y
    place = across * draw.whole(12, 24)
    slat, _ = f.cell(place)
    round_off = f.wave(place)  # 1 in the gap, -1 on the crest
    fine = f.noise(draw, 90, 4, 2) if style % 2 == 0 else f.noise(draw, 4, 90, 2)
    t = 0.4 * f.each(draw, slat) + 0.6 * fine
    light = 0.80 - 0.28 * round_off * np.abs(round_off)
    return f.shaded(f.ramp(t, colors), light)


CLOTHS = (
    ("c9b79c", "e0d2bc"), ("3a4f73", "56709a"), ("8a2f3c", "a94a57"), ("4f6b4a", "6d8a66"),
    ("d8d5cf", "efedea"), ("2f3136", "4a4d54"), ("c98a3c", "dfa860"), ("7a5f8a", "977ba8"),
    ("5f8f96", "7fabb2"), ("d6a4a0", "e8c2be"), ("8c7355", "a98f70"), ("b9473a", "d0665a"),
    ("e3cf8f", "efe0b0"), ("50646e", "6f848e"),
)  # fmt: skip
TARTANS = (
    ("8e1f2b", "1f3a2c", "f0d264"), ("1f3557", "2f5d46", "e6e2d6"), ("d9cdb8", "7a3b34", "35506b"),
    ("3b3b40", "9a9a9e", "b8302f"), ("e8dcc6", "30303a", "b33a36"), ("2d5a46", "14283a", "d9dcc9"),
    ("7d5a7a", "3f3350", "e0cfe0"), ("c06a2f", "4a3526", "efdcc0"),
)  # fmt: skip


def _threads(draw: f.Draw) -> f.Field:
    """Light of single threads, too fine to be told apart from far."""
    fine = draw.whole(56, 84)
    light = 0.94 + 0.04 * (f.wave(f.X * fine) + f.wave(f.Y * fine)) * 0.5
    result: f.Field = light + 0.10 * (f.noise(draw, 120, 6, 2) + f.noise(draw, 6, 120, 2) - 1)
    return result


def weave(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Linen and canvas: slubs along both threads; coarse burlap in odd styles."""
    if style % 2:
        count = draw.whole(30, 44)
        x, y = f.X * count, f.Y * count
        over = (f.cell(x)[0] + f.cell(y)[0]) % 2 == 0
        bump = np.where(over, 1 - np.abs(f.wave(y * 0.5)), 1 - np.abs(f.wave(x * 0.5)))
        slub = np.where(over, f.noise(draw, 8, count, 2), f.noise(draw, count, 8, 2))
        return f.shaded(f.ramp(slub, colors), 0.72 + 0.32 * bump)
    t = 0.5 * f.noise(draw, 6, 110, 3) + 0.5 * f.noise(draw, 110, 6, 3)
    return f.shaded(f.ramp(t, colors), _threads(draw))


def twill(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Denim's slanting lines; herringbone in odd styles."""
    count = draw.whole(34, 52)
    y = f.Y * count
    if style % 2:
        folded = np.abs(f.cell(f.X * draw.whole(6, 12))[1] - 0.5) * (count / 6)
        line = f.wave(folded + y * 0.6)
    else:
        line = f.wave(f.X * count + y)
    worn = f.noise(draw, 3, 3, 4)
    t = 0.45 + 0.25 * line + 0.5 * (worn - 0.5) + 0.2 * (f.noise(draw, 90, 90, 1) - 0.5)
    return f.ramp(t, colors)


def _band(draw: f.Draw, place: f.Field, bands: tuple[tuple[float, float, int], ...]) -> f.Field:
    """Which colour (0, 1, 2) the threads have at `place` of a repeat."""
    found = np.zeros(place.shape, np.float32)
    _, part = f.cell(place)
    for start, wide, color in bands:
        found = np.where((part >= start) & (part < start + wide), color, found)
    return found


def tartan(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Bands of three colours across each other, as threads mix them."""
    repeat = draw.whole(3, 6)
    a, b = draw.number(0.2, 0.35), draw.number(0.55, 0.7)
    thin = draw.number(0.03, 0.06)
    bands = ((a, 0.22, 1), (b, thin, 2), (b + 0.12, thin, 1), (0.08, thin, 2 if style % 2 else 1))
    stops = np.stack([f.rgb(code) for code in colors])
    warp = stops[_band(draw, f.X * repeat, bands).astype(np.int32)]
    weft = stops[_band(draw, f.Y * repeat, bands).astype(np.int32)]
    return f.shaded((warp + weft) / 2, _threads(draw))


def gingham(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Checks of white and one colour; thin window-pane lines in odd styles."""
    count = draw.whole(8, 18)
    wide = 0.5 if style % 2 == 0 else draw.number(0.1, 0.16)
    across = (f.cell(f.X * count)[1] < wide).astype(np.float32)
    down = (f.cell(f.Y * count)[1] < wide).astype(np.float32)
    picture = f.mix(f.filled("f4f2ec"), f.rgb(colors[0]), (across + down) * 0.5)
    return f.shaded(picture, _threads(draw))


def knit(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Rows of V-shaped stitches; in odd styles with bands of a second wool."""
    columns, rows = draw.whole(22, 32), draw.whole(26, 38)
    u = np.abs(f.cell(f.X * columns)[1] - 0.5)
    row, v = f.cell(f.Y * rows + u * 1.6)
    v = np.abs(v - 0.5)
    wool = f.smooth((0.5 - v) * 5) * f.smooth((0.5 - u) * 9 + 0.2) * (0.6 + 0.4 * f.smooth(u * 9))
    picture = f.ramp(0.5 * f.each(draw, row) + 0.5 * f.noise(draw, 40, 40, 2), colors)
    if style % 2:
        other = draw.pick(CLOTHS)
        band = (f.each(draw, row // draw.whole(3, 6)) < 0.4).astype(np.float32)
        picture = f.mix(picture, f.rgb(other[0]), band)
    return f.shaded(picture, 0.55 + 0.5 * wool)


def felt(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Short fibres without a direction; a mottled carpet in odd styles."""
    t = 0.55 * f.noise(draw, 120, 120, 2) + 0.45 * f.noise(draw, 12, 12, 3)
    if style % 2:
        other = draw.pick(CLOTHS)
        spots = f.smooth((f.noise(draw, 60, 60, 2) - 0.55) * 6)
        return f.mix(f.ramp(t, colors), f.rgb(other[1]), spots * 0.7)
    return f.ramp(t, colors)


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


def marble(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Clouds with thin veins; in odd styles a second, finer set crosses them."""
    x, y = f.turned(draw.number(0.1, 0.9))
    warp = f.noise(draw, 2, 2, 5) * draw.number(1.0, 1.8)
    picture = f.ramp(f.noise(draw, 3, 3, 5), colors[:2])
    for k in range(1 + style % 2):
        turns = x * (1.6 + 1.8 * k) + y * 0.4 + warp * (1 + k)
        thin = 1 - np.abs(f.wave(turns))
        thin = f.smooth((thin - (0.86 + 0.05 * k)) * 7) * f.noise(draw, 4, 4, 3)
        picture = f.mix(picture, f.rgb(colors[2]), thin * (0.85 - 0.3 * k))
    return picture


def granite(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Grains of three tones; coarse in odd styles."""
    across = draw.whole(70, 90) if style % 2 == 0 else draw.whole(38, 55)
    grains = f.Cells(draw, across, across)
    t = 0.75 * f.each(draw, grains.number) + 0.25 * f.noise(draw, 5, 5, 3)
    return f.ramp(t, colors)


def terrazzo(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Chips of stone in a plain ground, small or large."""
    picture = f.shaded(f.filled(draw.pick(GROUNDS)), 0.96 + 0.06 * f.noise(draw, 40, 40, 2))
    for across, share in ((36, 0.55), (18, 0.5)) if style % 2 == 0 else ((22, 0.6), (12, 0.55)):
        chips = f.Cells(draw, across, across)
        there = f.each(draw, chips.number) < share
        size = 0.12 + f.each(draw, chips.number) * 0.25
        inside = f.smooth((chips.seam - size) * 8) * there
        tone = f.ramp(f.each(draw, chips.number), colors)
        picture = f.mix(picture, tone, inside)
    return picture


def concrete(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Cast and smoothed, with pores; in odd styles in slabs."""
    t = 0.65 * f.noise(draw, 3, 3, 5) + 0.35 * f.noise(draw, 60, 60, 2)
    picture = f.ramp(t, colors)
    pores = f.smooth((f.noise(draw, 55, 55, 1) - 0.93) * 20)
    picture = f.shaded(picture, 1 - 0.35 * pores)
    if style % 2:
        x, y = f.X * draw.whole(2, 4), f.Y * draw.whole(2, 3)
        edge = np.minimum(np.abs(x - np.floor(x + 0.5)), np.abs(y - np.floor(y + 0.5)))
        picture = f.shaded(picture, 0.6 + 0.4 * f.smooth(edge * 50))
    return picture


def layered(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Sandstone's or travertine's bands."""
    low, high = ((-0.08, 0.08), (0.3, 0.5))[style % 2]
    _, y = f.turned(draw.number(low, high))
    bands = y * draw.number(5, 10) + f.noise(draw, 2, 4, 4) * 1.4
    t = 0.5 + 0.25 * f.wave(bands) + 0.2 * f.wave(bands * 2.7)
    grit = f.noise(draw, 100, 100, 1)
    return f.shaded(f.ramp(t, colors), 0.92 + 0.12 * grit)


def gravel(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Pebbles, or a wall of field stones in odd styles."""
    across = draw.whole(16, 26) if style % 2 == 0 else draw.whole(9, 14)
    stones = f.Cells(draw, across, across, 0.8)
    gap = f.smooth(stones.seam * (4 if style % 2 == 0 else 7))
    t = 0.7 * f.each(draw, stones.number) + 0.3 * f.noise(draw, 20, 20, 3)
    dome = 1.08 - 0.35 * stones.near * stones.near
    return f.shaded(f.ramp(t, colors), (0.4 + 0.6 * gap) * dome)


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


def _edge(x: f.Field, y: f.Field, wide: float) -> f.Field:
    """Distance from a tile's edge, in units of the shorter side; `wide` is length over height."""
    return np.minimum(np.minimum(x, 1 - x) * wide, np.minimum(y, 1 - y))


def _laid(draw: f.Draw, tile: f.Picture, edge: f.Field, joint: float) -> f.Picture:
    """Tiles with a bevel in a joint of grout."""
    ground = f.shaded(
        np.broadcast_to(f.rgb(draw.pick(GROUTS)), tile.shape),
        0.9 + 0.15 * f.noise(draw, 80, 80, 1),
    )
    face = f.smooth((edge - joint) * 30)
    bevel = 0.86 + 0.14 * f.smooth((edge - joint) * 9)
    return f.mix(ground, f.shaded(tile, bevel), face)


def square(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Glazed squares; in odd styles some carry a second colour."""
    count = draw.whole(7, 14)
    x, y = f.X * count, f.Y * (count if style < 2 else max(4, count - 4))
    (i, v), (j, u) = f.cell(y), f.cell(x)
    tone = f.each(draw, i * 64 + j)
    tile = f.ramp(0.75 * tone + 0.25 * f.noise(draw, 6, 6, 3), colors)
    if style % 2:
        other = draw.pick(GLAZES)
        tile = f.mix(tile, f.rgb(other[0]), (f.each(draw, i * 64 + j) < 0.16).astype(np.float32))
    return _laid(draw, tile, _edge(u, v, 1.0), draw.number(0.02, 0.05))


def chequer(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """A floor of two colours of tiles, straight or on its point."""
    count = draw.whole(6, 12)
    x, y = (f.X, f.Y) if style % 2 == 0 else ((f.X + f.Y) * 0.75, (f.X - f.Y + 1) * 0.75)
    x, y = x * count, y * count
    (i, v), (j, u) = f.cell(y), f.cell(x)
    other = draw.pick(GLAZES)
    while other == colors:
        other = draw.pick(GLAZES)
    cloud = f.noise(draw, 5, 5, 4)
    even = ((i + j) % 2 == 0).astype(np.float32)
    tile = f.mix(f.ramp(cloud, colors), f.ramp(cloud, other), even)
    return _laid(draw, tile, _edge(u, v, 1.0), draw.number(0.008, 0.025))


def brick(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Courses of bricks in mortar, half a brick apart; a third in odd styles."""
    rows = draw.whole(10, 18)
    i, v = f.cell(f.Y * rows)
    shift = (i % (2 + style % 2)).astype(np.float32) / (2 + style % 2)
    j, u = f.cell(f.X * (rows / draw.number(2.4, 3.2)) + shift)
    rough = f.noise(draw, 70, 70, 2)
    t = 0.65 * f.each(draw, i * 64 + j) + 0.35 * rough
    wobble = (f.noise(draw, 25, 25, 2) - 0.5) * 0.05
    tile = f.shaded(f.ramp(t, colors), 0.85 + 0.2 * rough)
    return _laid(draw, tile, _edge(u, v, 2.6) + wobble, draw.number(0.05, 0.09))


def hexagons(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Hexagonal tiles: one glaze, or a few darker ones among them in odd styles."""
    count = draw.whole(7, 14)
    root = 1.7320508
    x, y = f.X * count, f.Y * count
    best, number = np.full_like(f.X, 9), np.zeros(f.X.shape, np.int32)
    for h in (0.0, 0.5):  # hexagons are the cells of two interlaced grids
        j, i = np.floor(x - h + 0.5), np.floor((y / root) - h + 0.5)
        dx, dy = x - (j + h), y - (i + h) * root
        gap = np.maximum(np.abs(dx), 0.5 * np.abs(dx) + 0.8660254 * np.abs(dy))
        nearer = gap < best
        best = np.minimum(best, gap)
        number = np.where(nearer, ((i * 2 + h * 2) * 64 + j).astype(np.int32), number)
    tile = f.ramp(0.8 * f.each(draw, number) + 0.2 * f.noise(draw, 8, 8, 2), colors)
    if style % 2:
        dark = (f.each(draw, number) < 0.25).astype(np.float32)
        tile = f.mix(tile, f.rgb(draw.pick(GLAZES)[0]), dark)
    return _laid(draw, tile, 0.5 - best, draw.number(0.02, 0.05))


def mosaic(draw: f.Draw, colors: tuple[str, ...], style: int) -> f.Picture:
    """Small pieces of two or three glazes, square or broken."""
    second, third = draw.pick(GLAZES), draw.pick(GLAZES)
    palette = (colors[0], colors[1], second[0], colors[0], third[1])
    if style % 2 == 0:
        count = draw.whole(16, 26)
        (i, v), (j, u) = f.cell(f.Y * count), f.cell(f.X * count)
        number, edge = i * 64 + j, _edge(u, v, 1.0)
    else:
        pieces = f.Cells(draw, *(draw.whole(12, 20),) * 2)
        number, edge = pieces.number, pieces.seam * 0.5
    tile = f.ramp(np.floor(f.each(draw, number) * 5) / 4, palette)
    tile = f.shaded(tile, 0.9 + 0.15 * f.each(draw, number))
    return _laid(draw, tile, edge, 0.06)
