"""A workspace of any robot: objects as placed, both arms at home with open grippers."""

from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import grasp_points


def at_home(name: str, *objects: SceneObject) -> Workspace:
    """The workspace of the robot called `name`."""
    robot = embodiment(name)
    scene = Scene("none", 1, 0, robot.name, "clean", objects, {})
    left, right = (end_effector(chain_of(arm), arm.home) for arm in robot.arms)
    points = grasp_points(robot.grippers, (left, right))
    joints = (robot.arms[0].home, robot.arms[1].home)
    poses = {o.name: o.pose for o in objects}
    start = Snapshot(0.0, poses, (1.0, 1.0), (left, right), joints, grasp_points=points)
    return Workspace(scene, robot, start)
