"""What colours look like: the named ones, the table's, and how far apart two of them are.

Colours of things are linear RGB. The head camera shows them by the renderer's curve; differences
are CIEDE2000 (Sharma, Wu and Dalal, Color Research and Application 30, 2005), in which 20 is plain
to see across a picture and 2 hardly side by side.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robospa.tasks.shapes import Color

Array = NDArray[np.float64]

NAMED: Mapping[str, Color] = {
    "red": (0.75, 0.0, 0.0), "green": (0.0, 0.42, 0.03), "blue": (0.0, 0.1, 1.0),
    "yellow": (1.0, 0.86, 0.0), "cyan": (0.0, 1.0, 1.0), "magenta": (1.0, 0.0, 1.0),
    "white": (1.0, 1.0, 1.0), "black": (0.004, 0.004, 0.004), "gray": (0.24, 0.24, 0.24),
    "orange": (1.0, 0.32, 0.0), "purple": (0.24, 0.0, 0.31), "brown": (0.25, 0.09, 0.01),
    "pink": (1.0, 0.4, 0.62), "lime": (0.19, 1.0, 0.0), "olive": (0.21, 0.21, 0.0),
    "teal": (0.0, 0.25, 0.25), "maroon": (0.14, 0.0, 0.01), "navy": (0.0, 0.03, 0.155),
    "coral": (1.0, 0.24, 0.16), "turquoise": (0.04, 0.77, 0.65), "indigo": (0.19, 0.0, 0.36),
    "beige": (1.0, 0.86, 0.62), "tan": (0.55, 0.47, 0.25), "silver": (0.47, 0.53, 0.59),
}  # fmt: skip
"""Linear RGB of the words that sentences use for blocks, pads and tinted objects."""

LOOK_ALIKES = (
    ("blue", "navy"), ("gray", "silver"), ("purple", "indigo"), ("beige", "tan"),
    ("cyan", "teal", "turquoise"),
)  # fmt: skip
"""Words of which a scene has at most one: all others differ by at least 20 in the picture."""

TABLE_COLOR: Color = (0.60, 0.88, 0.66)
"""A pale green top: as light as the official near-white one, and unlike white, silver, beige and
pink, which were lost on that."""

LIT, SHADED = 0.866, 0.55
"""Light that a top face and a face away from the sun send back, as a share of their colour."""


def shown(color: Color | Array, light: float = LIT) -> Array:
    """sRGB levels (..., 3), 0..255, that the head camera shows of linear colours (..., 3)."""
    linear = np.asarray(color, dtype=float) * light
    return 255.0 * np.clip(linear, 0.0, 1.0) ** (1 / 2.2)


def lab(levels: Array) -> Array:
    """CIE L*a*b* (..., 3), white D65, of sRGB levels (..., 3) in 0..255."""
    c = np.asarray(levels, dtype=float) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    t = linear @ _TO_XYZ.T
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
) / np.array([[0.95047], [1.0], [1.08883]])
"""Linear sRGB to XYZ relative to D65."""


def difference(first: Array, second: Array) -> Array:
    """CIEDE2000 between L*a*b* colours, broadcast over all but the last axis; weights 1."""
    (l1, a1, b1), (l2, a2, b2) = (
        np.moveaxis(np.asarray(c, dtype=float), -1, 0) for c in (first, second)
    )
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    stretch = 1.5 - 0.5 * np.sqrt(mean**7 / (mean**7 + 25.0**7))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360, np.degrees(np.arctan2(b2, a2)) % 360
    gray = c1 * c2 == 0
    turn = np.where(gray, 0.0, (h2 - h1 + 180) % 360 - 180)
    hue = np.where(gray, h1 + h2, h1 + turn / 2)
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    t = (
        1
        - 0.17 * _cos(hue - 30)
        + 0.24 * _cos(2 * hue)
        + 0.32 * _cos(3 * hue + 6)
        - 0.20 * _cos(4 * hue - 63)
    )
    off = (light - 50) ** 2
    dl = (l2 - l1) / (1 + 0.015 * off / np.sqrt(20 + off))
    dc = (c2 - c1) / (1 + 0.045 * chroma)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * t)
    wide = 2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    skew = -wide * np.sin(np.radians(60 * np.exp(-(((hue % 360 - 275) / 25) ** 2))))
    result: Array = np.sqrt(dl**2 + dc**2 + dh**2 + skew * dc * dh)
    return result


def _cos(degrees: Array) -> Array:
    result: Array = np.cos(np.radians(degrees))
    return result


def nearest(color: Color) -> str:
    """The word of NAMED whose linear RGB is nearest."""
    gaps = ((_VALUES - color) ** 2).sum(axis=1)
    return _WORDS[int(gaps.argmin())]


_WORDS, _VALUES = tuple(NAMED), np.array(list(NAMED.values()))

_TABLE = lab(shown(TABLE_COLOR))


def stands_out(color: Color) -> bool:
    """Whether lit and shaded faces of this colour differ from the table by 16."""
    faces = np.stack([shown(color, LIT), shown(color, SHADED)])
    return bool((difference(lab(faces), _TABLE) >= 16.0).all())
