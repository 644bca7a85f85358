"""Wood (veneer, boards, parquet, slats) and cloth (weave, twill, checks, tartan, knit, felt)."""

from __future__ import annotations

import numpy as np

from robospa.harness.textures.field import (
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
    wave,
)

WOODS = (
    ("6b4423", "8f6138", "a97a4a"), ("c49a6c", "d8b384", "e6c79c"), ("3e2718", "57382a", "6e4a36"),
    ("a5683a", "bf8350", "d39a66"), ("d9c3a0", "e6d5b8", "efe3cc"), ("7a3b22", "974e2f", "ad6440"),
    ("8a7a68", "a3937f", "b8a995"), ("b08a5a", "c8a470", "d7b888"), ("5a4a3c", "766352", "8f7b68"),
    ("9b5b2b", "b87a3e", "cf9a58"), ("4a3a30", "3a2c24", "5c493c"), ("cbb08a", "b99a70", "dcc8a6"),
)  # fmt: skip


def _grain(draw: Draw, along: Field, across: Field, rings: float) -> Field:
    """Rings 0..1 that run along one direction, with pores; `across` in boards' widths."""
    bend = noise(draw, 2, 3, 3) if along is X else noise(draw, 3, 2, 3)
    fine = noise(draw, 5, 90, 2) if along is X else noise(draw, 90, 5, 2)
    ring = (across + bend * 0.22) * (rings)
    _, saw = cell(ring)
    lines = np.where(saw < 0.8, saw * 1.25, (1 - saw) * 5)
    result: Field = 0.5 * lines + 0.5 * fine
    return result


def veneer(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """One sheet with its grain along x, or along y."""
    along, across = (X, Y) if style % 2 == 0 else (Y, X)
    grain = _grain(draw, along, across, draw.number(10, 20))
    broad = noise(draw, 2, 2, 2)
    t = 0.65 * grain + 0.35 * broad
    if style >= 2:  # a flat-sawn heart: arches along the middle
        off = np.abs(across - draw.number(0.35, 0.65))
        arch = (off * off * 9 + along * 0.8 + noise(draw, 2, 2, 3) * 0.25) * 6
        _, saw = cell(arch)
        t = 0.5 * t + 0.5 * saw * saw
    return ramp(1 - t, colors)


def boards(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Boards side by side, each with its own tone; in styles 2 and 3 with butt joints."""
    along, across = (X, Y) if style % 2 == 0 else (Y, X)
    count = draw.whole(5, 11)
    place = across * count
    board, part = cell(place)
    edge = np.minimum(part, 1 - part)
    seam = smooth(edge / 0.03 - 0.2)
    if style >= 2:
        start = each(draw, board)
        length = draw.number(1.6, 2.6)
        run = along * length + start * 3
        piece, part = cell(run)
        end = np.minimum(part, 1 - part) / length * count
        seam = seam * smooth(end / 0.03 - 0.2)
        board = board * 31 + piece
    tone = each(draw, board)
    shift = each(draw, board)
    grain = _grain(draw, along, across + shift * 3, draw.number(10, 22))
    t = 0.5 * grain + 0.5 * tone
    return shaded(ramp(1 - t, colors), 0.45 + 0.55 * seam)


def parquet(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Basket weave of short strips, or a chequer of turned squares."""
    count = draw.whole(5, 10)
    strips = draw.whole(3, 5)
    x, y = X * count, Y * count
    (i, v), (j, u) = cell(y), cell(x)
    flat = (i + j) % 2 == 0
    across = np.where(flat, v, u) * strips
    strip, part = cell(across)
    edge = np.minimum(part, 1 - part) / strips
    ends = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1 - v))
    seam = smooth(np.minimum(edge, ends) / 0.02)
    tone = each(draw, (i * 97 + j * 13) * (1 if style % 2 else 7) + strip)
    fine = np.where(flat, noise(draw, 12, 110, 2), noise(draw, 110, 12, 2))
    t = 0.6 * tone + 0.4 * fine
    return shaded(ramp(t, colors), 0.55 + 0.45 * seam)


