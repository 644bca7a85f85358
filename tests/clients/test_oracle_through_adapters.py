"""The oracle behind every dialect: conventions that are wrong anywhere lose the trial.

A stand-in server holds the oracle. It reads the robot's state off the wire in the server's own
conventions, adds to it what the oracle wants to change, and answers in the server's own
conventions. Only if the adapter turns both ways round right do the right commands come out.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from standins import OpenPi, RoboTwin, VlaEval, XPolicyLab
from standins_http import Go1, XVla

from robospa.baselines.oracle import Oracle
from robospa.clients import connect
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.observation import DEFAULT_CAMERAS
from robospa.protocol.policy import TrialInfo
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
Array = NDArray[Any]

CHAINS = [chain_of(arm) for arm in embodiment("aloha-agilex").arms]
IMAGES = {c.name: np.zeros((c.height, c.width, 3), np.uint8) for c in DEFAULT_CAMERAS}
KEY = TrialKey("Pick_Blocks_Size", 2, 7_000_000)


def poses(row: Array) -> Array:
    """(2, 8) end-effector poses and grippers after one joint action."""
    found = []
    for chain, part in zip(CHAINS, row.reshape(2, 7), strict=True):
        pose = end_effector(chain, part[:6].tolist())
        found.append([*pose.position, *pose.rotation, part[6]])
    return np.array(found)


def rotation(quaternion: Array) -> Any:
    """w x y z as a rotation."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


class Desk:
    """Where the oracle's wish and what the server is told meet."""

    def __init__(self) -> None:
        self.rows = np.zeros((0, 14))
        self.state = np.zeros(14)
        self.ee = np.zeros((2, 8))

    def joints(self, told: Array) -> Array:
        """(T, 14): the changes that the oracle wants, from the joints as told."""
        wanted = np.asarray(told, float) + (self.rows - self.state)
        wanted[:, [6, 13]] = self.rows[:, [6, 13]] + (np.asarray(told) - self.state)[[6, 13]]
        return wanted

    def poses(self, told: Array) -> Array:
        """(T, 2, 8): the same for poses (2, 7) as told."""
        found = np.array([poses(row) for row in self.rows])
        for arm in range(2):
            found[:, arm, :3] += told[arm, :3] - self.ee[arm, :3]
            turn = rotation(told[arm, 3:7]) * rotation(self.ee[arm, 3:7]).inv()
            found[:, arm, 3:7] = np.roll(
                (turn * rotation(found[:, arm, 3:7])).as_quat(), 1, axis=-1
            )
        return found


class Through:
    """A policy that asks its server, which asks the oracle."""

    def __init__(self, remote: Any, desk: Desk, feedback: bool) -> None:
        self.remote, self.desk, self.feedback = remote, desk, feedback
        self.oracle = Oracle()
        self.spec = replace(remote.spec, privileged=True, needs_trial_key=True, cameras=())
        self.first = True

    def reset(self, trial: TrialInfo) -> None:
        self.oracle.reset(trial)
        self.remote.reset(trial)
        self.first = True

    def infer(self, seen: dict[str, Any]) -> NDArray[np.float32]:
        last = self.desk.rows
        self.desk.state = np.asarray(seen["state"], float)
        self.desk.ee = np.asarray(seen["ee"], float)
        if self.feedback and not self.first:
            self.desk.ee = poses(last[-1])
        self.desk.rows = self.oracle.infer(seen).astype(float)
        self.first = False
        sent = {name: value for name, value in seen.items() if name != "privileged"}
        answer: NDArray[np.float32] = self.remote.infer({**sent, "images": IMAGES})
        return answer


# ---------------------------------------------------------------- the server's conventions


Model = Callable[[Any], Any]


def joints(told: Callable[[Any], Array]) -> Callable[[Desk], Model]:
    """Joints are answered, and are in a request where `told` finds them."""
    return lambda desk: lambda seen: desk.joints(told(seen))


def xpolicylab_joint(desk: Desk) -> Model:
    def model(seen: Any) -> Any:
        state = seen["state"]
        names = [f"{a}_{part}_joint_state" for a in ("left", "right") for part in ("arm", "ee")]
        chunk = desk.joints(np.concatenate([state[name] for name in names]))
        return [dict(zip(names, np.split(row, [6, 7, 13]), strict=True)) for row in chunk]

    return model


def xpolicylab_ee(desk: Desk) -> Model:
    def model(seen: Any) -> Any:
        told = np.stack([seen["state"][f"{arm}_ee_pose"] for arm in ("left", "right")])
        return [
            {
                "left_ee_pose": both[0, :7],
                "left_ee_joint_state": both[0, 7:],
                "right_ee_pose": both[1, :7],
                "right_ee_joint_state": both[1, 7:],
            }
            for both in desk.poses(told.astype(float))
        ]

    return model


def xvla(desk: Desk) -> Model:
    """Quaternions w x y z read as if x y z w, in and out, as the released checkpoint has it."""
    from scipy.spatial.transform import Rotation

    def model(seen: Any) -> Any:
        told = seen["proprio"].astype(float).reshape(2, 10)
        quaternion = np.empty((2, 4))
        for arm in range(2):
            first, second = told[arm, 3:9:2], told[arm, 4:9:2]
            matrix = np.stack([first, second, np.cross(first, second)], axis=-1)
            quaternion[arm] = Rotation.from_matrix(matrix).as_quat()  # taken for w x y z
        wanted = desk.poses(np.concatenate([told[:, :3], quaternion], axis=1))
        chunk = np.empty((len(wanted), 2, 10))
        chunk[..., :3] = wanted[..., :3]
        for arm in range(2):
            matrix = Rotation.from_quat(wanted[:, arm, 3:7]).as_matrix()
            chunk[:, arm, 3:9] = matrix[:, :, :2].reshape(-1, 6)
        chunk[..., 9] = wanted[..., 7] < 0.5
        return chunk.reshape(-1, 20)

    return model


SERVERS: dict[str, tuple[Any, Any, str]] = {
    "go1": (Go1, joints(lambda seen: seen["state"][0]), ""),
    "openpi": (OpenPi, joints(lambda seen: seen["state"]), ""),
    "vla-eval": (VlaEval, joints(lambda seen: seen["joint_state"]), "?execute=none"),
    "robotwin": (RoboTwin, joints(lambda seen: seen["joint_action"]["vector"]), ""),
    "xpolicylab joint": (XPolicyLab, xpolicylab_joint, ""),
    "xpolicylab ee": (XPolicyLab, xpolicylab_ee, "?space=ee"),
    "xvla": (XVla, xvla, ""),
    "xvla joint": (
        partial(XVla, proprio=14),
        joints(lambda seen: seen["proprio"]),
        "?space=joint&proprio=measured",
    ),
}


@pytest.mark.parametrize("name", SERVERS)
def test_the_oracle_solves_its_trial_through_every_adapter(name: str) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    make, convention, query = SERVERS[name]
    desk = Desk()
    with make(convention(desk)) as url, connect(url + query) as remote:
        policy = Through(remote, desk, feedback=name == "xvla")
        record = run_trial(SapienWorld(render=False), policy, KEY, policy_seed=0)
    assert record.success, record.message or record.diagnostics
    assert "unreachable_actions" not in record.diagnostics
