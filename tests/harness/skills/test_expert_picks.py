"""Grasps: reach, neighbours, walls, and what has fallen over; which a hand that places takes."""

import math
from dataclasses import replace

import pytest
from robot_at_home import at_home
from world_scenes import block

from robospa.baselines.oracle import create
from robospa.geometry import Pose, axis_rotation, multiply, rotate, to_matrix
from robospa.harness.robots import embodiment
from robospa.harness.skills import Expert, pick
from robospa.harness.skills.clearance import TOUCH, finger_points, neighbours, palm_points
from robospa.harness.skills.motion import object_tops, travel_height
from robospa.harness.skills.pick import (
    SPARE_OPENING,
    candidate_poses,
    reachable_grasps,
    world_grasps,
)
from robospa.harness.skills.touch import FACE, HIT_DEPTH, LEVEL, TIPPED, _spots
from robospa.harness.skills.workspace import Workspace, wall_front
from robospa.protocol.policy import TrialInfo
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Pick
from robospa.tasks.scene import SceneObject
from robospa.trial import TrialKey
from robospa.workcell import TABLE_TOP

FRANKA = embodiment("franka-panda").grippers[0]
HALF = 0.018


def lying(roll: float) -> Pose:
    """Along the world's x axis, rolled by `roll` [rad]."""
    over = axis_rotation((0.0, 1.0, 0.0), math.pi / 2)
    return Pose((0.2, 0.0, 0.8), multiply(over, axis_rotation((0.0, 0.0, 1.0), roll)))


@pytest.mark.parametrize("roll", [0.0, 0.4, math.pi / 4, 1.2])
def test_a_lying_bottle_is_grasped_across_however_it_has_rolled(roll: float) -> None:
    model = object_model("bottle")
    found = world_grasps(model, lying(roll), embodiment("ur5-wsg").grippers[0])
    assert found
    for grasp in found:
        along = rotate(lying(roll).rotation, (0.0, 0.0, 1.0))
        assert abs(sum(a * b for a, b in zip(grasp.closing, along, strict=True))) < 1e-6
        assert abs(grasp.closing[2]) < 0.5


def test_what_is_too_wide_when_it_lies_is_grasped_by_one_of_its_parts() -> None:
    cup = object_model("cup")
    assert min(cup.size) > FRANKA.opening
    found = world_grasps(cup, lying(0.0), FRANKA)
    assert found and all(grasp.width < FRANKA.opening for grasp in found)


def test_what_a_hand_grasps_when_it_stands_it_grasps_when_it_lies() -> None:
    bottle = object_model("pill_bottle")
    standing = max(grasp.width for grasp in bottle.grasps)
    narrow = replace(FRANKA, opening=standing + SPARE_OPENING)
    assert min(bottle.size) > standing
    for roll in (0.0, 0.8):
        widths = [grasp.width for grasp in world_grasps(bottle, lying(roll), narrow)]
        assert widths and max(widths) <= standing + 1e-6


def tower_beside() -> Workspace:
    """A Piper, a block, and a tower of three so near that a level hand is in it."""
    tower = (block(f"block_{1 + n}", 0.0, -0.115, HALF, 2 * n * HALF) for n in range(3))
    return at_home("piper", block("block_0", 0.037, -0.033, HALF), *tower)


def test_a_hand_that_goes_on_to_place_leans_before_it_touches_a_tower() -> None:
    call = Pick("block_0", lift=0.2, arm="right")
    straight, *_ = pick._choose(tower_beside(), call, [], None)
    careful, *_ = pick._choose(tower_beside(), call, [], lambda _: True)
    assert straight.depth > TOUCH
    assert careful.depth <= TOUCH


ROBOT = embodiment("aloha-agilex")
HAND = ROBOT.arms[0].gripper
UNTUNED_SEED = 7_000_000


def thing(name: str, y: float, half: tuple[float, float, float], x: float = -0.15) -> SceneObject:
    params = {"half": list(half), "color": [1.0, 0.0, 0.0]}
    return SceneObject(name, "block", Pose((x, y, TABLE_TOP + half[2])), params)


