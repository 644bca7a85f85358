"""Forward and inverse kinematics of the arms, from a closed-form start and numerical."""

import math

import numpy as np
import pytest

from robospa.geometry import Pose, from_transform, look_rotation
from robospa.harness.robots import embodiment, fixed_order
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.kinematics import chain_of, forward, inverse
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.shapes import Box, Cylinder, Mesh, Shape

ARMS = embodiment("aloha-agilex").arms


def random_joints(arm: Arm, count: int) -> np.ndarray:
    """Postures in front of the robot with the elbow up, away from the limits."""
    rng = np.random.default_rng(7)
    low, high = (-0.8, 1.2, 0.9, -1.2, -1.2, -1.4), (0.8, 2.4, 2.2, 1.2, 1.2, 1.4)
    return rng.uniform(low, high, (count, len(arm.joints)))


@pytest.mark.parametrize("arm", ARMS, ids=lambda a: a.name)
def test_inverse_returns_the_joints_that_made_the_pose(arm: Arm) -> None:
    chain = chain_of(arm)
    joints = random_joints(arm, 500)
    frames, _ = forward(chain, joints)
    found, ok = inverse(chain, [from_transform(f) for f in frames])
    assert ok.all()
    assert np.abs(found - joints).max() < 1e-9


def test_out_of_reach_is_said_not_raised() -> None:
    down = look_rotation((0, 0, -1), (-1, 0, 0))
    _, ok = inverse(
        chain_of(ARMS[0]), [Pose((-0.3, 0.6, 0.9), down), Pose((-0.3, -0.1, 0.9), down)]
    )
    assert ok.tolist() == [False, True]


@pytest.mark.parametrize("robot", ["aloha-agilex", "piper", "franka-panda"])
def test_answers_do_not_depend_on_the_targets_beside_them(robot: str) -> None:
    """Some of these targets are found from the first posture, some from later ones, some never."""
    chain = chain_of(embodiment(robot).arms[0])
    rng = np.random.default_rng(5)
    limits = chain.working_lower.clip(-3, 3), chain.working_upper.clip(-3, 3)
    frames, _ = forward(chain, rng.uniform(*limits, (40, len(chain.axes))))
    poses = [from_transform(frame) for frame in frames]
    joints, ok = inverse(chain, poses)
    alone = [inverse(chain, [pose]) for pose in poses]
    assert 0 < ok.sum() < len(poses)
    assert [bool(one[1][0]) for one in alone] == ok.tolist()
    assert all(np.array_equal(one[0][0], row) for one, row in zip(alone, joints, strict=True))


CHAIN = chain_of(embodiment("aloha-agilex").arms[0])

FIXED = fixed_order.fixed_chain(CHAIN)

POSTURES = np.random.default_rng(0).uniform(CHAIN.lower, CHAIN.upper, (100, 6))


@pytest.mark.parametrize("largest", [1.0, 7.0, 999.0])
def test_sine_and_cosine(largest: float) -> None:
    assert fixed_order.sine_cosine(0.0) == (0.0, 1.0)
    for angle in np.linspace(-largest, largest, 2001).tolist():
        expected = (math.sin(angle), math.cos(angle))
        assert fixed_order.sine_cosine(angle) == pytest.approx(expected, abs=3e-16)


def test_the_end_effector_is_where_numpy_has_it() -> None:
    frames = forward(CHAIN, POSTURES)[0]
    for joints, expected in zip(POSTURES, frames, strict=True):
        found = fixed_order.end_frame(FIXED, joints.tolist())
        np.testing.assert_allclose(np.array(found.turn), expected[:3, :3], atol=3e-15)
        np.testing.assert_allclose(found.at, expected[:3, 3], atol=3e-15)


def test_refining_stays_within_the_limits() -> None:
    far = fixed_order.FixedPose(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (5.0, 5.0, 5.0)
    )
    for joints in POSTURES[:20].tolist():
        found = fixed_order.refined(FIXED, joints, far, 5)
        assert all(
            low <= angle <= high
            for low, angle, high in zip(FIXED.lower, found, FIXED.upper, strict=True)
        )


# ----------------------------------------- what robots look like. The pictures need a Vulkan device


ROBOTS = ("aloha-agilex", "franka-panda", "ur5-wsg", "piper", "ARX-X5")
MOST = 6_000
"""Triangles of an arm: the picture of an arm costs what its corners cost."""


def triangles(shape: Shape) -> int:
    """How many are drawn."""
    if isinstance(shape.geometry, Mesh):
        return len(shape.geometry.faces)
    return {Box: 12, Cylinder: 96}[type(shape.geometry)]


@pytest.mark.parametrize("name", ROBOTS)
def test_arms_are_cheap_to_draw(name: str) -> None:
    for arm in embodiment(name).arms:
        assert sum(triangles(s) for link in arm.shapes.values() for s in link if s.visual) <= MOST


@pytest.mark.sim
def test_robots_are_told_apart_by_their_colors() -> None:
    world = SapienWorld(render=True)
    white, blue, dark = {}, {}, {}
    for name in ROBOTS:
        world.load(build_scene("Basic_Color_Blocks", 1, 100003, name))
        upper = world.render(CameraSpec("third", 320, 240))[:125].astype(int)
        red, green, last = np.moveaxis(upper, -1, 0)
        white[name] = float((upper.min(axis=2) > 205).mean())
        blue[name] = float(((last > 120) & (last > red + 50) & (last > green + 20)).mean())
        dark[name] = float((upper.max(axis=2) < 75).mean())
    world.close()
    assert white["franka-panda"] > 0.03
    assert max(white[n] for n in ("aloha-agilex", "ur5-wsg", "ARX-X5")) < 0.01
    assert 0.002 < white["piper"] < 0.5 * white["franka-panda"]
    assert blue["ur5-wsg"] > 0.01
    assert max(blue[n] for n in ROBOTS if n != "ur5-wsg") < 0.001
    assert min(dark["aloha-agilex"], dark["ARX-X5"]) > 0.01
