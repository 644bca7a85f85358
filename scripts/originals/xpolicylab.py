"""XPolicyLab: its WebSocket server, and RoboTwin's client of it."""

from __future__ import annotations

import asyncio
import importlib
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from world import (
    ROWS,
    SEED,
    TASK,
    TEXT,
    Robot,
    announced_port,
    flat,
    main,
    namespace,
    observation,
    report,
    stub,
)


def serve(checkout: str) -> None:
    sys.path.insert(0, f"{checkout}/XPolicyLab")
    server = importlib.import_module("client_server.ws.model_server")

    class Model:
        def reset(self) -> None:
            return None

        def update_obs(self, seen: Any) -> None:
            report(flat(seen))

        def get_action(self) -> Any:
            names = (BODY, "ee_joint_state")
            cuts = np.cumsum([WIDTH, 1, WIDTH])
            parts = [f"{arm}_{name}" for arm in ("left", "right") for name in names]
            chunk = np.random.default_rng(1).uniform(size=(ROWS, 2 * WIDTH + 2)).astype(np.float32)
            rows = [dict(zip(parts, np.split(row, cuts), strict=True)) for row in chunk]
            rows[1].pop(f"left_{BODY}")  # stays
            rows[2]["left_gripper"] = rows[2].pop("left_ee_joint_state")
            rows[3][f"right_{OTHER}"] = rows[3].pop(f"right_{BODY}")
            rows[4]["action_type"] = TYPE
            return rows

    config = server.PolicyServerConfig(host="127.0.0.1", port=announced_port())
    asyncio.run(server.PolicyServer(Model(), config).serve_forever())


SPACE = "ee" if sys.argv[-1] == "ee" else "joint"
BODY, OTHER, WIDTH, TYPE = {
    "joint": ("arm_joint_state", "arm_joint", 6, "qpos"),
    "ee": ("ee_pose", "endpose", 7, "endpose"),
}[SPACE]
"""Names of an arm's part of an action, its numbers, and another name of the space."""
PLACE = ("joint_action", "arm") if SPACE == "joint" else ("endpose", "endpose")
TCP_AHEAD = 0.12
"""[m] from the pose that RoboTwin gives of an arm to its tool centre point, along its x axis."""


class Targets(Robot):
    """Where it is, is where it was sent last."""

    def __init__(self) -> None:
        super().__init__()
        self.robot = SimpleNamespace(
            get_left_tcp_pose=lambda: self.tcp(0), get_right_tcp_pose=lambda: self.tcp(1)
        )

    def tcp(self, arm: int) -> Any:
        pose = observation(len(self.actions))["ee"][arm, :7].astype(float)
        turned = Rotation.from_quat(np.roll(pose[3:], -1)).apply([TCP_AHEAD, 0, 0])
        return np.concatenate([pose[:3] + turned, pose[3:]])

    def get_obs(self) -> dict[str, Any]:
        seen = super().get_obs()
        if len(self.actions) % ROWS:
            last, side = self.actions[-1], WIDTH + 1
            for arm, row in (("left", last[:side]), ("right", last[side:])):
                seen["joint_action"][f"{arm}_gripper"] = row[-1]
                where, name = PLACE
                seen[where][f"{arm}_{name}"] = row[:-1]
        return seen


def ask(checkout: str, port: int) -> Any:
    namespace("envs", CONFIGS_PATH="", __path__=[])
    stub("envs.utils.create_actor")
    stub("generate_episode_instructions")
    sys.path[:0] = [f"{checkout}/XPolicyLab", f"{checkout}/RoboTwin-main/scripts"]
    module = importlib.import_module("eval_policy_xpolicylab")
    path = f"{checkout}/XPolicyLab"
    given = {"host": "127.0.0.1", "port": port, "xpolicylab_root": path}
    client, robot = module.build_policy_client(given), Targets()
    module.prepare_policy_case(client, TASK, SEED, TEXT, SPACE)
    module.reset_policy(client, TASK, SEED, TEXT, SPACE)
    while not robot.done:
        seen = robot.get_obs()
        sent = module.robotwin_obs_to_xpolicylab(seen, instruction=TEXT, task_env=robot)
        client.call(func_name="update_obs", obs=sent)
        for action in module.normalize_action_chunk(client.call(func_name="get_action")):
            row, _ = module.xpolicylab_action_to_robotwin(
                action, action_type=SPACE, current_observation=seen
            )
            robot.take_action(row)
            seen = robot.get_obs()
    module.notify_trial_end(client, TASK, SEED, True)
    client.close()
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
