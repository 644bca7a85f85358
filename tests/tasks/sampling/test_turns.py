"""Turns side by side: long things at official distances do not touch and are seen whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scene_checks import overlap

from robospa.geometry import Pose, yaw_rotation
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.sampling.turns import Turnable, free_turns, outline
from robospa.tasks.scene import SceneObject
from robospa.workcell import WORKCELL


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
    with pytest.raises(LayoutError, match="2 objects"):
        free_turns(np.random.default_rng(0), WORKCELL, pair)


def test_near_the_edge_of_the_picture_long_things_lie_along_it() -> None:
    rng = np.random.default_rng(0)
    remote = [Turnable("remote_control", {"look": 0}, (0.0, -0.19))]
    along = [abs(math.cos(free_turns(rng, WORKCELL, remote)[0])) for _ in range(50)]
    assert max(along) < 0.75  # its length is along y at yaw 0


def test_an_outline_reaches_as_far_as_the_object() -> None:
    long, wide = outline("soap", {"look": 0}).reach[[0, 180]]
    assert (long, wide) == pytest.approx((0.0967 / 2, 0.0311 / 2), abs=1e-3)