def test_a_grasp_closes_on_the_object_and_clears_the_table() -> None:
    ws = at_home(ROBOT.name, block("b", -0.15, -0.1))
    best = reachable_grasps(ws, "b", (0, 1))[0]
    frame = to_matrix(best.pose.rotation)
    centre = [p + HAND.grip * a for p, a in zip(best.pose.position, best.approach, strict=True)]
    assert best.arm == 0
    assert centre == pytest.approx([-0.15, -0.1, TABLE_TOP + 0.02], abs=0.011)
    assert centre[2] + HAND.hold * frame[2, 0] > TABLE_TOP + 0.002


def test_each_side_gets_its_own_arm() -> None:
    arms = [
        reachable_grasps(at_home(ROBOT.name, block("b", x, -0.1)), "b", (0, 1))[0].arm
        for x in (-0.2, 0.2)
    ]
    assert arms == [0, 1]


def test_fingers_do_not_go_where_a_neighbour_stands() -> None:
    ws = at_home(ROBOT.name, block("b", -0.15, -0.05), block("wall", -0.15 + 0.045, -0.05))
    best = reachable_grasps(ws, "b", (0,))[0]
    for points in (finger_points(HAND, best.pose, 0.062), palm_points(HAND, best.pose)):
        assert neighbours(ws, "b").depth(points) == 0.0


def test_nothing_reaches_beyond_the_table() -> None:
    assert reachable_grasps(at_home(ROBOT.name, block("b", 0.0, 0.6)), "b", (0, 1)) == []


def test_low_objects_are_taken_with_the_tips_above_the_table() -> None:
    from robospa.tasks.shapes import Grasp

    flat = Grasp((0.0, 0.0, TABLE_TOP + 0.002), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 0.03)
    for pose, approach, _ in candidate_poses(flat, HAND, TABLE_TOP):
        tip = pose.position[2] + (HAND.grasp_centre + HAND.fingertip) * approach[2]
        assert tip > TABLE_TOP + 0.002


def test_the_expert_holds_still_when_its_plan_is_over() -> None:
    scene = build_scene("Press_Stapler_Repeat", 1, 0)
    snapshot = at_home(ROBOT.name, *scene.objects).snapshot
    expert = Expert(scene, snapshot)
    for _ in range(10):
        rows = expert.next(snapshot)
    assert rows.shape == (1, 14)


def test_the_oracle_says_that_it_is_privileged() -> None:
    oracle = create()
    assert oracle.spec.privileged
    with pytest.raises(RuntimeError, match="before a reset"):
        oracle.infer({})
    with pytest.raises(ValueError, match="needs the trial's key"):
        oracle.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "pick it up"))


@pytest.mark.sim
@pytest.mark.parametrize("name", list(tasks()))
def test_the_oracle_solves_unseen_seeds(name: str) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    world = SapienWorld(render=False)
    for level in (1, 3):
        record = run_trial(
            world, create(), TrialKey(name, level, UNTUNED_SEED + level), policy_seed=0
        )
        assert record.success, record.message or record.events
        assert record.done == record.total


WALL_Y = 0.06
CUBE = thing("cube", 0.0, (0.02, 0.02, 0.02))
WALL = thing("wall", WALL_Y, (0.34, 0.005, 0.2), x=0.0)
BEHIND = thing("behind", 0.2, (0.02, 0.02, 0.1))


def test_a_wall_and_what_is_behind_it_are_not_travelled_over() -> None:
    ws = at_home(ROBOT.name, CUBE, WALL, BEHIND)
    assert wall_front(ws) == pytest.approx(WALL_Y - 0.005)
    assert len(object_tops(ws, None)) == 1
    assert travel_height(ws, 0) == TABLE_TOP + ROBOT.travel_height
    assert len(object_tops(at_home(ROBOT.name, CUBE, BEHIND), None)) == 2


def test_the_gripper_stays_in_front_of_the_wall() -> None:
    best = reachable_grasps(at_home(ROBOT.name, CUBE, WALL), "cube", (0,))[0]
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
        assert min(edges) == pytest.approx(goal.position[2] - HIT_DEPTH, abs=1e-3)
