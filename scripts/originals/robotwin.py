"""RoboTwin's own TCP server and client, with the client half and the windows of its DP."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numpy as np
from world import Robot, announced_port, flat, joints, load, main, namespace, report, stub


def serve(checkout: str) -> None:
    namespace("envs", __path__=[])
    namespace("envs._GLOBAL_CONFIGS", CONFIGS_PATH="")
    sys.path.insert(0, f"{checkout}/script")
    stub("torch", "hydra", "dill", "diffusion_policy.common.pytorch_util")
    stub("diffusion_policy.policy.base_image_policy")
    module = load(f"{checkout}/policy/DP/diffusion_policy/env_runner/dp_runner.py")
    module.torch.Tensor = type("Tensor", (), {})
    server = importlib.import_module("policy_model_server")

    class Model:
        def __init__(self) -> None:
            self.runner = module.DPRunner(n_obs_steps=3, n_action_steps=6)

        def reset_model(self) -> None:
            self.runner.reset_obs()

        def update_obs(self, seen: Any) -> None:
            self.runner.update_obs(seen)

        def get_action(self, seen: Any = None) -> Any:
            if seen is not None:
                self.runner.update_obs(seen)
            window = {k: v.astype(np.float32) for k, v in self.runner.get_n_steps_obs().items()}
            report(flat(window))
            return joints()

    server.ModelServer(Model(), host="127.0.0.1", port=announced_port()).start()


def ask(checkout: str, port: int) -> Any:
    stub("cv2", "sapien", "toppra", "matplotlib", "yaml", "envs", "envs._GLOBAL_CONFIGS")
    stub("envs.utils.create_actor", "generate_episode_instructions")
    sys.path.insert(0, f"{checkout}/script")
    client = importlib.import_module("eval_policy_client")
    half = load(f"{checkout}/policy/DP/deploy_policy_double_env.py")
    robot, model = Robot(limit=18), client.ModelClient(host="127.0.0.1", port=port)
    model.call(func_name="reset_model")
    while not robot.done:
        half.eval(robot, model, robot.get_obs())
    model.close()
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
