"""The skills with the arms and grippers of every robot: what they reach, and that their own links
stay out of table and objects; ways around what stands close beside."""

import math
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from robot_at_home import at_home
from world_scenes import block

from robospa.geometry import Array, Pose, look_rotation, rotate
from robospa.harness.robots import embodiment, embodiments
from robospa.harness.robots.kinematics import end_effector, inverse, link_frames
from robospa.harness.skills.bring_in import NarrowPassage, detour_stop
from robospa.harness.skills.clearance import (
    TOUCH,
    arm_depth,
    bounding_box,
    edge_depth,
    finger_points,
    own_boxes,
    palm_points,
    part_boxes,
)
from robospa.harness.skills.motion import blocked, detour, route
from robospa.harness.skills.open import Pull, _clear, _ways, pull_open
from robospa.harness.skills.pick import TOO_THIN, pick, reachable_grasps
from robospa.harness.skills.touch import DEPTH, press
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.catalog import build_scene
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.objects.appliances import OVENS
from robospa.tasks.plan import Open, Pick, Press
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

ROBOTS = embodiments()
DOWN = look_rotation((0.0, 0.0, -1.0), (1.0, 0.0, 0.0))


def cube_at(x: float, y: float, z: float, half: float) -> SceneObject:
    look = {"half": [half] * 3, "color": [1.0, 0.0, 0.0]}
    return SceneObject("thing", "block", Pose((x, y, z)), look, fixed=True)


@pytest.mark.parametrize("name", ROBOTS)
def test_arms_at_home_touch_nothing(name: str) -> None:
    ws = at_home(name)
    for arm in (0, 1):
        assert arm_depth(ws, arm, np.array([ws.robot.arms[arm].home]))[0] == 0.0


@pytest.mark.parametrize("name", ROBOTS)
def test_a_thing_where_the_hand_is_is_in_its_way(name: str) -> None:
    home = np.array([at_home(name).robot.arms[1].home])
    hand = link_frames(at_home(name).chains[1], home)[-1][0] @ [*(0.0, 0.0, 0.0), 1.0]
    ws = at_home(name, cube_at(*hand[:3].tolist(), 0.05))
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
    behind = at_home("franka-panda", cube_at(*middle.tolist(), 0.03))
    assert blocked(behind, 1, home, turned)


@pytest.mark.parametrize(("name", "wide"), [("franka-panda", True), ("aloha-agilex", False)])
def test_only_a_wide_hand_has_edges(name: str, wide: bool) -> None:
    home = np.array([at_home(name).robot.arms[1].home])
    everywhere = at_home(name, cube_at(0.0, 0.0, TABLE_TOP, 3.0))
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
    ws, goal = on_the_way_past(cube_at(-0.12, -0.02, TABLE_TOP + 0.06, 0.06))
    start = ws.joints[0]
    assert blocked(ws, 0, start, goal)
    via = detour(ws, 0, goal)
    assert via is not None
    assert not blocked(ws, 0, start, via) and not blocked(ws, 0, via, goal)
    assert end_effector(ws.chains[0], via).position[1] < -0.07


def test_no_detour_leads_out_of_a_thing() -> None:
    ws, goal = on_the_way_past(cube_at(-0.27, -0.02, TABLE_TOP, 0.3))
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


# What is pressed, taken and opened

PLACES = ((-0.22, -0.18), (-0.06, 0.06), (0.14, -0.05))
UNDER = 0.06
"""How much higher [m] the second object stands."""


def bell(x: float, y: float, higher: float = 0.0) -> SceneObject:
    return SceneObject("bell", "bell", Pose((x, y, TABLE_TOP + higher)), {"look": 0}, fixed=True)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_bell_is_pressed_wherever_it_stands(name: str) -> None:
    button = object_model("bell", {"look": 0}).frames["press"]
    for (x, y), higher in product(PLACES, (0.0, UNDER)):
        ws = at_home(name, bell(x, y, higher))
        rows = next(press(ws, Press("bell")))
        goal = ws.pose("bell") * button
        lowest = []
        for arm, side in enumerate(ws.robot.action_space("joint").arms):
            tip = (ws.hand(arm).tip, 0.0, 0.0)
            ends = [end_effector(ws.chains[arm], row[side.body]) for row in rows]
            lowest += [end.apply(tip) for end in ends]
        nearest = min(lowest, key=lambda point: math.dist(point, goal.position))
        below = np.subtract(goal.position, (0.0, 0.0, DEPTH))
        assert math.dist(nearest, below.tolist()) < 1e-3, (x, y, higher)


@pytest.mark.parametrize("name", ROBOTS)
def test_it_is_pressed_by_the_other_arm_where_its_own_does_not_get(name: str) -> None:
    ws = at_home(name, bell(0.3, 0.0))
    assert len(next(press(ws, Press("bell", arm="left")))) > 0


