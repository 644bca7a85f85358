"""What robots look like. The pictures need a Vulkan device."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.harness.robots import embodiment
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.shapes import Box, Cylinder, Mesh, Shape

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