def slats(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Rounded slats with dark gaps, upright or lying."""
    across = X if style % 2 == 0 else Y
    place = across * draw.whole(12, 24)
    slat, _ = cell(place)
    round_off = wave(place)  # 1 in the gap, -1 on the crest
    fine = noise(draw, 90, 4, 2) if style % 2 == 0 else noise(draw, 4, 90, 2)
    t = 0.4 * each(draw, slat) + 0.6 * fine
    light = 0.80 - 0.28 * round_off * np.abs(round_off)
    return shaded(ramp(t, colors), light)


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


def _threads(draw: Draw) -> Field:
    """Light of single threads, too fine to be told apart from far."""
    fine = draw.whole(56, 84)
    light = 0.94 + 0.04 * (wave(X * fine) + wave(Y * fine)) * 0.5
    result: Field = light + 0.10 * (noise(draw, 120, 6, 2) + noise(draw, 6, 120, 2) - 1)
    return result


def weave(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Linen and canvas: slubs along both threads; coarse burlap in odd styles."""
    if style % 2:
        count = draw.whole(30, 44)
        x, y = X * count, Y * count
        over = (cell(x)[0] + cell(y)[0]) % 2 == 0
        bump = np.where(over, 1 - np.abs(wave(y * 0.5)), 1 - np.abs(wave(x * 0.5)))
        slub = np.where(over, noise(draw, 8, count, 2), noise(draw, count, 8, 2))
        return shaded(ramp(slub, colors), 0.72 + 0.32 * bump)
    t = 0.5 * noise(draw, 6, 110, 3) + 0.5 * noise(draw, 110, 6, 3)
    return shaded(ramp(t, colors), _threads(draw))


def twill(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Denim's slanting lines; herringbone in odd styles."""
    count = draw.whole(34, 52)
    y = Y * count
    if style % 2:
        column = X * draw.whole(6, 12)
        folded = np.abs(cell(column)[1] - 0.5) * (count / 6)
        line = wave(folded + y * 0.6)
    else:
        line = wave(X * count + y)
    worn = noise(draw, 3, 3, 4)
    t = 0.45 + 0.25 * line + 0.5 * (worn - 0.5) + 0.2 * (noise(draw, 90, 90, 1) - 0.5)
    return ramp(t, colors)


def _band(draw: Draw, place: Field, bands: tuple[tuple[float, float, int], ...]) -> Field:
    """Which colour (0, 1, 2) the threads have at `place` of a repeat."""
    found = np.zeros(place.shape, np.float32)
    _, part = cell(place)
    for start, wide, color in bands:
        found = np.where((part >= start) & (part < start + wide), color, found)
    return found


def tartan(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Bands of three colours across each other, as threads mix them."""
    repeat = draw.whole(3, 6)
    a, b = draw.number(0.2, 0.35), draw.number(0.55, 0.7)
    thin = draw.number(0.03, 0.06)
    bands = ((a, 0.22, 1), (b, thin, 2), (b + 0.12, thin, 1), (0.08, thin, 2 if style % 2 else 1))
    stops = np.stack([rgb(code) for code in colors])
    warp = stops[_band(draw, X * repeat, bands).astype(np.int32)]
    weft = stops[_band(draw, Y * repeat, bands).astype(np.int32)]
    return shaded((warp + weft) / 2, _threads(draw))


def gingham(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Checks of white and one colour; thin window-pane lines in odd styles."""
    count = draw.whole(8, 18)
    wide = 0.5 if style % 2 == 0 else draw.number(0.1, 0.16)
    x, y = X * count, Y * count
    across = (cell(x)[1] < wide).astype(np.float32)
    down = (cell(y)[1] < wide).astype(np.float32)
    share = (across + down) * 0.5
    picture = mix(filled("f4f2ec"), rgb(colors[0]), share)
    return shaded(picture, _threads(draw))


def knit(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Rows of V-shaped stitches; in odd styles with bands of a second wool."""
    columns, rows = draw.whole(22, 32), draw.whole(26, 38)
    x = X * columns
    u = np.abs(cell(x)[1] - 0.5)
    y = Y * rows + u * 1.6
    row, v = cell(y)
    v = np.abs(v - 0.5)
    wool = smooth((0.5 - v) * 5) * smooth((0.5 - u) * 9 + 0.2) * (0.6 + 0.4 * smooth(u * 9))
    picture = ramp(0.5 * each(draw, row) + 0.5 * noise(draw, 40, 40, 2), colors)
    if style % 2:
        other = draw.pick(CLOTHS)
        band = (each(draw, row // draw.whole(3, 6)) < 0.4).astype(np.float32)
        picture = mix(picture, rgb(other[0]), band)
    return shaded(picture, 0.55 + 0.5 * wool)


def felt(draw: Draw, colors: tuple[str, ...], style: int) -> Picture:
    """Short fibres without a direction; a mottled carpet in odd styles."""
    t = 0.55 * noise(draw, 120, 120, 2) + 0.45 * noise(draw, 12, 12, 3)
    if style % 2:
        other = draw.pick(CLOTHS)
        spots = smooth((noise(draw, 60, 60, 2) - 0.55) * 6)
        return mix(ramp(t, colors), rgb(other[1]), spots * 0.7)
    return ramp(t, colors)
