"""Noise: pushes that are smooth, bounded and gone at their end, where there is clearance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.action_space import ActionSpace
from robospa.geometry import Pose
from robospa.harness.demonstrations.noise import (
    ACCELERATION,
    EXPERT,
    NOISE,
    RECOVERY,
    STRENGTH,
    TURN,
    Noise,
    PushLog,
    depths,
    deviation,
    gaps,
    push,
    smooth_step,
)
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS, RATE, Trajectory, profile, rest_to_rest
from robospa.harness.skills.pick import reachable_grasps
from robospa.harness.skills.workspace import Workspace, moved_back
from robospa.tasks.scene import SceneObject
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.workcell import TABLE_TOP

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


@dataclass
class AtHome:
    """A world in which both arms are at home, and grippers touch what they are said to."""

    seen: Snapshot
    touched: tuple[Contact, ...] = field(default=())

    def snapshot(self) -> Snapshot:
        return self.seen

    def contacts(self) -> tuple[Contact, ...]:
        return self.touched


def workspace() -> Workspace:
    params = {"half": [0.02] * 3, "color": [1.0, 0.0, 0.0]}
    block = SceneObject("b", "block", Pose((-0.15, -0.1, TABLE_TOP + 0.02)), params)
    return at_home("aloha-agilex", block)


def way_to_the_block(ws: Workspace, share: float = 1.0) -> Trajectory:
    """The left arm's motion from home to 8 cm before it would grasp, or a first part of it."""
    grasp = reachable_grasps(ws, "b", (0,))[0]
    goal = ws.solve(0, moved_back(grasp.pose, grasp.approach, 0.08), grasp.joints)
    assert goal is not None
    start, opened = np.array(ws.joints), np.ones(2)
    there = np.array([start[0] + share * (goal - start[0]), start[1]])
    return rest_to_rest(start, there, opened, opened, opened, DEMONSTRATION_LIMITS)


def disturbed(path: Trajectory, *touched: str, seed: int = 0) -> Trajectory:
    ws = workspace()
    contacts = tuple(Contact("left_gripper", name, (0.0, 0.0, 0.0)) for name in touched)
    world = AtHome(ws.snapshot, contacts)
    return Noise(world, ws, np.random.default_rng(seed)).disturb(path)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(4))
def test_a_disturbed_way_has_the_same_ends_and_keeps_to_its_bounds(seed: int) -> None:
    ws, path = workspace(), way_to_the_block(workspace())
    way = disturbed(path, seed=seed)
    assert len(way) == len(path)
    assert np.array_equal(way.joints[:, [0, -1]], path.joints[:, [0, -1]])
    assert (way.velocities[:, -1] == path.velocities[:, -1]).all()
    assert np.array_equal(way.joints[1], path.joints[1])
    tip = ws.hand(0).tip
    off, _ = deviation(ws.chains[0], tip, path.joints[0], way.joints[0])
    assert 0.003 <= off <= STRENGTH * 1.05
    assert depths(ws, 0, way.joints[0, ::20]).max() <= depths(ws, 0, path.joints[0]).max() + 0.002


def test_a_short_motion_and_a_gripper_that_touches_something_unknown_are_left_alone() -> None:
    path, short = (way_to_the_block(workspace(), share) for share in (1.0, 0.02))
    assert disturbed(path, "b") is path and disturbed(short) is short


def test_room_ends_at_the_block_and_at_the_table() -> None:
    ws = workspace()
    grasp = reachable_grasps(ws, "b", (0,))[0]
    assert depths(ws, 0, ws.joints[0][None])[0] == 0.0
    assert depths(ws, 0, grasp.joints[None])[0] > 0.005
    assert gaps(ws, ws.joints[0][None], ws.joints[1][None])[0] > 0.2
