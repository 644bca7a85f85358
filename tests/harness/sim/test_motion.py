"""The closed form of rest-to-rest motion, against hand-checked numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.harness.sim import motion

ZERO = np.zeros((2, 6))
OPEN = np.ones(2)


def towards(left: float, right: float) -> np.ndarray:
    goal = ZERO.copy()
    goal[0, 0], goal[1, 2] = left, right
    return goal


@pytest.mark.parametrize(
    ("change", "steps"), [(0.001, 15), (0.01, 50), (0.05, 111), (0.1, 158), (0.5, 353), (2.0, 750)]
)
def test_steps_are_those_of_the_official_harness(change: float, steps: int) -> None:
    assert motion.step_count(change) == steps


def test_duration_is_continuous_where_the_triangle_becomes_a_trapezium() -> None:
    assert motion.duration(1.0) == pytest.approx(2.0)
    assert motion.duration(1.0 + 1e-9) == pytest.approx(2.0)


@given(st.floats(1e-4, 6.0))
def test_profile_starts_and_ends_at_rest(change: float) -> None:
    fraction, rate = motion.profile(change)
    assert fraction[-1] == pytest.approx(1.0)
    assert rate[-1] == pytest.approx(0.0, abs=1e-9)


@given(st.floats(1e-3, 6.0))
def test_profile_keeps_both_limits_and_its_rate_is_the_slope_of_its_fraction(change: float) -> None:
    fraction, rate = motion.profile(change)
    step = motion.duration(change) / (len(fraction) - 1)
    assert (rate * change).max() <= 1.0 + 1e-9
    assert np.abs(np.diff(rate * change)).max() <= step * (1.0 + 1e-6)
    slope = np.diff(fraction) / step
    assert np.allclose(slope, (rate[1:] + rate[:-1]) / 2, atol=step * 1.01 / change)


def test_both_arms_end_together() -> None:
    path = motion.rest_to_rest(ZERO, towards(0.5, 0.01), OPEN, OPEN, OPEN)
    assert len(path) == 353
    done = path.joints[1, :, 2] / 0.01
    assert done[176] == pytest.approx(0.5, abs=0.03)
    assert np.flatnonzero(done == 1.0)[0] >= 345
    assert path.joints[0, 176, 0] == pytest.approx(0.25, abs=0.003)


@given(st.integers(1, 400), st.integers(1, 400))
def test_the_arm_with_the_smaller_share_goes_on(left: int, right: int) -> None:
    at, done = motion.merged(left, right), [0, 0]
    for step in range(at.shape[1]):
        if done[0] < left and done[0] / left <= done[1] / right:
            done[0] += 1
        if done[1] < right and done[1] / right <= done[0] / left:
            done[1] += 1
        assert at[:, step].tolist() == [done[0] - 1, done[1] - 1]
    assert done == [left, right]


@pytest.mark.parametrize(
    ("goal", "grip"), [(ZERO, OPEN), (towards(1e-3, 0), OPEN), (ZERO, ZERO[0])]
)
def test_an_arm_that_does_not_move_counts_as_fifty_steps(
    goal: np.ndarray, grip: np.ndarray
) -> None:
    assert len(motion.rest_to_rest(ZERO, goal, OPEN, grip[:2], OPEN)) == motion.HOLD_STEPS


def test_gripper_goes_linearly_over_its_arms_steps() -> None:
    path = motion.rest_to_rest(ZERO, towards(0.5, 0.1), OPEN, np.array([0.0, 0.5]), OPEN)
    assert path.commanded[0, 352] == 0.0
    assert path.commanded[1, 176] == pytest.approx(0.75, abs=0.005)
    assert path.commanded[1, -1] == 0.5


def test_opening_is_limited_and_closing_is_not() -> None:
    assert motion.limit_opening(np.array([1.0, 1.0, 1.0]), 0.0) == pytest.approx([0.1, 0.2, 0.3])
    assert motion.limit_opening(np.array([0.0, 0.0]), 1.0) == pytest.approx([0.0, 0.0])


def test_targets_lie_on_the_straight_joint_line() -> None:
    goal = np.array([[0.3, -0.2, 0.1, 0.0, 0.05, 0.6], [0.0] * 6])
    path = motion.rest_to_rest(ZERO, goal, OPEN, OPEN, OPEN)
    along = path.joints[0] @ goal[0] / (goal[0] @ goal[0])
    assert np.allclose(path.joints[0], along[:, None] * goal[0], atol=1e-12)
    assert np.array_equal(path.joints[:, -1], goal)


def test_fixed_rate_lasts_as_long_as_it_is_told() -> None:
    path = motion.fixed_rate(ZERO, towards(0.5, 0.0), OPEN, np.zeros(2), OPEN, 10)
    assert len(path) == 10
    assert path.joints[0, 4, 0] == pytest.approx(0.25)
    assert path.velocities[0, 4, 0] == pytest.approx(0.5 * motion.RATE / 10)
    assert np.all(path.velocities[:, -1] == 0.0)
