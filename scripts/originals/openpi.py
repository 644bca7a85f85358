"""openpi: `WebsocketPolicyServer`, and the real robot's environment with `openpi_client`."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
from world import Robot, announced_port, flat, joints, load, main, namespace, observation, report

NAMES = {"head": "cam_high", "left_wrist": "cam_left_wrist", "right_wrist": "cam_right_wrist"}


def serve(checkout: str) -> None:
    module = load(f"{checkout}/src/openpi/serving/websocket_policy_server.py")

    def infer(seen: Any) -> Any:
        report(flat(seen))
        return {"actions": joints(), "state": np.zeros(14), "policy_timing": {"infer_ms": 1.0}}

    metadata = {"reset_pose": [0, -1.5], "names": np.array(["a", "b"]), "big": np.ones(2, ">f4")}
    policy, port = SimpleNamespace(infer=infer), announced_port()
    module.WebsocketPolicyServer(policy, "127.0.0.1", port, metadata).serve_forever()


def ask(checkout: str, port: int) -> Any:
    from openpi_client.action_chunk_broker import ActionChunkBroker
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    def step(number: int) -> Any:
        seen = observation(number)
        images = {theirs: seen["images"][ours] for ours, theirs in NAMES.items()}
        robot = {"qpos": seen["state"].astype(float), "images": images}
        return SimpleNamespace(observation=robot)

    robot = Robot(limit=1)
    real = SimpleNamespace(reset=lambda: step(0), step=lambda action: robot.take_action(action))
    namespace("examples.aloha_real.real_env", make_real_env=lambda **_: real)
    namespace("examples.aloha_real", real_env=sys.modules["examples.aloha_real.real_env"])
    namespace("examples")
    module = load(f"{checkout}/examples/aloha_real/env.py")
    env = module.AlohaRealEnvironment(render_height=240, render_width=320)
    env.reset()
    policy = ActionChunkBroker(WebsocketClientPolicy("127.0.0.1", port), 6)
    seen = {**env.get_observation(), "prompt": observation()["instruction"]}
    for _ in range(6):
        env.apply_action(policy.infer(seen))
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
