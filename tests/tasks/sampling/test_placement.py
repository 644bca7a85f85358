"""Layouts: areas, bounded scatter, the pool."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.tasks.sampling.places import (
    Area,
    LayoutError,
    keeps_apart,
    pool,
    scatter,
    spread,
    walk,
)

A = np.array


def test_area_clears_the_far_middle() -> None:
    x, y = Area((-0.3, 0.3), (-0.1, 0.2), True).draw(np.random.default_rng(0), (2000,))
    assert y[np.abs(x) < 0.15].max() <= 0.0
    assert y[np.abs(x) >= 0.15].max() > 0.15


def propose_square(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y = Area((0.0, 1.0), (0.0, 1.0)).draw(rng, (4, 30))
    return x, y, x > 0.1


def test_scatter_keeps_distances_and_refuses_what_is_not_usable() -> None:
    rng = np.random.default_rng(0)
    limits = [[0.3] * 4] * 4
    for _ in range(50):
        points = A(scatter(rng, propose_square, limits))
        gaps = np.linalg.norm(points[:, None] - points, axis=-1) + np.eye(4)
        assert gaps.min() >= 0.3 and points[:, 0].min() > 0.1


def test_scatter_gives_up_in_bounded_work() -> None:
    calls = []

    def propose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        calls.append(1)
        return propose_square(rng)

    with pytest.raises(LayoutError, match="4 objects in 7 draws"):
        scatter(np.random.default_rng(0), propose, [[2.0] * 4] * 4, restarts=7)
    assert len(calls) == 7


def test_spread_is_the_range() -> None:
    assert spread([0.3, -0.1, 0.2]) == pytest.approx(0.4)


def fits_square(points: np.ndarray, wanted: np.ndarray, i: int) -> np.ndarray:
    inside = (wanted >= 0).all(axis=1) & (wanted <= 0.2).all(axis=1)
    return inside & keeps_apart(points, wanted, i, 0.15)


CORNERS = A([[[0.0, 0.0], [0.2, 0.0], [0.0, 0.2], [0.2, 0.2]]] * 16)


def test_pool_holds_layouts_only_and_is_repeatable() -> None:
    layouts = pool(CORNERS, fits_square, sweeps=40, samples=4)
    assert layouts.shape == (4, 16, 4, 2)
    for i in range(4):
        flat = layouts.reshape(-1, 4, 2)
        assert fits_square(flat, flat[:, i], i).all()
    assert np.array_equal(layouts, pool(CORNERS, fits_square, sweeps=40, samples=4))


def test_pool_leaves_its_starts() -> None:
    layouts = pool(CORNERS, fits_square, sweeps=40, samples=1)
    assert np.abs(layouts[0] - CORNERS).max(axis=(1, 2)).min() > 0.005


def test_pool_refuses_starts_that_break_the_rules() -> None:
    with pytest.raises(LayoutError, match="start layouts of 4 objects"):
        pool(CORNERS * 0.5, fits_square)


def test_walk_never_leaves_the_layouts() -> None:
    rng, points = np.random.default_rng(0), CORNERS.copy()
    for _ in range(20):
        walk(rng, points, fits_square, 0.1)
        assert all(fits_square(points, points[:, i], i).all() for i in range(4))
