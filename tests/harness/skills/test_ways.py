"""Both arms at once where they stay apart, and no stop where a straight line passes by."""

from __future__ import annotations

import numpy as np
from robot_at_home import at_home

from robospa.geometry import Array, Pose
from robospa.harness.robots import embodiment
from robospa.harness.skills.motion import at_once, go, go_home, travel
from robospa.harness.skills.workspace import Workspace, fewer_waypoints

ROBOT = embodiment("aloha-agilex")
DOWN = (0.5, -0.5, 0.5, 0.5)
"""A gripper that points down, its fingers left and right."""
LEFT, RIGHT = slice(0, 6), slice(7, 13)


def workspace() -> Workspace:
    return at_home(ROBOT.name)


def above(ws: Workspace, arm: int, x: float, y: float = -0.15, z: float = 0.95) -> Array:
    """Joints with the end effector there."""
    joints = ws.solve(arm, Pose((x, y, z), DOWN))
    assert joints is not None
    return joints


def put(ws: Workspace, arm: int, x: float) -> None:
    """The arm stands out, above `x`."""
    ws.joints[arm] = above(ws, arm, x)


def moving(rows: list[Array], start: Array) -> list[tuple[bool, bool]]:
    """Which arms move in each row."""
    steps = np.diff(np.stack([start, *rows]), axis=0)
    return [(bool(s[LEFT].any()), bool(s[RIGHT].any())) for s in steps]


def test_one_arm_goes_home_while_the_other_sets_out() -> None:
    ws = workspace()
    put(ws, 0, -0.2)
    start = ws.row()
    go(ws, 1, above(ws, 1, 0.2), 0.0)
    assert moving(ws.rows, start) == [(True, True)]
    assert np.allclose(ws.rows[-1][LEFT], ROBOT.arms[0].home) and ws.rows[-1][13] == 0.0


def test_arms_that_would_meet_move_one_after_the_other() -> None:
    ws = workspace()
    put(ws, 0, 0.1)
    put(ws, 1, 0.22)
    start = ws.row()
    go(ws, 1, above(ws, 1, -0.05), 0.0)
    assert moving(ws.rows, start) == [(True, False), (False, True)]


def test_an_arm_that_holds_something_stays_out() -> None:
    ws = workspace()
    put(ws, 0, -0.2)
    ws.held[0] = "cube"
    start = ws.row()
    go(ws, 1, above(ws, 1, 0.2), 0.0)
    assert moving(ws.rows, start) == [(False, True)]


def test_both_arms_go_home_at_once() -> None:
    ws = workspace()
    put(ws, 0, -0.2)
    put(ws, 1, 0.2)
    start = ws.row()
    go_home(ws, (0, 1))
    assert moving(ws.rows, start) == [(True, True)]
    go_home(ws, (0, 1))
    assert len(ws.rows) == 1


def test_the_shorter_of_two_ways_waits_at_its_end() -> None:
    ws = workspace()
    ways = [above(ws, 0, -0.2), above(ws, 0, -0.2, z=0.9)], [above(ws, 1, 0.2)]
    at_once(ws, (lambda: [ws.add(0, j) for j in ways[0]], lambda: ws.add(1, ways[1][0])))
    assert len(ws.rows) == 2
    assert np.array_equal(ws.rows[0][RIGHT], ways[1][0])
    assert np.array_equal(ws.rows[1][RIGHT], ways[1][0])


def test_a_short_straight_line_is_one_action_a_corner_is_two() -> None:
    ws = workspace()
    tips = [ROBOT.grippers[arm].tip for arm in (0, 1)]
    put(ws, 0, -0.2)
    start = ws.row()
    for z in (0.94, 0.93, 0.92):
        ws.add(0, above(ws, 0, -0.2, z=z))
    assert len(fewer_waypoints(ws.chains, tips, start, np.stack(ws.rows))) == 1
    ws.add(0, above(ws, 0, -0.25, z=0.92))
    rows = np.stack(ws.rows)
    assert np.array_equal(fewer_waypoints(ws.chains, tips, start, rows), rows[2:])


def test_rests_and_grippers_are_never_left_out() -> None:
    ws = workspace()
    tips = [ROBOT.grippers[arm].tip for arm in (0, 1)]
    put(ws, 0, -0.2)
    start = ws.row()
    ws.add(0, above(ws, 0, -0.2, z=0.94))
    ws.add(0)
    ws.add(0, gripper=0.5)
    ws.add(0, above(ws, 0, -0.2, z=0.93))
    rows = np.stack(ws.rows)
    assert np.array_equal(fewer_waypoints(ws.chains, tips, start, rows), rows)


def test_a_free_way_is_direct() -> None:
    ws = workspace()
    put(ws, 0, -0.2)
    travel(ws, 0, above(ws, 0, -0.1))
    assert len(ws.rows) == 1