def test_steep_presses_are_the_last_choice() -> None:
    # an arm that reaches straight down does so
    for name in ("aloha-agilex", "franka-panda", "ur5-wsg"):
        ws = at_home(name, bell(0.2, -0.12))
        down = next(press(ws, Press("bell")))[-2]
        side = ws.robot.action_space("joint").arms[1]
        pose = end_effector(ws.chains[1], down[side.body])
        assert rotate(pose.rotation, (1.0, 0.0, 0.0))[2] < -0.999, name


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_thinner_than_the_gap_of_closed_fingers_is_a_last_choice(name: str) -> None:
    look = {"half": [0.0025, 0.06, 0.02], "color": [1.0, 0.0, 0.0]}
    ws = at_home(name, SceneObject("thin", "block", Pose((0.15, -0.1, TABLE_TOP + 0.02)), look))
    assert (reachable_grasps(ws, "thin", (1,))[0].cost >= TOO_THIN) == (name == "ur5-wsg")


@pytest.mark.parametrize("name", ROBOTS)
def test_fingers_come_to_a_block_a_margin_wider_than_it(name: str) -> None:
    ws = at_home(name, block("b", 0.15, -0.1))
    best = reachable_grasps(ws, "b", (1,))[0]
    closed, opened = ws.robot.arms[1].travel
    assert 2 * (closed + best.opening * (opened - closed)) == pytest.approx(0.062)


@pytest.mark.parametrize("name", ROBOTS)
def test_fingers_and_palm_stay_out_of_the_pot_whose_handle_they_take(name: str) -> None:
    # fingers of 15 mm fit between handle and pot only if they open less than around other things
    ws = at_home(
        name, SceneObject("pot", "kitchen_pot", Pose((0.0, -0.05, TABLE_TOP)), {"look": 0})
    )
    own = own_boxes(ws.models["pot"], ws.pose("pot"))
    whole = bounding_box(ws.models["pot"], ws.pose("pot"))
    for arm in (0, 1):
        best = reachable_grasps(ws, "pot", (arm,))[0]
        closed, opened = ws.robot.arms[arm].travel
        opening = 2 * (closed + best.opening * (opened - closed))
        assert own.depth(finger_points(ws.hand(arm), best.pose, opening)) == 0.0
        assert whole.depth(palm_points(ws.hand(arm), best.pose)) == 0.0


RIMS = ("bowl", "cup", "mug", "table_trash_bin")
"""What is held at the rim, by no other part."""


@pytest.mark.parametrize("name", ROBOTS)
def test_rims_are_thicker_than_the_gap_of_closed_fingers(name: str) -> None:
    assert set(RIMS) <= set(assets())
    for asset in RIMS:
        for look in range(variant_count(asset)):
            widths = [grasp.width for grasp in object_model(asset, {"look": look}).grasps]
            gaps = [gripper.gap for gripper in embodiment(name).grippers]
            assert min(widths) > max(gaps) + 0.0005, (asset, look)


CALL = Open("oven", to=0.7, arm="left")


def before_an_oven(name: str, angle: float, *others: SceneObject, look: int = 0) -> Workspace:
    """A microwave whose door is open by `angle` [rad], and what else there is."""
    oven = SceneObject("oven", "microwave", Pose((-0.06, 0.17, TABLE_TOP)), {"look": look}, True)
    ws = at_home(name, oven, *others)
    ws.snapshot = replace(ws.snapshot, hinges={"oven": angle})
    return ws


@pytest.mark.parametrize(("name", "look"), product(ROBOTS, (0, 1)))
def test_fingertips_at_a_handle_stay_in_front_of_the_door(name: str, look: int) -> None:
    ws = before_an_oven(name, 0.0, look=look)
    rows = next(pull_open(ws, CALL))
    side = ws.robot.action_space("joint").arms[0]
    taken = rows[rows[:, side.gripper] == 0.0][0]
    tip = end_effector(ws.chains[0], taken[side.body]).apply((ws.hand(0).tip, 0.0, 0.0))
    assert tip[1] < 0.17 + OVENS[look].front, "the tips would be in the door"


@pytest.mark.parametrize("name", ROBOTS)
def test_a_door_is_pulled_open_without_a_change_of_posture(name: str) -> None:
    # some arms have several postures for every pose: from one to another the hand leaves the arc
    ws = before_an_oven(name, 0.0)
    rows = next(pull_open(ws, CALL))
    side = ws.robot.action_space("joint").arms[0]
    joints, gripper = rows[:, side.body], rows[:, side.gripper]
    pulling = joints[gripper == 0.0]
    assert len(pulling) >= 4 and np.abs(np.diff(pulling, axis=0)).max() < 1.0


def test_at_the_last_attempt_a_door_is_pulled_along_a_way_on_which_the_arm_is_in_nothing() -> None:
    ws = before_an_oven("franka-panda", 0.7)
    hinge = ws.models["oven"].hinge
    assert hinge is not None
    first = next(_ways(ws, CALL, hinge))
    elbow = link_frames(ws.chains[0], first.arc[-1][None])[4][0, :3, 3]
    look = {"half": [0.02] * 3, "color": [1.0, 0.0, 0.0]}
    thing = SceneObject("thing", "block", Pose(tuple(elbow.tolist())), look, fixed=True)
    beside = before_an_oven("franka-panda", 0.7, thing)

    def depth(way: Pull) -> float:
        return float(arm_depth(beside, way.arm, np.stack([way.before, way.at, *way.arc])).max())

    taken = _clear(beside, _ways(beside, CALL, hinge))
    assert taken is not None and depth(first) > TOUCH >= depth(taken)


def test_of_no_way_none_is_taken() -> None:
    assert _clear(at_home("franka-panda"), ()) is None
