"""An arm's own links stay out of table and objects; ways around what stands close beside."""

from itertools import pairwise

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Array, Pose, look_rotation
from robospa.harness.robots import embodiments
from robospa.harness.robots.kinematics import end_effector, inverse, link_frames
from robospa.harness.skills.bring_in import NarrowPassage, detour_stop
from robospa.harness.skills.clearance import TOUCH, arm_depth, edge_depth, part_boxes
from robospa.harness.skills.motion import blocked, detour, route
from robospa.harness.skills.pick import pick
from robospa.harness.skills.touch import press
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.catalog import build_scene
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Pick, Press
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

DOWN = look_rotation((0.0, 0.0, -1.0), (1.0, 0.0, 0.0))


def block(x: float, y: float, z: float, half: float) -> SceneObject:
    look = {"half": [half] * 3, "color": [1.0, 0.0, 0.0]}
    return SceneObject("thing", "block", Pose((x, y, z)), look, fixed=True)


@pytest.mark.parametrize("name", embodiments())
def test_arms_at_home_touch_nothing(name: str) -> None:
    ws = at_home(name)
    for arm in (0, 1):
        assert arm_depth(ws, arm, np.array([ws.robot.arms[arm].home]))[0] == 0.0


@pytest.mark.parametrize("name", embodiments())
def test_a_thing_where_the_hand_is_is_in_its_way(name: str) -> None:
    home = np.array([at_home(name).robot.arms[1].home])
    hand = link_frames(at_home(name).chains[1], home)[-1][0] @ [*(0.0, 0.0, 0.0), 1.0]
    ws = at_home(name, block(*hand[:3].tolist(), 0.05))
    assert arm_depth(ws, 1, home)[0] > 0.01
    assert arm_depth(ws, 1, home, "thing")[0] == 0.0


def test_a_level_hand_near_the_table_is_in_it_though_its_fingers_are_not() -> None:
    ws = at_home("franka-panda")
    level = look_rotation((0.0, 1.0, -0.1), (1.0, 0.0, 0.0))
    poses = [Pose((0.3, -0.1, TABLE_TOP + height), level) for height in (0.035, 0.12)]
    joints, reached = inverse(ws.chains[1], poses)
    low, high = arm_depth(ws, 1, joints)
    assert reached.all() and low > TOUCH and high == 0.0


def test_a_way_is_blocked_by_what_the_forearm_would_sweep_over() -> None:
    # the fingers pass 0.1 m above the thing, the wrist through it
    ws = at_home("franka-panda")
    home = np.array(ws.robot.arms[1].home)
    turned = np.concatenate([home[:1] + 0.6, home[1:]])
    assert not blocked(ws, 1, home, turned)
    middle = link_frames(ws.chains[1], (home + turned)[None] / 2)[5][0, :3, 3]
    behind = at_home("franka-panda", block(*middle.tolist(), 0.03))
    assert blocked(behind, 1, home, turned)


@pytest.mark.parametrize(("name", "wide"), [("franka-panda", True), ("aloha-agilex", False)])
def test_only_a_wide_hand_has_edges(name: str, wide: bool) -> None:
    home = np.array([at_home(name).robot.arms[1].home])
    everywhere = at_home(name, block(0.0, 0.0, TABLE_TOP, 3.0))
    assert arm_depth(everywhere, 1, home)[0] > 0.0
    assert (edge_depth(everywhere, 1, home)[0] > 0.0) == wide


def test_a_press_keeps_the_edges_of_a_wide_hand_off_what_stands_beside() -> None:
    # straight down above the cards the hand would stop on the clock
    scene = build_scene("Click_Objects_Order", 4, 900_001)
    ws = at_home("franka-panda", *scene.objects)
    cards = next(o.name for o in scene.objects if o.asset == "playing_cards")
    rows = next(press(ws, Press(cards, arm="left")))
    side = ws.robot.action_space("joint").arms[0]
    assert edge_depth(ws, 0, rows[:, side.body]).max() == 0.0
    frame = ws.pose(cards) * ws.models[cards].frames["press"]
    x, y, z = frame.position
    straight, _ = inverse(ws.chains[0], [Pose((x, y, z + ws.hand(0).tip), DOWN)])
    assert edge_depth(ws, 0, straight)[0] > 0.0


def test_a_short_touch_on_a_long_way_is_seen() -> None:
    # a hand that takes the long way home around its column passes a bottle within the first tenth
    bottle = Pose((-0.042, -0.08, TABLE_TOP))
    ws = at_home("ur5-wsg", SceneObject("thing", "bottle", bottle, {"look": 1}))
    start = np.array([2.38, -1.0, 1.81, -0.82, 2.37, 0.0])
    assert arm_depth(ws, 1, start[None])[0] == 0.0
    assert blocked(ws, 1, start, np.array(ws.robot.arms[1].home))


def test_a_hand_that_comes_down_from_a_wide_swing_is_seen_over_what_it_passes_last() -> None:
    # half a turn about the column; the fingers sink to the bottle's height in the last twentieth
    bottle = Pose((0.286, 0.152, TABLE_TOP))
    ws = at_home("ur5-wsg", SceneObject("thing", "bottle", bottle))
    goal = np.array([1.62, -1.01, 1.44, -0.07, 1.12, -0.16])
    assert blocked(ws, 1, np.array(ws.robot.arms[1].home), goal)
    aside = at_home("ur5-wsg", SceneObject("thing", "bottle", Pose((-0.3, 0.0, TABLE_TOP))))
    assert not blocked(aside, 1, np.array(ws.robot.arms[1].home), goal)


