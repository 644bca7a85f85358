"""Aloha-AgileX: two ARX arms side by side, the benchmark's default embodiment.

Joint origins, axes and sizes are the fact sheet's (public description of the robot); joint limits
are those of the same arm's own description, since the two-arm one leaves them open. Link shapes
are ours: boxes and cylinders fitted to the listed sizes.
"""

from __future__ import annotations

import math

from robospa.geometry import Pose, Vec3, axis_rotation, yaw_rotation
from robospa.harness.robots.aloha_agilex_shapes import (
    FINGER_SHAPES,
    LINK_SHAPES,
    STAND_SHAPES,
    WRIST_CAMERA,
)
from robospa.harness.robots.embodiment import Arm, Embodiment, Joint
from robospa.workcell import ArmSite, FixedCamera, Gripper, Workcell

PI = math.pi
FLIP = axis_rotation((1, 0, 0), -PI)
LEVEL = (1.0, 0.0, 0.0, 0.0)

# (origin xyz, origin rotation, axis, lower, upper) of joints 1 to 6
CHAIN: tuple[tuple[Vec3, tuple[float, float, float, float], Vec3, float, float], ...] = (
    ((0.0, 0.0, 0.0603), LEVEL, (0, 0, 1), -PI, PI),
    ((0.02, 0.0, 0.0402), LEVEL, (0, 1, 0), -0.05, 3.4),
    ((-0.264, 0.0, 0.0), FLIP, (0, 1, 0), -0.05, 3.4),
    ((0.245, 0.0, -0.056), LEVEL, (0, 1, 0), -PI / 2, PI / 2),
    ((0.06575, -0.001, -0.0825), LEVEL, (0, 0, 1), -1.67, 1.67),
    ((0.02845, 0.0, 0.0825), FLIP, (1, 0, 0), -PI / 2 - 0.1, PI / 2 + 0.1),
)
FINGER_TRAVEL = 0.04765
GRASP_CENTRE = 0.145  # along the last link's x axis

GRIPPER = Gripper(
    grasp_centre=0.12,  # official gripper_bias
    opening=0.088,
    fingertip=0.012,
    finger_half_width=0.010,
    finger_thickness=0.008,
    radius=0.05,
    palm_back=(0.095, 0.125, 0.155),
    palm_half=(0.08, 0.026),
    hand_back=0.09,
    hand_half=(0.09, 0.03),
    wrist_back=0.22,
    wrist_half=0.09,
)

READY = (0.0, 1.6, 1.5, 0.0, 0.0, 0.0)
SEEDS = (
    READY,
    (0.0, 2.2, 1.6, -0.9, 0.0, 0.0),
    (0.0, 1.2, 1.2, 1.2, 0.0, 0.0),
    (0.0, 2.2, 1.2, 0.3, 0.0, 0.0),
)


def _arm(name: str, prefix: str, base: Vec3) -> Arm:
    links = [f"{prefix}_base_link", *(f"{prefix}_link{i}" for i in range(1, 9))]
    joints = tuple(
        Joint(f"{prefix}_joint{i + 1}", links[i], links[i + 1], Pose(xyz, rot), axis, low, high)
        for i, (xyz, rot, axis, low, high) in enumerate(CHAIN)
    )
    fingers = tuple(
        Joint(
            f"{prefix}_joint{7 + i}",
            links[6],
            links[7 + i],
            Pose((0.073574, side * 0.024629, 0.0)),
            (0.0, side, 0.0),
            0.0,
            FINGER_TRAVEL,
            "prismatic",
        )
        for i, side in enumerate((1.0, -1.0))
    )
    shapes = dict(zip(links, (*LINK_SHAPES, *FINGER_SHAPES), strict=True))
    return Arm(
        name=name,
        base=Pose(base, yaw_rotation(PI / 2)),
        base_link=links[0],
        joints=joints,
        fingers=fingers,
        gripper=(-0.01, 0.045),
        tool=Pose((GRASP_CENTRE - GRIPPER.grasp_centre, 0.0, 0.0)),
        home=(0.0,) * 6,
        seeds=SEEDS,
        shapes=shapes,
        camera=WRIST_CAMERA,
        geometry="arx",
    )


def _looking(position: Vec3, forward: Vec3, left: Vec3, fov_degrees: float) -> FixedCamera:
    return FixedCamera(position, forward, left, math.radians(fov_degrees))


def _site(x: float) -> ArmSite:
    return ArmSite(base=(x, -0.417), reach=0.69, tool_reach=(0.25, 0.63), gripper=GRIPPER)


WORKCELL = Workcell(
    # The right arm is mounted at x = 0.307, but the scenes of this suite were drawn for 0.3.
    arms=(_site(-0.3), _site(0.3)),
    cameras={
        "head": _looking((-0.032, -0.45, 1.35), (0, 0.6, -0.8), (-1, 0, 0), 37),
        "front": _looking((0.0, -0.45, 0.85), (0, 1, -0.1), (-1, 0, 0), 37),
        "third": _looking((0.0, 0.23, 1.33), (0, -1, -1.02), (1, 0, 0), 93),
    },
    sideways_from=0.02,
    sideways_within=math.radians(40),
    travel_height=0.17,
    highest=0.3,
)

# The robot stands at (0, -0.65, 0) turned by 90 degrees; the bases below are in the world frame.
ALOHA_AGILEX = Embodiment(
    name="aloha-agilex",
    arms=(
        _arm("left", "fl", (-0.3, -0.417, 0.7775)),
        _arm("right", "fr", (0.307, -0.417, 0.7775)),
    ),
    workcell=WORKCELL,
    body=STAND_SHAPES,
)
