"""Small scenes of blocks for the tests of the world, and a robot with arms of two kinds."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP

READY = (0.0, 1.6, 1.5, 0.0, 0.0, 0.0)
RED = (0.7, 0.1, 0.1)


def block(
    name: str, x: float, y: float, half: float = 0.02, lift: float = 0.0, **more: Any
) -> SceneObject:
    """A cube on the table, `lift` above it."""
    pose = Pose((x, y, TABLE_TOP + half + lift))
    return SceneObject(name, "block", pose, {"half": [half] * 3, "color": list(RED)}, **more)


def scene(*objects: SceneObject, **more: Any) -> Scene:
    """A scene of a task that does not exist."""
    return Scene("Test_Blocks", 1, 100000, "aloha-agilex", "clean", objects, {}, **more)


def two_blocks() -> Scene:
    return scene(block("one", -0.1, 0.0), block("two", 0.15, 0.05))


def joint_action(
    left: tuple[float, ...] = READY,
    right: tuple[float, ...] = READY,
    grip: tuple[float, float] = (1.0, 1.0),
) -> NDArray[np.float32]:
    return np.array([*left, grip[0], *right, grip[1]], dtype=np.float32)


def wandering(count: int, seed: int) -> list[NDArray[np.float32]]:
    """Random joint actions that sweep both arms over the table."""
    rng = np.random.default_rng(seed)
    low = np.array([-0.5, 1.2, 1.0, -1.2, -0.5, -0.5, 0.0] * 2)
    high = np.array([0.5, 2.4, 1.8, 0.5, 0.5, 0.5, 1.0] * 2)
    return [rng.uniform(low, high).astype(np.float32) for _ in range(count)]


def go_on(snapshot: Snapshot) -> bool:
    """What a trial without a success says of every instant."""
    return False


def run_digest(world: Any, loaded: Scene, seed: int) -> str:
    """Load, wander, hash."""
    world.load(loaded)
    for action in wandering(4, seed):
        world.step(action, "joint", go_on)
    return str(world.digest())


def unequal_arms() -> Embodiment:
    """The default robot, but with a seventh joint between its right arm and gripper."""
    robot = embodiment("aloha-agilex")
    left, right = robot.arms
    last = right.joints[-1]
    extra = replace(last, name="extra", parent=last.child, child="extra_link", origin=Pose())
    fingers = tuple(
        replace(finger, parent=extra.child) if finger.parent == last.child else finger
        for finger in right.fingers
    )
    right = replace(
        right,
        joints=(*right.joints, extra),
        fingers=fingers,
        home=(*right.home, 0.0),
        seeds=tuple((*seed, 0.0) for seed in right.seeds),
        shapes={**right.shapes, extra.child: ()},
        working=(*right.working, right.working[-1]),
        geometry="any",
    )
    return replace(robot, arms=(left, right))
