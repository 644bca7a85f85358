"""Skills that take an object somewhere in a certain attitude: docking, hanging, pouring."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Pose, rotate
from robospa.gripper import grasp_points
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.skills import hang, pour
from robospa.harness.skills.approach import approach_joints, translated
from robospa.harness.skills.narrow import MARGIN, Narrow
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.catalog import build_scene
from robospa.tasks.plan import Hang, Pour
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot

ROBOT = embodiment("aloha-agilex")
UPWARDS = (0.0, 0.0, 1.0)


def at_rest(scene: Scene) -> Snapshot:
    """The scene as drawn, both arms at home with open grippers."""
    left, right = (end_effector(chain_of(a), a.home) for a in ROBOT.arms)
    points = grasp_points(ROBOT.grippers, (left, right))
    joints = (ROBOT.arms[0].home, ROBOT.arms[1].home)
    poses = {o.name: o.pose for o in scene.objects}
    return Snapshot(0.0, poses, (1.0, 1.0), (left, right), joints, grasp_points=points)


def workspace(name: str, level: int) -> tuple[Scene, Workspace]:
    scene = build_scene(name, level, 500_000)
    return scene, Workspace(scene, ROBOT, at_rest(scene))


def test_a_path_ends_at_the_target_and_starts_where_it_is_told() -> None:
    _, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    here = ws.snapshot.end_effector[1]
    target = translated(here, (0.0, 0.05, 0.0))
    way = approach_joints(
        ws, 1, Pose(), [target], [(0.0, 0.0, 0.04), (0.0, 0.0, 0.0)], ws.joints[1]
    )
    assert way is not None
    ends = [end_effector(ws.chains[1], tuple(joints)).position for joints in way]
    assert ends[1] == pytest.approx(target.position, abs=2e-3)
    assert ends[0] == pytest.approx(translated(target, (0.0, 0.0, 0.04)).position, abs=2e-3)


def test_there_is_no_path_to_what_is_out_of_reach() -> None:
    _, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    far = Pose((0.0, 3.0, 1.0))
    assert approach_joints(ws, 1, Pose(), [far], [(0.0, 0.0, 0.0)], ws.joints[1]) is None


def test_a_mug_is_brought_with_the_peg_through_its_handle() -> None:
    scene, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    mug, rack = scene.facts["mug"], scene.facts["rack"]
    peg = ws.pose(rack) * ws.models[rack].frames["hang"]
    handle = ws.models[mug].frames["handle"]
    for target in hang._targets(peg, handle, hang.WOBBLES):
        middle = (target * handle).position
        assert middle == pytest.approx(translated(peg, (0.0, 0.0, -hang.SAG)).position, abs=1e-9)
        through = rotate(target.rotation, (0.0, 1.0, 0.0))
        along = rotate(peg.rotation, (0.0, 1.0, 0.0))
        assert abs(sum(a * b for a, b in zip(through, along, strict=True))) > math.cos(0.35)


@pytest.mark.parametrize(("aside", "free"), [(0.0, False), (0.3, True)])
def test_a_way_past_a_rack_is_free_only_where_the_hand_does_not_meet_it(
    aside: float, free: bool
) -> None:
    scene, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    rack = scene.facts["rack"]
    x, y, z = ws.snapshot.end_effector[1].position
    below = Pose((x + aside, y + 0.12, z - 0.15))  # the post goes through the fingers
    snapshot = replace(ws.snapshot, poses=ws.snapshot.poses | {rack: below})
    here = Workspace(scene, ROBOT, snapshot)
    narrow = Narrow(here, 1, rack, Pose())
    assert narrow.free([here.joints[1], here.joints[1]]) is free


@pytest.mark.parametrize(("below", "above"), [(0.05, True), (0.25, False)])
def test_a_way_is_above_the_table_only_where_what_is_held_stays_so(
    below: float, above: bool
) -> None:
    scene, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    end = ws.snapshot.end_effector[1]
    x, y, z = end.position
    assert (z - below > ws.scene.table_top + MARGIN) is above
    narrow = Narrow(ws, 1, scene.facts["rack"], end.inverse() * Pose((x, y, z - below)))
    assert narrow.above_table([ws.joints[1], ws.joints[1]]) is above


@pytest.mark.parametrize(("aside", "past"), [(0.0, False), (0.4, True)])
def test_a_mug_is_carried_past_a_rack_only_where_they_do_not_meet(aside: float, past: bool) -> None:
    scene, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    mug, rack = scene.facts["mug"], scene.facts["rack"]
    here, stands = ws.snapshot.end_effector[1], ws.pose(rack)
    x, y, _ = stands.position
    ws.held[1] = mug
    held_at = Pose((x + aside, y, ws.scene.table_top), ws.pose(mug).rotation)
    narrow = Narrow(ws, 1, rack, here.inverse() * held_at)
    assert narrow.carried_past([ws.joints[1], ws.joints[1]]) is past


def test_targets_of_the_last_attempt_keep_the_handle_at_the_peg_and_turn_it_farther() -> None:
    scene, ws = workspace("Hang_Mug_Stack_Blocks", 1)
    peg = ws.pose(scene.facts["rack"]) * ws.models[scene.facts["rack"]].frames["hang"]
    handle = ws.models[scene.facts["mug"]].frames["handle"]
    targets = hang._far_targets(peg, handle)
    under = translated(peg, (0.0, 0.0, -hang.SAG)).position
    assert all((t * handle).position == pytest.approx(under, abs=1e-9) for t in targets)
    upright = [rotate(t.rotation, UPWARDS)[2] for t in targets]
    usual = [rotate(t.rotation, UPWARDS)[2] for t in hang._targets(peg, handle, hang.WOBBLES)]
    assert targets[:2] == hang._targets(peg, handle, (0.0,))[:2] and min(upright) < min(usual)


def test_a_bin_is_emptied_upside_down_with_its_mouth_over_the_container() -> None:
    scene, ws = workspace("Place_Phone_Press_Stapler", 5)
    call = Pour(scene.facts["table_trash_bin"], into=scene.facts["dustbin"])
    model, container = ws.models[call.object], ws.models[call.into]
    middle = ws.pose(call.into).position
    for target in pour._targets(ws, call):
        assert rotate(target.rotation, UPWARDS)[2] < -0.4
        x, y, z = target.apply((0.0, 0.0, model.size[2]))
        assert abs(x - middle[0]) < container.size[0] / 2 - 0.1
        assert abs(y - middle[1]) < container.size[1] / 2 - 0.1
        assert z > middle[2] + container.size[2]


def test_before_the_peg_the_wrist_does_not_turn_over() -> None:
    # the mug has slipped by 6 mm on its way: the first target left needs the other posture
    scene = build_scene("Hang_Mug_Stack_Blocks", 1, 900_000, "piper")
    mug, rack = scene.facts["mug"], scene.facts["rack"]
    ws = at_home("piper", *scene.objects)
    ws.joints[1] = np.array([-0.03, 2.21, -1.53, 1.78, 1.07, -1.68])
    hand = end_effector(ws.chains[1], ws.joints[1])
    slipped = Pose((0.188, 0.029, -0.033), (0.84, 0.11, -0.5, -0.18))
    ends, poses = (ws.snapshot.end_effector[0], hand), {**ws.snapshot.poses, mug: hand * slipped}
    ws.snapshot, ws.held[1] = replace(ws.snapshot, end_effector=ends, poses=poses), mug
    call = Hang(mug, rack)
    peg = ws.pose(rack) * ws.models[rack].frames[call.frame]
    handle = ws.models[mug].frames[call.handle]
    paths = [hang._path(peg, out) for out in hang.OUTS]
    choices = (hang._targets(peg, handle, (0.0,)), hang._targets(peg, handle, hang.WOBBLES))
    turned = []
    for farthest in (math.inf, hang.BEFORE_PEG):
        way = hang._held_way(ws, call, 1, choices, paths, farthest)
        assert way is not None
        turned.append(float(np.abs(way[0] - ws.joints[1]).max()))
    assert turned[0] > hang.BEFORE_PEG > turned[1]
