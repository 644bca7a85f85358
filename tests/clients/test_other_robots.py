"""Servers of other projects with robots of other joints than Aloha-AgileX has."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from robospa.action_space import ActionSpace
from robospa.clients.chunks import RobotOption
from robospa.clients.dialect import dialects
from robospa.clients.robotwin import robotwin_observation
from robospa.clients.xpolicylab import XPolicyLabClientOptions, decode, robot_state
from robospa.observation import Observation

JOINTS = (6, 7)
STATE = np.arange(15, dtype=np.float32) / 15
POSES = np.tile(np.array([0.1, 0, 1, 1, 0, 0, 0, 0.5], np.float32), (2, 1))


def seen() -> Observation:
    image = np.zeros((240, 320, 3), np.uint8)
    cameras = ("head", "left_wrist", "right_wrist", "front")
    return {"state": STATE, "ee": POSES, "images": dict.fromkeys(cameras, image), "step": 0}


def test_every_dialect_says_which_robot_its_servers_drive() -> None:
    for dialect in dialects():
        default = {f.name: f.default for f in fields(dialect.options)}.get("embodiment")
        assert default == "aloha-agilex", dialect.scheme


def test_columns_are_declared_for_the_robot_that_is_known() -> None:
    assert RobotOption().columns("joint") == 14
    other = RobotOption("franka-panda")
    assert (other.columns("joint"), other.columns("ee")) == (None, 16)


def test_arms_of_six_and_seven_joints_are_sent_one_by_one() -> None:
    sent = robotwin_observation(seen(), JOINTS)["joint_action"]
    assert isinstance(sent, dict)
    assert (len(sent["left_arm"]), len(sent["right_arm"])) == JOINTS
    assert (sent["left_gripper"], sent["right_gripper"]) == pytest.approx((STATE[6], STATE[14]))
    state = robot_state(seen(), JOINTS)
    assert len(state["right_arm_joint_state"]) == 7
    assert state["right_ee_joint_state"] == pytest.approx(STATE[14:])


def test_closed_grippers_of_such_arms_are_turned_round() -> None:
    options = XPolicyLabClientOptions(grippers="closed")
    answer = {"actions": np.zeros((2, 15), np.float32)}
    chunk = decode(answer, seen(), options, JOINTS)
    grippers = ActionSpace("joint", JOINTS).grippers
    assert isinstance(chunk, np.ndarray)
    assert np.flatnonzero(chunk[0]).tolist() == grippers == [6, 14]
