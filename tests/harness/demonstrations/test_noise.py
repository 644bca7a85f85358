"""Where noise finds room, and where a motion is left as it is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Pose
from robospa.harness.demonstrations.clearance import depths, gaps
from robospa.harness.demonstrations.noise import Noise, deviation
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS, Trajectory, rest_to_rest
from robospa.harness.skills.grasping import reachable_grasps
from robospa.harness.skills.workspace import Workspace, moved_back
from robospa.tasks.scene import SceneObject
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.workcell import TABLE_TOP

STRENGTH = 0.04


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


def disturbed(path: Trajectory, *touched: str, seed: int = 0) -> tuple[Trajectory, Noise]:
    ws = workspace()
    contacts = tuple(Contact("left_gripper", name, (0.0, 0.0, 0.0)) for name in touched)
    world = AtHome(ws.snapshot, contacts)
    noise = Noise(world, ws, np.random.default_rng(seed), STRENGTH)  # type: ignore[arg-type]
    return noise.disturb(path), noise


@pytest.mark.parametrize("seed", range(4))
def test_a_disturbed_way_has_the_same_ends_and_keeps_to_its_bounds(seed: int) -> None:
    ws, path = workspace(), way_to_the_block(workspace())
    way, noise = disturbed(path, seed=seed)
    ((off, _),) = noise.pushes
    assert 0.003 <= off <= STRENGTH + 1e-3
    assert len(way) == len(path)
    assert np.array_equal(way.joints[:, [0, -1]], path.joints[:, [0, -1]])
    assert (way.velocities[:, -1] == path.velocities[:, -1]).all()
    assert np.array_equal(way.joints[1], path.joints[1])
    tip = ws.hand(0).tip
    assert deviation(ws.chains[0], tip, path.joints[0], way.joints[0])[0] <= STRENGTH * 1.05
    assert depths(ws, 0, way.joints[0, ::20]).max() <= depths(ws, 0, path.joints[0]).max() + 0.002


def test_a_gripper_that_touches_something_unknown_is_left_alone() -> None:
    path = way_to_the_block(workspace())
    way, noise = disturbed(path, "b")
    assert way is path and not noise.pushes


def test_a_short_motion_is_left_alone() -> None:
    path = way_to_the_block(workspace(), share=0.02)
    way, noise = disturbed(path)
    assert way is path and not noise.pushes


def test_room_ends_at_the_block_and_at_the_table() -> None:
    ws = workspace()
    grasp = reachable_grasps(ws, "b", (0,))[0]
    assert depths(ws, 0, ws.joints[0][None])[0] == 0.0
    assert depths(ws, 0, grasp.joints[None])[0] > 0.005
    assert gaps(ws, ws.joints[0][None], ws.joints[1][None])[0] > 0.2
