"""Differences of colours, and colours that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.tasks.colors import NAMED, difference, lab, nearest, stands_out
from robospa.tasks.families.table import drawn_color

SHARMA = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, 3.1571, -77.2803), (50.0, 0.0, -82.7485), 2.8615),
    ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0009), 7.1792),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0011), 7.2195),
    ((50.0, -0.0010, 2.4900), (50.0, 0.0011, -2.4900), 4.7461),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((50.0, 2.5, 0.0), (56.0, -27.0, -3.0), 31.9030),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
)
"""Pairs of the test data published with the formula by Sharma, Wu and Dalal (2005)."""


@pytest.mark.parametrize(("a", "b", "expected"), SHARMA)
def test_published_pairs(a: tuple[float, ...], b: tuple[float, ...], expected: float) -> None:
    assert difference(np.array(a), np.array(b)) == pytest.approx(expected, abs=1e-4)
    assert difference(np.array(b), np.array(a)) == pytest.approx(expected, abs=1e-4)


def test_lab_of_srgb() -> None:
    np.testing.assert_allclose(lab(np.full(3, 255.0)), (100.0, 0.0, 0.0), atol=0.02)
    np.testing.assert_allclose(lab(np.array([255.0, 0, 0])), (53.24, 80.09, 67.20), atol=0.02)


def test_a_drawn_color_is_not_the_tables() -> None:
    rng = np.random.default_rng(3)
    drawn = [drawn_color(rng, 0.05, 0.95) for _ in range(200)]
    assert all(stands_out((r, g, b)) for r, g, b in drawn)
    assert all(0.05 <= c <= 0.95 for color in drawn for c in color)


def test_every_named_color_has_its_own_word() -> None:
    assert all(nearest(color) == word for word, color in NAMED.items())
