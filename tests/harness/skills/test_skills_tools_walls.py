"""The expert in front of a wall, and with a hammer: what it keeps clear of, what it hits."""

from __future__ import annotations

import pytest
from robot_at_home import at_home

from robospa.geometry import Pose, to_matrix
from robospa.gripper import grasp_points
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.skills.grasping import reachable_grasps
from robospa.harness.skills.hit import DEPTH, FACE, LEVEL, TIPPED, _spots
from robospa.harness.skills.motion import object_tops, travel_height
from robospa.harness.skills.workspace import Workspace, wall_front
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP

ROBOT = embodiment("aloha-agilex")
WALL_Y = 0.06


def thing(name: str, y: float, half: tuple[float, float, float], x: float = -0.15) -> SceneObject:
    params = {"half": list(half), "color": [1.0, 0.0, 0.0]}
    return SceneObject(name, "block", Pose((x, y, TABLE_TOP + half[2])), params)


def workspace(*objects: SceneObject) -> Workspace:
    """A scene at rest, both arms at home with open grippers."""
    scene = Scene("none", 1, 0, ROBOT.name, "clean", objects, {})
    left, right = (end_effector(chain_of(a), a.home) for a in ROBOT.arms)
    points = grasp_points(ROBOT.grippers, (left, right))
    joints = (ROBOT.arms[0].home, ROBOT.arms[1].home)
    poses = {o.name: o.pose for o in objects}
    start = Snapshot(0.0, poses, (1.0, 1.0), (left, right), joints, grasp_points=points)
    return Workspace(scene, ROBOT, start)


CUBE = thing("cube", 0.0, (0.02, 0.02, 0.02))
WALL = thing("wall", WALL_Y, (0.34, 0.005, 0.2), x=0.0)
BEHIND = thing("behind", 0.2, (0.02, 0.02, 0.1))


def test_a_wall_and_what_is_behind_it_are_not_travelled_over() -> None:
    ws = workspace(CUBE, WALL, BEHIND)
    assert wall_front(ws) == pytest.approx(WALL_Y - 0.005)
    assert len(object_tops(ws, None)) == 1
    assert travel_height(ws, 0) == TABLE_TOP + ROBOT.travel_height
    assert len(object_tops(workspace(CUBE, BEHIND), None)) == 2


def test_the_gripper_stays_in_front_of_the_wall() -> None:
    best = reachable_grasps(workspace(CUBE, WALL), "cube", (0,))[0]
    closing = to_matrix(best.pose.rotation)[:, 1]
    assert abs(closing[0]) > abs(closing[1])  # the wide side of the palm lies along the wall


def test_a_block_beyond_the_reach_of_a_level_hammer_is_hit_with_its_edge() -> None:
    scene = build_scene("Hit_Blocks_Hammer_Order", 4, 900_009, "piper")
    facts = scene.facts
    ws = at_home("piper", *scene.objects)
    hammer, name = facts["hammer"], facts["order"][-1]
    offsets = [g.pose.inverse() * ws.pose(hammer) for g in reachable_grasps(ws, hammer, (0,))]
    offset = next(o for o in offsets if not _spots(ws, 0, o, hammer, name, LEVEL))
    spots = _spots(ws, 0, offset, hammer, name, TIPPED)
    goal = ws.pose(name) * ws.models[name].frames["press"]
    head = ws.models[hammer].frames["head"]
    assert spots
    for spot in spots:
        face = spot.pose * offset * head
        assert face.position[:2] == pytest.approx(goal.position[:2], abs=1e-3)
        edges = [face.apply((0.0, y, 0.0))[2] for y in (FACE, -FACE)]
        assert min(edges) == pytest.approx(goal.position[2] - DEPTH, abs=1e-3)


@pytest.mark.sim
@pytest.mark.parametrize("level", [1, 4])
def test_the_hammer_hits_all_blocks_in_order(level: int) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.skills import Expert

    scene = build_scene("Hit_Blocks_Hammer_Order", level, 7_000_000)
    goal = task(scene.task).goal(scene)
    world = SapienWorld(render=False)
    world.load(scene, goal.needs_contacts)
    goal.start(world.snapshot())
    expert, kinds = Expert(scene, world.snapshot()), []

    def poll(snapshot: Snapshot) -> bool:
        kinds.extend(e.kind for e in goal.update(snapshot))
        return "success" in kinds

    for _ in range(40):
        for row in expert.next(world.snapshot()):
            if "success" not in kinds:
                world.step(row, "joint", poll)
    world.close()
    assert "success" in kinds and "wrong_order" not in kinds
