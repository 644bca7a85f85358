"""Closed-form inverse kinematics of ideal ARX-type arms: yaw, three parallel pitches, yaw, roll.

In an ideal arm joint 5's axis lies in the arm's vertical plane and meets the approach axis, so the
plane follows from the target alone, and what is left is two links in that plane. There is one
solution with the arm facing its target and the elbow up. A real arm's joints are a few millimetres
and hundredths of a radian off: the solution is then where Newton steps begin (`kinematics`).

Rotations in the arm's plane are handled as complex numbers: x - i z turns by exp(i angle).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.workcell import Gripper

Array = NDArray[np.float64]

WORKING = (
    (-np.pi, np.pi),
    (-0.05, 3.4),
    (-0.05, 3.4),
    (-np.pi / 2, np.pi / 2),
    (-1.67, 1.67),
    (-np.pi / 2 - 0.1, np.pi / 2 + 0.1),
)
"""Limits [rad] within which inverse kinematics of an ARX arm looks: those of the arm's own
description, a little widened; the one that the official simulator loads leaves them open."""
SEEDS = (
    (0.0, 1.6, 1.5, 0.0, 0.0, 0.0),
    (0.0, 2.2, 1.6, -0.9, 0.0, 0.0),
    (0.0, 1.2, 1.2, 1.2, 0.0, 0.0),
    (0.0, 2.2, 1.2, 0.3, 0.0, 0.0),
)
"""Postures from which a numerical solution starts."""

GRIPPER = Gripper(
    grasp_centre=0.12,  # official gripper_bias, ahead of link 6
    opening=0.088,
    fingertip=0.035,
    hold=0.012,
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
"""The arm's gripper, with the fingertips where Aloha-AgileX has them."""

BACKWARDS = -0.55
"""Joint 2 [rad] below this is counted a turn higher."""


@dataclass(frozen=True)
class Links:
    """Distances [m] between the axes, from the joint origins of the chain."""

    rise: float  # base to joint 1
    shoulder: complex  # joint 1 to joint 2
    upper: float  # joint 2 to joint 3
    fore: complex  # joint 3 to joint 4
    wrist: float  # joint 4 to joint 5, along the hand
    offset: float  # sideways, of joint 5 from the plane
    hand: float  # joint 5 to the end-effector frame, along the approach


def links_of(origins: Array, tool: Array) -> Links:
    """Link lengths of a chain's joint origins (6, 4, 4) and tool transform (4, 4)."""
    at = origins[:, :3, 3]
    wrist = np.eye(4)
    for origin in origins[:5]:
        wrist = wrist @ origin
    return Links(
        rise=float(at[0, 2]),
        shoulder=complex(at[1, 0], -at[1, 2]),
        upper=-float(at[2, 0]),
        # frame 3 is turned by half a turn about x: its z counts the other way
        fore=complex(at[3, 0], at[3, 2]),
        wrist=float(at[4, 0]),
        offset=float(wrist[1, 3]),
        hand=float(at[5, 0] + tool[0, 3]),
    )


def start(links: Links, local: Array) -> Array:
    """Joints (N, 6) [rad] for end-effector transforms (N, 4, 4) in the base frame.

    A target out of reach gets the stretched-out arm.
    """
    approach = local[:, :3, 0]
    wrist = local[:, :3, 3] - links.hand * approach
    x, y, z = wrist[:, 0], wrist[:, 1], wrist[:, 2] - links.rise
    far = np.maximum(np.hypot(x, y), 1e-9)
    q1 = np.arctan2(y, x) - np.arcsin(np.clip(links.offset / far, -1, 1))
    c1, s1 = np.cos(q1), np.sin(q1)
    # into the arm's plane: turn everything back by q1
    turn = np.zeros((len(local), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c1, s1, -s1, c1
    turn[:, 2, 2] = 1
    plane = turn @ local[:, :3, :3]
    ax, ay, az = plane[:, 0, 0], plane[:, 1, 0], plane[:, 2, 0]
    q5 = -np.arcsin(np.clip(ay, -1, 1))
    pitch = np.arctan2(-az, ax)
    hand = np.exp(1j * pitch)
    reach = (c1 * x + s1 * y) - 1j * z - links.shoulder - links.wrist * hand
    long, short = links.upper, abs(links.fore)
    cosine = (long**2 + short**2 - np.abs(reach) ** 2) / (2 * long * short)
    bend = np.arccos(np.clip(cosine, -1, 1))
    q3 = np.angle(links.fore) + bend
    q2 = np.angle(reach / (short * np.exp(-1j * bend) - long))
    q2 = np.where(q2 < BACKWARDS, q2 + 2 * np.pi, q2)
    q4 = np.angle(np.exp(1j * (q2 - q3 - pitch)))
    cp, sp, c5, s5 = np.cos(pitch), np.sin(pitch), np.cos(q5), np.sin(q5)
    # columns y and z of Ry(pitch) Rz(-q5), to read the roll from
    side = np.stack([cp * s5, c5, -sp * s5], axis=1)
    up = np.stack([sp, np.zeros_like(sp), cp], axis=1)
    q6 = np.arctan2((up * plane[:, :, 1]).sum(axis=1), (side * plane[:, :, 1]).sum(axis=1))
    return np.stack([q1, q2, q3, q4, q5, q6], axis=1)
