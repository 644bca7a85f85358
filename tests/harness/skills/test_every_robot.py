"""The skills with the arms and grippers of every robot."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from robot_at_home import at_home
from world_scenes import block

from robospa.geometry import Pose, rotate
from robospa.harness.robots import embodiment, embodiments
from robospa.harness.robots.kinematics import end_effector, link_frames
from robospa.harness.skills import clearance
from robospa.harness.skills.open import Pull, _clear, _ways, pull_open
from robospa.harness.skills.pick import TOO_THIN, reachable_grasps
from robospa.harness.skills.touch import DEPTH, press
from robospa.harness.skills.workspace import Workspace
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.objects.appliances import OVENS
from robospa.tasks.plan import Open, Press
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

ROBOTS = embodiments()
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
    own = clearance.own_boxes(ws.models["pot"], ws.pose("pot"))
    whole = clearance.bounding_box(ws.models["pot"], ws.pose("pot"))
    for arm in (0, 1):
        best = reachable_grasps(ws, "pot", (arm,))[0]
        closed, opened = ws.robot.arms[arm].travel
        opening = 2 * (closed + best.opening * (opened - closed))
        assert own.depth(clearance.finger_points(ws.hand(arm), best.pose, opening)) == 0.0
        assert whole.depth(clearance.palm_points(ws.hand(arm), best.pose)) == 0.0


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
        return float(
            clearance.arm_depth(beside, way.arm, np.stack([way.before, way.at, *way.arc])).max()
        )

    taken = _clear(beside, _ways(beside, CALL, hinge))
    assert taken is not None and depth(first) > clearance.TOUCH >= depth(taken)


def test_of_no_way_none_is_taken() -> None:
    assert _clear(at_home("franka-panda"), ()) is None
