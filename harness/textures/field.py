"""Building blocks of textures: noise, cells, waves, ramps of colours.

Images have to be the same on every machine, so only operations are used whose results IEEE 754
fixes to the bit: sums, products, quotients, roots and roundings of float32, never a sine, a power,
a sum over an axis or a matrix product. Arrays are (SIZE, SIZE), values mostly 0..1.
"""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32 | np.float64]
Picture = NDArray[np.float32 | np.float64]
"""sRGB (SIZE, SIZE, 3), 0..1."""
T = TypeVar("T")

SIZE = 256
"""[px] of a texture's side: a pixel is 5 mm of the table."""
_STEPS = (np.arange(SIZE, dtype=np.float32) + np.float32(0.5)) / np.float32(SIZE)
X: Field = np.ascontiguousarray(np.broadcast_to(_STEPS, (SIZE, SIZE)))
"""0 at the left edge, 1 at the right."""
Y: Field = np.ascontiguousarray(X.T)
"""0 at the upper edge, 1 at the lower."""


class Draw:
    """Random numbers of one texture; `seed` is a few whole numbers."""

    def __init__(self, *seed: int) -> None:
        self._rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))

    def number(self, low: float, high: float) -> float:
        return low + (high - low) * float(self._rng.random())

    def whole(self, low: int, high: int) -> int:
        """One of low, ..., high."""
        return low + int(self._rng.random() * (high - low + 1))

    def chance(self, share: float) -> bool:
        return float(self._rng.random()) < share

    def pick(self, some: Sequence[T]) -> T:
        return some[self.whole(0, len(some) - 1)]

    def grid(self, *shape: int) -> Field:
        """Uniform 0..1."""
        return self._rng.random(shape).astype(np.float32)


def smooth(t: Field) -> Field:
    """0 below 0, 1 above 1, with level ends between."""
    t = np.clip(t, 0, 1)
    eased: Field = t * t * (3 - 2 * t)
    return eased


def wave(turns: Field) -> Field:
    """Like a cosine of `turns` full turns, -1..1."""
    t = np.abs(turns - np.floor(turns) - np.float32(0.5)) * 4 - 1
    eased: Field = t * (1.5 - 0.5 * t * t)
    return eased


def noise(draw: Draw, across: float, down: float | None = None, octaves: int = 4) -> Field:
    """Clouds 0..1, with `across` and `down` lumps along the sides; finer ones count half."""
    total, weight = np.zeros((SIZE, SIZE), np.float32), 0.0
    down = across if down is None else down
    for octave in range(octaves):
        share = 0.5**octave
        total += np.float32(share) * _lattice(draw, across * 2**octave, down * 2**octave)
        weight += share
    # averages of several octaves crowd in the middle
    middle = total / np.float32(weight) - np.float32(0.5)
    spread: Field = np.clip(middle * np.float32(1.0 + 0.25 * octaves) + np.float32(0.5), 0, 1)
    return spread


def _lattice(draw: Draw, across: float, down: float) -> Field:
    across, down = min(across, SIZE / 1.5), min(down, SIZE / 1.5)
    values = draw.grid(int(down) + 3, int(across) + 3)
    rows, cols = _STEPS * np.float32(down), _STEPS * np.float32(across)
    r, c = rows.astype(np.int32), cols.astype(np.int32)
    u, v = smooth(rows - np.floor(rows))[:, None], smooth(cols - np.floor(cols))[None, :]
    lines = values[r] + (values[r + 1] - values[r]) * u
    left = lines[:, c]
    return left + (lines[:, c + 1] - left) * v


def turned(slope: float, x: Field = X, y: Field = Y) -> tuple[Field, Field]:
    """Coordinates turned about the middle by twice the angle whose tangent is `slope`."""
    cos, sin = (1 - slope**2) / (1 + slope**2), 2 * slope / (1 + slope**2)
    u, v = x - np.float32(0.5), y - np.float32(0.5)
    return np.float32(cos) * u - np.float32(sin) * v, np.float32(sin) * u + np.float32(cos) * v


class Cells:
    """Jittered points on a grid: which one is nearest, how far it and the second nearest are.
    Distances are in cells. `number` is the nearest point's, from 0."""

    def __init__(self, draw: Draw, across: int, down: int, jitter: float = 0.9) -> None:
        wide = across + 2
        px, py = draw.grid((down + 2) * wide), draw.grid((down + 2) * wide)
        px, py = (0.5 + (p - 0.5) * jitter for p in (px, py))
        j, u = cell(X * across)
        i, v = cell(Y * down)
        corner = i * wide + j
        self.near = np.full((SIZE, SIZE), 9, np.float32)
        self.second = self.near.copy()
        self.number = corner
        for down_by in (0, 1, 2):
            for across_by in (0, 1, 2):
                number = corner + (down_by * wide + across_by)
                dx = px.take(number) - (u - (across_by - 1))
                dy = py.take(number) - (v - (down_by - 1))
                gap = dx * dx + dy * dy
                nearer = gap < self.near
                self.second = np.minimum(self.second, np.maximum(gap, self.near))
                self.number = np.where(nearer, number, self.number)
                self.near = np.minimum(self.near, gap)
        self.near, self.second = np.sqrt(self.near), np.sqrt(self.second)

    @property
    def seam(self) -> Field:
        """0 on the border between two cells, growing inwards."""
        return self.second - self.near


def each(draw: Draw, number: NDArray[np.int32], many: int = 4096) -> Field:
    """A random 0..1 for every number."""
    found: Field = draw.grid(many).take(number % many)
    return found


def cell(place: Field) -> tuple[NDArray[np.int32], Field]:
    """The whole part of `place`, and the rest, 0..1."""
    floor = np.floor(place)
    return floor.astype(np.int32), place - floor


def rgb(code: str) -> Field:
    """0..1 of `rrggbb`."""
    return np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)], np.float32) / np.float32(255)


def ramp(t: Field, codes: Sequence[str]) -> Picture:
    """Colours along a row of them, from 0 to 1."""
    stops = np.stack([rgb(code) for code in codes])
    place = np.clip(t, 0, 1) * np.float32(len(codes) - 1)
    low = np.minimum(place.astype(np.int32), len(codes) - 2)
    share = (place - low.astype(np.float32))[..., None]
    picture: Picture = stops[low] + (stops[low + 1] - stops[low]) * share
    return picture


def mix(a: Picture | Field, b: Picture | Field, share: Field) -> Picture:
    """`a` where `share` is 0, `b` where it is 1; either may be one colour."""
    mixed: Picture = a + (b - a) * share[..., None]
    return mixed


def shaded(picture: Picture, light: Field) -> Picture:
    """The picture with its brightness multiplied."""
    result: Picture = picture * light[..., None]
    return result


def filled(code: str) -> Picture:
    """One colour."""
    return np.ascontiguousarray(np.broadcast_to(rgb(code), (SIZE, SIZE, 3)))
