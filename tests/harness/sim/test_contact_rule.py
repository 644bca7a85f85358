"""What counts as a press in physics: the official meaning of contact, and the strict one."""

import math
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.geometry import Pose, Vec3, axis_rotation, look_rotation, rotate
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import inverse
from robospa.harness.skills.workspace import Workspace, moved_back
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.catalog import build_scene
from robospa.trial import TrialKey

HOVER = 0.06
SEED = 100003


class Taps:
    """Moves a closed gripper straight down to heights [m] above a press frame, one after another.

    Between two of them it goes back up to `between` [m].
    """

    spec = PolicySpec(name="taps", action="joint", cameras=(), privileged=True)

    def __init__(self, world: Any, key: TrialKey, heights: list[float], between: float) -> None:
        scene = build_scene(key.task, key.level, key.seed)
        world.load(scene)
        ws = Workspace(scene, embodiment(scene.embodiment), world.snapshot())
        (name,) = (o.name for o in scene.objects if "press" in ws.models[o.name].frames)
        x, y, z = (ws.pose(name) * ws.models[name].frames["press"]).position
        arm = int(x > 0)
        path = [HOVER]
        for height in heights:
            path += [height, height + between]
        path[-1] = HOVER
        for joints in _postures(ws, arm, (x, y, z), path):
            ws.add(arm, joints, 0.0)
        self.rows = np.asarray(ws.rows, dtype=np.float32)

    def reset(self, trial: TrialInfo) -> None:
        self.left = self.rows

    def infer(self, observation: dict[str, Any]) -> NDArray[np.float32]:
        rows, self.left = self.left, self.left[-1:]
        return rows


def _postures(ws: Workspace, arm: int, at: Vec3, heights: list[float]) -> list[NDArray[np.float64]]:
    """Joints that bring the fingertips to so many metres above `at`, with one orientation."""
    x, y, z = at
    for tilt, turn, side in product((0.0, 0.2, 0.4, 0.6), range(8), (1, -1)):
        angle = math.pi * turn / 8
        closing = (side * math.cos(angle), side * math.sin(angle), 0.0)
        approach = rotate(axis_rotation(closing, tilt), (0, 0, -1))
        turned = look_rotation(approach, closing)
        poses = [
            moved_back(Pose((x, y, z + height), turned), approach, ws.hand(arm).tip)
            for height in heights
        ]
        joints, reached = inverse(ws.chains[arm], poses)
        if reached.all():
            return list(joints)
    raise AssertionError("no orientation reaches every height")


@pytest.mark.sim
@pytest.mark.parametrize("task", ["Press_Stapler_Repeat", "Click_Bell_Repeat"])
@pytest.mark.parametrize(
    ("heights", "between", "counted", "touched"),
    [
        ([-0.006] * 3, 0.05, 3, 2),  # three taps; the third succeeds before it touches
        ([0.01] * 3, 0.05, 3, 0),  # hovering 1 cm above is a contact
        ([0.015] * 3, 0.05, 3, 0),
        ([-0.006] * 3, 0.009, 1, 3),  # going up by 3 or 9 mm is no leaving
        ([-0.006] * 3, 0.016, 1, 3),
        ([0.03] * 3, 0.05, 0, 0),
    ],
)
def test_a_reported_contact_counts_whatever_its_impulse(
    task: str, heights: list[float], between: float, counted: int, touched: int
) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    key = TrialKey(task, 3, SEED)
    world = SapienWorld(render=False)
    record = run_trial(world, Taps(world, key, heights, between), key, policy_seed=0)
    assert record.diagnostics["presses"] == counted
    assert record.diagnostics["touched"] == touched
    assert record.success == (counted == 3)
