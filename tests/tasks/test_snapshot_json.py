"""Snapshots survive JSON."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.tasks.snapshot import Contact, Snapshot, snapshot_from_json, snapshot_to_json
from robospa.workcell import grasp_points

GRIPPERS = embodiment("aloha-agilex").grippers
ENDS = (Pose(), Pose((1.0, 2.0, 3.0)))
SNAPSHOT = Snapshot(
    time=1.25,
    poses={"one": Pose((0.1, 0.2, 0.3), (0.6, 0.0, 0.8, 0.0))},
    gripper=(0.0, 1.0),
    end_effector=ENDS,
    grasp_points=grasp_points(GRIPPERS, ENDS),
    joints=((0.1, 0.2), (0.3, 0.4)),
    measured=((0.11, 0.21), (0.31, 0.41)),
)


def test_a_snapshot_comes_back_from_json() -> None:
    assert (
        snapshot_from_json(json.loads(json.dumps(snapshot_to_json(SNAPSHOT))), GRIPPERS) == SNAPSHOT
    )


def test_poses_are_position_then_quaternion() -> None:
    assert snapshot_to_json(SNAPSHOT)["poses"]["one"] == [0.1, 0.2, 0.3, 0.6, 0.0, 0.8, 0.0]


def test_contacts_stay_with_goals() -> None:
    touching = replace(SNAPSHOT, contacts=(Contact("a", "b", (0,) * 3),))
    assert "contacts" not in snapshot_to_json(touching)


def test_something_else_is_refused() -> None:
    with pytest.raises(KeyError):
        snapshot_from_json({"time": 0.0}, GRIPPERS)


def test_heights_of_several_objects_name_those_that_do_not_exist_yet() -> None:
    assert SNAPSHOT.heights(("one", "later")) == [0.3, None]
    assert SNAPSHOT.position("one") == (0.1, 0.2, 0.3)
