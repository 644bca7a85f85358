"""A robot whose arms have different joint counts: six left, seven right."""

from dataclasses import replace

from world_scenes import READY

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment

__all__ = ["READY", "unequal_arms"]


def unequal_arms() -> Embodiment:
    """The default robot with a seventh joint between its right arm and gripper."""
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
