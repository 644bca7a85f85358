"""Layouts: areas, bounded scatter, the pool."""

import math

import numpy as np
import pytest
from scene_checks import overlap

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks.sampling import places
from robospa.tasks.sampling.turns import Turnable, free_turns, outline
from robospa.tasks.scene import SceneObject
from robospa.workcell import WORKCELL

A = np.array


def test_area_clears_the_far_middle() -> None:
    x, y = places.Area((-0.3, 0.3), (-0.1, 0.2), True).draw(np.random.default_rng(0), (2000,))
    assert y[np.abs(x) < 0.15].max() <= 0.0
    assert y[np.abs(x) >= 0.15].max() > 0.15


def propose_square(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y = places.Area((0.0, 1.0), (0.0, 1.0)).draw(rng, (4, 30))
    return x, y, x > 0.1


def test_scatter_keeps_distances_and_refuses_what_is_not_usable() -> None:
    rng = np.random.default_rng(0)
    limits = [[0.3] * 4] * 4
    for _ in range(50):
        points = A(places.scatter(rng, propose_square, limits))
        gaps = np.linalg.norm(points[:, None] - points, axis=-1) + np.eye(4)
        assert gaps.min() >= 0.3 and points[:, 0].min() > 0.1


def test_scatter_gives_up_in_bounded_work() -> None:
    calls = []

    def propose(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        calls.append(1)
        return propose_square(rng)

    with pytest.raises(places.LayoutError, match="4 objects in 7 draws"):
        places.scatter(np.random.default_rng(0), propose, [[2.0] * 4] * 4, restarts=7)
    assert len(calls) == 7


def fits_square(points: np.ndarray, wanted: np.ndarray, i: int) -> np.ndarray:
    inside = (wanted >= 0).all(axis=1) & (wanted <= 0.2).all(axis=1)
    return inside & places.keeps_apart(points, wanted, i, 0.15)


CORNERS = A([[[0.0, 0.0], [0.2, 0.0], [0.0, 0.2], [0.2, 0.2]]] * 16)


def test_pool_holds_layouts_only_and_is_repeatable() -> None:
    layouts = places.pool(CORNERS, fits_square, sweeps=40, samples=4)
    assert layouts.shape == (4, 16, 4, 2)
    for i in range(4):
        flat = layouts.reshape(-1, 4, 2)
        assert fits_square(flat, flat[:, i], i).all()
    assert np.array_equal(layouts, places.pool(CORNERS, fits_square, sweeps=40, samples=4))


def test_pool_leaves_its_starts() -> None:
    layouts = places.pool(CORNERS, fits_square, sweeps=40, samples=1)
    assert np.abs(layouts[0] - CORNERS).max(axis=(1, 2)).min() > 0.005


def test_pool_refuses_starts_that_break_the_rules() -> None:
    with pytest.raises(places.LayoutError, match="start layouts of 4 objects"):
        places.pool(CORNERS * 0.5, fits_square)


def test_walk_never_leaves_the_layouts() -> None:
    rng, points = np.random.default_rng(0), CORNERS.copy()
    for _ in range(20):
        places.walk(rng, points, fits_square, 0.1)
        assert all(fits_square(points, points[:, i], i).all() for i in range(4))


def lying(items: list[Turnable], yaws: list[float]) -> list[SceneObject]:
    return [
        SceneObject(str(k), i.asset, Pose((*i.place, 0.74), yaw_rotation(yaw)), i.params)
        for k, (i, yaw) in enumerate(zip(items, yaws, strict=True))
    ]


def test_soaps_side_by_side_lie_free_of_each_other() -> None:
    """At 0.069 m, the least official distance, most turns of a 9.7 cm bar would touch."""
    rng = np.random.default_rng(0)
    pair = [Turnable("soap", {"look": 0}, (x, -0.05)) for x in (0.0, 0.069)]
    for _ in range(50):
        assert overlap(*lying(pair, free_turns(rng, WORKCELL, pair))) < 1e-9
    assert overlap(*lying(pair, [0.0, 0.0])) > 0.02


def test_what_cannot_lie_free_is_no_scene() -> None:
    pair = [Turnable("soap", {"look": 2}, (x, -0.05)) for x in (0.0, 0.04)]
    with pytest.raises(places.LayoutError, match="2 objects"):
        free_turns(np.random.default_rng(0), WORKCELL, pair)


def test_near_the_edge_of_the_picture_long_things_lie_along_it() -> None:
    rng = np.random.default_rng(0)
    remote = [Turnable("remote_control", {"look": 0}, (0.0, -0.19))]
    along = [abs(math.cos(free_turns(rng, WORKCELL, remote)[0])) for _ in range(50)]
    assert max(along) < 0.75  # its length is along y at yaw 0


def test_an_outline_reaches_as_far_as_the_object() -> None:
    long, wide = outline("soap", {"look": 0}).reach[[0, 180]]
    assert (long, wide) == pytest.approx((0.0967 / 2, 0.0311 / 2), abs=1e-3)