def test_the_straight_way_to_a_grasp_stays_off_what_stands_in_front() -> None:
    # the cup is beyond the fingers' neighbours, but a level hand passes it on its way to the bottle
    bottle = SceneObject("bottle", "bottle", Pose((0.14, 0.095, TABLE_TOP)), {"look": 0})
    cup = SceneObject("cup", "cup", Pose((0.156, -0.142, TABLE_TOP)), {"look": 0})
    ws = at_home("franka-panda", bottle, cup)
    rows = next(pick(ws, Pick("bottle", lift=0.12, arm="right")))
    side = ws.robot.action_space("joint").arms[1]
    way_in = rows[rows[:, side.gripper] > 0.0][:, side.body]
    assert arm_depth(ws, 1, way_in, "bottle").max() <= TOUCH


def on_the_way_past(thing: SceneObject) -> tuple[Workspace, Array]:
    """A Piper whose left arm stands on the left; and its joints in the middle, near the robot."""
    ws = at_home("piper", thing)
    start, goal = (ws.solve(0, Pose((x, y, 0.93), DOWN)) for x, y in ((-0.27, -0.02), (0.0, -0.17)))
    assert start is not None and goal is not None
    ws.joints[0] = start
    return ws, goal


def test_what_no_arm_gets_over_is_gone_around_on_the_robots_side() -> None:
    ws, goal = on_the_way_past(block(-0.12, -0.02, TABLE_TOP + 0.06, 0.06))
    start = ws.joints[0]
    assert blocked(ws, 0, start, goal)
    via = detour(ws, 0, goal)
    assert via is not None
    assert not blocked(ws, 0, start, via) and not blocked(ws, 0, via, goal)
    assert end_effector(ws.chains[0], via).position[1] < -0.07


def test_no_detour_leads_out_of_a_thing() -> None:
    ws, goal = on_the_way_past(block(-0.27, -0.02, TABLE_TOP, 0.3))
    assert detour(ws, 0, goal) is None


LIFTED = np.array([0.3, 2.02, -1.67, 0.08, 1.12, -0.38])
"""With these joints a Piper has lifted a phone that lay beside the stand."""
BEFORE = np.array([1.01, 1.94, -1.31, 1.54, -0.96, -1.1])
"""With these it is about to lean it on the stand."""


def holding_a_phone() -> tuple[Workspace, Pose]:
    """A Piper's right arm with a phone beside a phone stand; and how it holds the phone."""
    turned = (0.95, 0.0, 0.0, 0.32)
    phone = SceneObject("phone", "phone", Pose((0.155, -0.035, TABLE_TOP + 0.1), turned))
    stand = SceneObject("stand", "phone_stand", Pose((0.0, 0.019, TABLE_TOP)))
    ws = at_home("piper", phone, stand)
    ws.joints[1], ws.held[1] = LIFTED, "phone"
    return ws, end_effector(ws.chains[1], LIFTED).inverse() * phone.pose


def touched(ws: Workspace, offset: Pose, *stops: Array) -> float:
    """How deep [m] phone and stand are in each other, or the phone in the table, on the lines."""
    stand = part_boxes(ws.models["stand"], ws.pose("stand"))
    deepest = 0.0
    for a, b in pairwise(stops):
        for share in np.linspace(0.0, 1.0, 60):
            body = end_effector(ws.chains[1], a + (b - a) * share) * offset
            phone = part_boxes(ws.models["phone"], body)
            low = TABLE_TOP - float(phone.points()[:, 2].min())
            deepest = max(deepest, stand.depth(phone.points()), phone.depth(stand.points()), low)
    return deepest


def test_a_phone_is_carried_around_the_stand_that_it_lies_beside() -> None:
    ws, offset = holding_a_phone()
    assert not route(ws, 1, BEFORE).free
    assert touched(ws, offset, LIFTED, BEFORE) > 0.0
    stop = detour_stop(NarrowPassage(ws, 1, "stand", offset), BEFORE)
    assert stop is not None
    assert touched(ws, offset, LIFTED, stop, BEFORE) == 0.0


def test_where_every_way_ends_in_the_thing_there_is_no_stop() -> None:
    ws, offset = holding_a_phone()
    x, y, z = end_effector(ws.chains[1], BEFORE).position
    inside = ws.solve(1, Pose((x, y + 0.05, z - 0.05), (ws.snapshot.end_effector[1].rotation)))
    assert inside is not None and touched(ws, offset, inside, inside) > 0.0
    assert detour_stop(NarrowPassage(ws, 1, "stand", offset), inside) is None


@pytest.mark.parametrize("asset", ["phone_stand", "mug", "bottle"])
def test_boxes_of_parts_hold_the_whole_object_and_no_more(asset: str) -> None:
    model = object_model(asset, {"look": 0})
    corners = part_boxes(model, Pose()).points()
    span = corners.max(axis=0) - corners.min(axis=0)
    assert np.all(span <= np.array(model.size) + 2e-3)
    assert span[2] > 0.9 * model.size[2]
    grown = part_boxes(model, Pose(), 0.01)
    assert np.allclose(grown.half, part_boxes(model, Pose()).half + 0.01)
