"""Pushes off a planned way: smooth, bounded, gone at its end; and what they make of the labels."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.action_space import ActionSpace
from robospa.harness.demonstrations.noise import (
    ACCELERATION,
    EXPERT,
    NOISE,
    RECOVERY,
    TURN,
    PushLog,
    push,
    smooth_step,
)
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS, RATE, profile

PROGRESS = profile(1.5, DEMONSTRATION_LIMITS)[0]
"""Of a motion of 1.5 rad: 433 physics steps."""


def test_a_smooth_step_goes_from_nothing_to_all() -> None:
    assert smooth_step(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])).tolist() == [0, 0, 0.5, 1, 1]


@pytest.mark.parametrize("strong", [0.05, 100.0])
def test_a_push_is_bounded_and_gone_at_the_end(strong: float) -> None:
    made = push(PROGRESS, np.array([1.0, -0.5, 0.0]) * strong, 0.2, 0.5)
    assert (made.offset[0] == 0).all() and (made.offset[-1] == 0).all()
    assert np.abs(made.shift).max() <= TURN + 1e-9
    added = np.abs(np.diff(made.offset, n=2, axis=0)).max() * RATE**2
    assert added <= ACCELERATION + 1e-6
    assert added == pytest.approx(ACCELERATION) or strong < 1
    assert (made.offset[:, 2] == 0).all()
    after = made.shift[round(0.5 * len(PROGRESS)) :]
    assert (after == after[-1]).all()


def test_after_a_push_the_way_is_a_straight_line_to_the_goal() -> None:
    line = PROGRESS[:, None] * np.array([1.5, 1.0])
    way = line + push(PROGRESS, np.array([0.05, -0.1]), 0.1, 0.4).offset
    rest = way[round(0.4 * len(way)) :]
    ahead = rest[-1] - rest
    assert np.allclose(ahead[:, 0] * ahead[0, 1], ahead[:, 1] * ahead[0, 0])


def test_labels_and_actions_of_a_pushed_motion() -> None:
    space, count = ActionSpace("joint"), len(PROGRESS)
    log, made = PushLog(6), push(PROGRESS, np.full(6, 0.05), 0.2, 0.5)
    log.append(50, {})
    log.append(count, {1: made})
    log.append(50, {})
    steps = [0, 50, *range(65, 50 + count, 15), 50 + count, 100 + count]
    commanded = np.zeros((len(steps), space.width), np.float32)
    right = space.arms[1].body
    for t, step in enumerate(steps):
        if 50 < step <= 50 + count:
            commanded[t, right] = PROGRESS[step - 51] + made.offset[step - 51]
        elif step > 50:
            commanded[t, right] = 1.0
    label, action = log.annotate(space, commanded, steps)
    following = np.concatenate([commanded[1:], commanded[-1:]])
    pushed = np.flatnonzero(label == NOISE)
    assert (np.diff(pushed) == 1).all() and len(pushed) > 3
    assert set(label[: pushed[0]]) == {EXPERT}
    assert (label[-2:] == EXPERT).all() and label[pushed[-1] + 1] == RECOVERY
    own = label != NOISE
    assert np.allclose(action[own], following[own], atol=1e-4)
    assert (np.abs(action - following)[pushed].max(axis=1) > 1e-4).all()
    assert (action[:, space.arms[0].body] == 0).all()
    for t in pushed:  # by hand: straight on from where the arm is, as far as the motion gets
        now, then = PROGRESS[steps[t] - 51], PROGRESS[steps[t + 1] - 51]
        here = commanded[t, right]
        assert np.allclose(
            action[t, right], here + (1 - here) * (then - now) / (1 - now), atol=1e-6
        )
