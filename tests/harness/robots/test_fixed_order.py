"""Kinematics in fixed-order arithmetic: the same as with numpy, but for the last bits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robospa.geometry import Pose, axis_rotation
from robospa.harness.robots import embodiment
from robospa.harness.robots.fixed_order import (
    FixedPose,
    end_frame,
    fixed_chain,
    frame_of,
    refined,
    sine_cosine,
)
from robospa.harness.robots.kinematics import chain_of, forward

CHAIN = chain_of(embodiment("aloha-agilex").arms[0])
FIXED = fixed_chain(CHAIN)
POSTURES = np.random.default_rng(0).uniform(CHAIN.lower, CHAIN.upper, (100, 6))


@pytest.mark.parametrize("largest", [1.0, 7.0, 999.0])
def test_sine_and_cosine(largest: float) -> None:
    for angle in np.linspace(-largest, largest, 2001).tolist():
        expected = (math.sin(angle), math.cos(angle))
        assert sine_cosine(angle) == pytest.approx(expected, abs=3e-16)


def test_sine_and_cosine_are_exact_at_rest() -> None:
    assert sine_cosine(0.0) == (0.0, 1.0)


def test_the_end_effector_is_where_numpy_has_it() -> None:
    frames = forward(CHAIN, POSTURES)[0]
    for joints, expected in zip(POSTURES, frames, strict=True):
        found = end_frame(FIXED, joints.tolist())
        np.testing.assert_allclose(np.array(found.turn), expected[:3, :3], atol=3e-15)
        np.testing.assert_allclose(found.at, expected[:3, 3], atol=3e-15)


def test_frames_compose_as_poses_do() -> None:
    first = Pose((0.1, -0.2, 0.3), axis_rotation((1, 2, 3), 0.7))
    second = Pose((0.4, 0.5, -0.6), axis_rotation((-1, 0, 2), 1.9))
    found, expected = frame_of(first) * frame_of(second), frame_of(first * second)
    np.testing.assert_allclose(np.array(found.turn), np.array(expected.turn), atol=1e-15)
    assert found.at == pytest.approx(expected.at, abs=1e-15)


def test_refining_reaches_the_goal() -> None:
    for joints in POSTURES[:20].tolist():
        goal = end_frame(FIXED, joints)
        start = [angle + 1e-3 for angle in joints]
        end = end_frame(FIXED, refined(FIXED, start, goal, 3))
        assert end.at == pytest.approx(goal.at, abs=1e-6)
        np.testing.assert_allclose(np.array(end.turn), np.array(goal.turn), atol=1e-5)


def test_refining_stays_within_the_limits() -> None:
    far = FixedPose(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (5.0, 5.0, 5.0))
    for joints in POSTURES[:20].tolist():
        found = refined(FIXED, joints, far, 5)
        assert all(
            low <= angle <= high
            for low, angle, high in zip(FIXED.lower, found, FIXED.upper, strict=True)
        )
