"""The columns of an action, for arms of equal and of different joint counts."""

from __future__ import annotations

import pytest

from robospa.action_space import KINDS, POSE, ActionSpace

UNEQUAL = (6, 7)


def test_two_arms_of_six_joints() -> None:
    space = ActionSpace("joint")
    left, right = space.arms
    assert (left.name, left.all, left.body, left.gripper) == ("left", slice(0, 7), slice(0, 6), 6)
    assert (right.all, right.body, right.gripper) == (slice(7, 14), slice(7, 13), 13)
    assert (space.width, space.grippers) == (14, [6, 13])


def test_arms_of_different_joint_counts() -> None:
    space = ActionSpace("joint", UNEQUAL)
    assert (space.width, space.grippers) == (15, [6, 14])
    assert space.arms[1].body == slice(7, 14)
    assert space.labels[5:9] == ["left joint 6", "left gripper", "right joint 1", "right joint 2"]


@pytest.mark.parametrize("kind", ["ee", "delta_ee"])
def test_poses_have_the_same_columns_whatever_the_arms(kind: str) -> None:
    space = ActionSpace(kind, UNEQUAL)
    row = list(range(space.width))
    right = space.arms[1]
    assert (space.width, space.grippers) == (16, [7, 15])
    assert row[right.position] == [8, 9, 10] and row[right.quaternion] == [11, 12, 13, 14]
    assert space.labels[8:] == [f"right {part}" for part in (*POSE, "gripper")]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("joints", [(6, 6), UNEQUAL, (7, 7)])
def test_every_column_belongs_to_one_part(kind: str, joints: tuple[int, int]) -> None:
    space = ActionSpace(kind, joints)
    row = list(range(space.width))
    assert [c for arm in space.arms for c in (*row[arm.body], arm.gripper)] == row
    assert sorted(space.bodies + space.grippers) == row
    assert len(space.labels) == len(set(space.labels)) == space.width


def test_a_joint_action_has_no_pose() -> None:
    arm = ActionSpace("joint").arms[1]
    row = list(range(14))
    assert row[arm.position] == row[arm.quaternion] == []


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'cartesian'.*joint, ee and delta_ee"):
        ActionSpace("cartesian")
