"""Physics steps of recorded actions: what the simulator's own trajectories take."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import HOLD_STEPS, action_steps, rest_to_rest, step_count
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.traces import durations
from robospa.trial import REFERENCE


def test_actions_take_what_their_trajectories_have() -> None:
    rng = np.random.default_rng(0)
    sizes = rng.choice([0.0, 1e-9, 1e-6, 1e-4, 0.01, 0.5, 1.0, 3.0], (300, 2, 1))
    turns = sizes * rng.uniform(-1, 1, (300, 2, 6))
    grips = rng.choice([0.0, 0.5, 1.0], (301, 2))
    joints = np.cumsum(turns, axis=0)
    change = np.abs(np.diff(joints, axis=0, prepend=np.zeros((1, 2, 6)))).max(axis=2)
    found = action_steps(change)
    start = np.zeros((2, 6))
    for n, goal in enumerate(joints):
        path = rest_to_rest(start, goal, grips[n], grips[n + 1], grips[n])
        assert len(path) == found[n]
        start = goal


def test_a_robot_starts_at_home_with_open_grippers() -> None:
    home = np.concatenate([[*arm.home, 1.0] for arm in embodiment(REFERENCE).arms])
    away = home + 0.25 * (np.arange(14) == 2)
    trace = np.array([home, away, away], np.float32)
    least, most = durations(REFERENCE, "joint", trace)
    assert least.tolist() == most.tolist() == [HOLD_STEPS, step_count(0.25), HOLD_STEPS]


def test_of_poses_only_bounds_are_known() -> None:
    least, most = durations(REFERENCE, "ee", np.zeros((3, 16), np.float32))
    assert least.tolist() == [1, 1, 1]
    assert (most > 1000).all() and (most < 6000).all()


def test_actions_of_another_width_are_refused() -> None:
    with pytest.raises(BundleError, match="have 14 numbers, not 16"):
        durations(REFERENCE, "joint", np.zeros((3, 16), np.float32))
