"""Both arms at once where they stay apart, and no stop where a straight line passes by."""

from dataclasses import replace

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Array, Pose
from robospa.harness.robots import Embodiment, embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.harness.skills.motion import at_once, go, go_home, travel
from robospa.harness.skills.pick import raise_lower
from robospa.harness.skills.workspace import SkillFailed, Workspace, fewer_waypoints
from robospa.tasks.plan import RaiseLower
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP, grasp_points

ROBOT = embodiment("aloha-agilex")
DOWN = (0.5, -0.5, 0.5, 0.5)
"""A gripper that points down, its fingers left and right."""
TIPS = [gripper.tip for gripper in ROBOT.grippers]
LEFT, RIGHT = slice(0, 6), slice(7, 13)


@pytest.fixture
def ws() -> Workspace:
    return at_home(ROBOT.name)


def above(ws: Workspace, arm: int, x: float, y: float = -0.15, z: float = 0.95) -> Array:
    """Joints with the end effector there."""
    joints = ws.solve(arm, Pose((x, y, z), DOWN))
    assert joints is not None
    return joints


def put(ws: Workspace, arm: int, x: float) -> Array:
    """The arm stands out, above `x`: all joints then."""
    ws.joints[arm] = above(ws, arm, x)
    return ws.row()


def moving(rows: list[Array], start: Array) -> list[tuple[bool, bool]]:
    """Which arms move in each row."""
    steps = np.diff(np.stack([start, *rows]), axis=0)
    return [(bool(s[LEFT].any()), bool(s[RIGHT].any())) for s in steps]


def test_one_arm_goes_home_while_the_other_sets_out(ws: Workspace) -> None:
    start = put(ws, 0, -0.2)
    go(ws, 1, above(ws, 1, 0.2), 0.0)
    assert moving(ws.rows, start) == [(True, True)]
    assert np.allclose(ws.rows[-1][LEFT], ROBOT.arms[0].home) and ws.rows[-1][13] == 0.0


def test_arms_that_would_meet_move_one_after_the_other(ws: Workspace) -> None:
    put(ws, 0, 0.1)
    start = put(ws, 1, 0.22)
    go(ws, 1, above(ws, 1, -0.05), 0.0)
    assert moving(ws.rows, start) == [(True, False), (False, True)]


def test_an_arm_that_holds_something_stays_out(ws: Workspace) -> None:
    put(ws, 0, -0.2)
    ws.held[0] = "cube"
    start = ws.row()
    go(ws, 1, above(ws, 1, 0.2), 0.0)
    assert moving(ws.rows, start) == [(False, True)]


def test_both_arms_go_home_at_once(ws: Workspace) -> None:
    put(ws, 0, -0.2)
    start = put(ws, 1, 0.2)
    go_home(ws, (0, 1))
    assert moving(ws.rows, start) == [(True, True)]
    go_home(ws, (0, 1))
    assert len(ws.rows) == 1


def test_the_shorter_of_two_ways_waits_at_its_end(ws: Workspace) -> None:
    ways = [above(ws, 0, -0.2), above(ws, 0, -0.2, z=0.9)], [above(ws, 1, 0.2)]
    at_once(ws, (lambda: [ws.add(0, j) for j in ways[0]], lambda: ws.add(1, ways[1][0])))
    assert len(ws.rows) == 2
    assert np.array_equal(ws.rows[0][RIGHT], ways[1][0])
    assert np.array_equal(ws.rows[1][RIGHT], ways[1][0])


def test_a_short_straight_line_is_one_action_a_corner_is_two(ws: Workspace) -> None:
    start = put(ws, 0, -0.2)
    for z in (0.94, 0.93, 0.92):
        ws.add(0, above(ws, 0, -0.2, z=z))
    assert len(fewer_waypoints(ws.chains, TIPS, start, np.stack(ws.rows))) == 1
    ws.add(0, above(ws, 0, -0.25, z=0.92))
    rows = np.stack(ws.rows)
    assert np.array_equal(fewer_waypoints(ws.chains, TIPS, start, rows), rows[2:])


def test_rests_and_grippers_are_never_left_out(ws: Workspace) -> None:
    start = put(ws, 0, -0.2)
    ws.add(0, above(ws, 0, -0.2, z=0.94))
    ws.add(0)
    ws.add(0, gripper=0.5)
    ws.add(0, above(ws, 0, -0.2, z=0.93))
    rows = np.stack(ws.rows)
    assert np.array_equal(fewer_waypoints(ws.chains, TIPS, start, rows), rows)


def test_a_free_way_is_direct(ws: Workspace) -> None:
    put(ws, 0, -0.2)
    travel(ws, 0, above(ws, 0, -0.1))
    assert len(ws.rows) == 1


RISE = 0.1


