"""An object that turned in the hand is put down again, not let fall; one in hand is not swung."""

from __future__ import annotations

import math

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Pose, multiply, yaw_rotation
from robospa.gripper import grasp_points
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector, inverse
from robospa.harness.skills.approach import ASIDE, DEEPER, put_down, slide_out
from robospa.harness.skills.place import FAR, reachable_placements
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP

ROBOT = embodiment("aloha-agilex")
HELD = Pose((-0.2, -0.15, 0.95), (0.5, -0.5, 0.5, 0.5))
"""End-effector pose of the left arm, pointing down."""
LIFTED = 0.08


def holding_a_cube(gripper: float) -> Workspace:
    """The left arm at HELD with a cube between its fingers, LIFTED above the table."""
    half = {"half": [0.02, 0.02, 0.02], "color": [1.0, 0.0, 0.0]}
    cube = SceneObject("cube", "block", Pose((-0.2, -0.15, TABLE_TOP + 0.02 + LIFTED)), half)
    scene = Scene("none", 1, 0, ROBOT.name, "clean", (cube,), {})
    right = end_effector(chain_of(ROBOT.arms[1]), ROBOT.arms[1].home)
    points = grasp_points(ROBOT.grippers, (HELD, right))
    start = Snapshot(0.0, {"cube": cube.pose}, (gripper, 1.0), (HELD, right),
        (ROBOT.arms[0].home, ROBOT.arms[1].home), grasp_points=points)  # fmt: skip
    ws = Workspace(scene, ROBOT, start)
    joints = ws.solve(0, HELD)
    assert joints is not None
    ws.joints[0] = joints
    return ws


def test_what_is_held_is_lowered_to_where_it_lay_before_the_gripper_opens() -> None:
    ws = holding_a_cube(0.0)
    ws.held[0] = "cube"
    rows = next(put_down(ws, 0, TABLE_TOP + 0.02))
    opened = int(np.flatnonzero(rows[:, 6] == 1.0)[0])
    before = end_effector(ws.chains[0], rows[opened - 1, :6])
    assert before.position[2] == pytest.approx(HELD.position[2] - LIFTED, abs=1e-4)
    assert (rows[:opened, 6] == 0.0).all() and ws.held[0] is None


def test_what_jams_in_the_open_gripper_is_lowered_and_left_sideways() -> None:
    ws = holding_a_cube(1.0)
    rows = next(slide_out(ws, 0, "cube", TABLE_TOP + 0.02))
    _, down, _, beside, *_ = [end_effector(ws.chains[0], row[:6]).position for row in rows]
    assert (rows[:, 6] == 1.0).all()
    assert down[2] == pytest.approx(HELD.position[2] - LIFTED - DEEPER, abs=1e-3)
    assert beside[2] == pytest.approx(down[2], abs=1e-3)
    assert math.dist(beside[:2], down[:2]) == pytest.approx(ASIDE, abs=1e-3)
    assert beside[1] < down[1], "it goes towards the robot"


def test_a_thing_is_turned_by_the_wrist_and_not_by_swinging_the_whole_arm_over() -> None:
    # the first posture that reaches the target turns the base by 2.9 rad; what is held flies off
    ws = at_home("ur5-wsg")
    near = np.array([-0.8, -2.1, -1.4, -1.2, 1.6, 0.7])
    here = end_effector(ws.chains[1], near)
    x, y, z = here.position
    turned = Pose((x, y, z - LIFTED), multiply(yaw_rotation(-math.pi / 2), here.rotation))
    first, _ = inverse(ws.chains[1], [turned])
    assert np.abs(first[0] - near).max() > FAR
    best = reachable_placements(ws, 1, Pose(), [turned], 0.05, near)[0]
    assert np.abs(best.joints - near).max() < FAR
    there = end_effector(ws.chains[1], best.joints)
    assert there.position == pytest.approx(turned.position, abs=2e-3)