class Table:
    """A pot or fan at `x`, `y` [m] that follows the closed grippers, if it `follows`."""

    def __init__(
        self,
        asset: str,
        follows: bool = True,
        robot: Embodiment = ROBOT,
        x: float = 0.0,
        y: float = -0.05,
    ) -> None:
        self.robot, self.place = robot, (x, y)
        item = SceneObject("thing", asset, Pose((x, y, TABLE_TOP)))
        scene = Scene("none", 1, 0, robot.name, "clean", (item,), {})
        self.rise = 0.0
        self.tops: list[float] = []
        self.rows: list[np.ndarray] = []
        self._follows = follows
        self._from: float | None = None
        home = np.concatenate([np.append(a.home, 1.0) for a in robot.arms])
        self.workspace = Workspace(scene, robot, self._snapshot(home))

    def _snapshot(self, row: np.ndarray) -> Snapshot:
        left, right = row[:7], row[7:]
        ends = [
            end_effector(chain_of(a), r[:6])
            for a, r in zip(self.robot.arms, (left, right), strict=True)
        ]
        closed = [end.position[2] for end, r in zip(ends, (left, right), strict=True) if r[6] < 0.2]
        if not closed or not self._follows:
            self._from, self.rise = None, 0.0
        else:
            self._from = min(closed) if self._from is None else self._from
            self.rise = max(0.0, min(closed) - self._from)
        poses = {"thing": Pose((*self.place, TABLE_TOP + self.rise))}
        joints = (tuple(left[:6]), tuple(right[:6]))
        points = grasp_points(self.robot.grippers, (ends[0], ends[1]))
        return Snapshot(
            0.0, poses, (left[6], right[6]), (ends[0], ends[1]), joints, grasp_points=points
        )

    def run(self, call: RaiseLower) -> None:
        """Send every row to the robot; note how high the thing was whenever the expert looks."""
        steps = raise_lower(self.workspace, call)
        rows = next(steps)
        while True:
            for row in rows:
                self.rows.append(row)
                snapshot = self._snapshot(row)
            self.tops.append(round(self.rise, 3))
            try:
                rows = steps.send(snapshot)
            except StopIteration:
                return


@pytest.mark.parametrize("asset", ["fan", "kitchen_pot"])
@pytest.mark.parametrize("times", [1, 3])
def test_every_cycle_goes_all_the_way_up_and_comes_back(asset: str, times: int) -> None:
    table = Table(asset)
    arms = ("left", "right") if asset == "kitchen_pot" else ("right",)
    table.run(RaiseLower("thing", RISE, times, arms))
    assert table.tops.count(pytest.approx(RISE, abs=0.002)) == times
    assert table.rise == 0.0 and len(table.rows) <= 200 * times


def test_both_grippers_close_in_one_action_and_both_arms_rise_in_one() -> None:
    table = Table("kitchen_pot")
    table.run(RaiseLower("thing", RISE, 2, ("left", "right")))
    grips = np.array([[row[6] < 0.2, row[13] < 0.2] for row in table.rows])
    assert (grips[:, 0] == grips[:, 1]).all() and grips.any()
    held = [row for row, grip in zip(table.rows, grips, strict=True) if grip.all()]
    ends = [[end_effector(chain_of(a), part[:6]).position[2]
             for a, part in zip(ROBOT.arms, (row[:7], row[7:]), strict=True)]
            for row in held]  # fmt: skip
    lean = np.array(ends)[:, 0] - np.array(ends)[:, 1]
    assert np.ptp(lean) < 0.003


@pytest.mark.parametrize(("x", "y", "taken_by", "height"), [
    (-0.055, -0.108, 1, 0.08),  # the left arm gets there leaning only
    (0.04, -0.052, 0, 0.064),  # the right one neither, and the left one less high
])  # fmt: skip
def test_the_other_arm_or_a_lower_lift_before_a_leaning_gripper(
    x: float, y: float, taken_by: int, height: float
) -> None:
    table = Table("fan", robot=embodiment("piper"), x=x, y=y)
    table.run(RaiseLower("thing", 0.08, 2, ("left" if x < 0 else "right",)))
    closed = np.array([[row[6] < 0.2, row[13] < 0.2] for row in table.rows])
    assert closed[:, taken_by].any() and not closed[:, 1 - taken_by].any()
    assert table.tops.count(pytest.approx(height, abs=0.002)) == 2


def test_a_thing_that_stays_is_given_up_after_a_few_attempts() -> None:
    with pytest.raises(SkillFailed, match="thing could not be lifted in 4 attempts"):
        Table("fan", follows=False).run(RaiseLower("thing", RISE, 1, ("right",)))


def test_what_no_arm_reaches_is_refused() -> None:
    table = Table("fan")
    table.workspace.snapshot = replace(
        table.workspace.snapshot, poses={"thing": Pose((0.0, 0.6, TABLE_TOP))}, gripper=(1.0, 1.0)
    )
    with pytest.raises(SkillFailed, match="finds no grasp of thing"):
        table.run(RaiseLower("thing", RISE, 1, ("left",)))
