"""StarVLA, vLLM-Omni and LingBot-VLA: their own server classes around a model that reports what it
reads, and their own clients. `case.py serve CHECKOUT NAME`; `case.py ask CHECKOUT PORT NAME`."""

from __future__ import annotations

import asyncio
import importlib
import os
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
from world import ROWS, Robot, announced_port, flat, joints, main, namespace, observation, report

PATH = "/v1/realtime/robot/openpi"


def told(seen: Any) -> Any:
    """The model's chunk, after a report of what it has read; lists are maps by place."""
    report(flat(placed(seen)))
    return joints()


def placed(value: Any) -> Any:
    if isinstance(value, list):
        value = dict(enumerate(value))
    return {k: placed(v) for k, v in value.items()} if isinstance(value, dict) else value


def module(checkout: str, name: str) -> Any:
    sys.path.insert(0, checkout)
    return importlib.import_module(name)


def serve_starvla(checkout: str) -> None:
    server = module(checkout, "deployment.model_server.tools.websocket_policy_server")

    def predict_action(examples: Any, unnorm_key: Any = None, **more: Any) -> Any:
        return {"actions": told({"examples": examples, "more": more})[None]}

    keys = ["new_embodiment"]
    said = {"env": "starvla_policy_server", "ckpt_path": os.environ.get("ROBOSPA_CKPT", "a.pt")}
    said |= {"action_chunk_size": ROWS, "available_unnorm_keys": keys}
    said |= {"default_unnorm_key": keys[0], "training_obs_image_size": [224, 224]}
    policy = SimpleNamespace(predict_action=predict_action)
    server.WebsocketPolicyServer(
        policy, "127.0.0.1", announced_port(), metadata=said
    ).serve_forever()


def serve_lingbot(checkout: str) -> None:
    server = module(checkout, "deploy.websocket_policy_server")

    def infer(seen: Any) -> Any:
        return {"action": None if seen.get("reset") else told(seen)}

    policy = SimpleNamespace(infer=infer)
    server.WebsocketPolicyServer(policy, "127.0.0.1", announced_port()).serve_forever()


def serve_vllm(checkout: str) -> None:
    import logging

    import uvicorn
    from fastapi import FastAPI, WebSocket

    folders = ("", ".diffusion", ".inputs", ".entrypoints", ".entrypoints.openai")
    for package in (f"vllm_omni{folder}" for folder in folders):
        namespace(package, __path__=[f"{checkout}/{package.replace('.', '/')}"])
    namespace("omegaconf", OmegaConf=SimpleNamespace(is_config=lambda value: False))
    namespace("vllm")
    namespace("vllm.logger", init_logger=logging.getLogger)
    made = lambda **fields: SimpleNamespace(**fields)  # noqa: E731
    namespace("vllm_omni.diffusion.request", OmniDiffusionRequest=made)
    params = type("Params", (), {"extra_args": None, "seed": None})
    namespace("vllm_omni.inputs.data", OmniDiffusionSamplingParams=params)
    name = "vllm_omni.entrypoints.openai.stage_params"
    namespace(name, get_default_sampling_params_list=lambda engine: [], clone_sampling_params=None)
    endpoint = importlib.import_module("vllm_omni.entrypoints.openpi.connection")
    serving = importlib.import_module("vllm_omni.entrypoints.openpi.serving")

    async def generate(prompt: Any, **more: Any) -> Any:
        actions = told(more["sampling_params_list"][0].extra_args["robot_obs"])
        yield SimpleNamespace(multimodal_output={"actions": np.pad(actions, ((0, 0), (0, 18)))})

    config = {"image_resolution": [224, 224], "action_horizon": ROWS, "action_dim": 32}
    engine = SimpleNamespace(
        generate=generate, model_config={"policy_server_config": {**config, "max_cameras": 3}}
    )
    app = FastAPI()

    async def robot(websocket: WebSocket) -> None:
        server = serving.ServingRealtimeRobotOpenPI(engine)
        idle = float(os.environ.get("ROBOSPA_IDLE", "30"))
        await endpoint.RobotRealtimeConnection(websocket, server, idle).handle_connection()

    robot.__annotations__["websocket"] = WebSocket
    app.websocket(PATH)(robot)
    web = uvicorn.Config(app, "127.0.0.1", announced_port(), log_level="error")
    asyncio.run(uvicorn.Server(web).serve())


def ask_starvla(checkout: str, port: int) -> Any:
    root = "examples.simBenchmarks.Robotwin.eval_files.model2robotwin_interface"
    theirs = module(checkout, root)
    robot = Robot()
    model = theirs.ModelClient("a.pt", "new_embodiment", port=port)
    while not robot.done:
        robot.take_action_cnt = len(robot.actions)
        theirs.eval(robot, model, robot.get_obs())
    return robot.actions


def ask_chunks(infer: Any, message: Any, actions: Any) -> Any:
    """Two queries, whose chunks are executed whole."""
    chunks = [actions(infer(message(observation(step)))) for step in (0, ROWS)]
    return np.concatenate(chunks)[:, :14]


def ask_lingbot(checkout: str, port: int) -> Any:
    policy = module(checkout, "deploy.websocket_client_policy").WebsocketClientPolicy(
        "127.0.0.1", port
    )
    policy.reset("robotwin")
    names = {"head": "cam_high", "left_wrist": "cam_left_wrist", "right_wrist": "cam_right_wrist"}

    def message(seen: Any) -> Any:
        images = {f"observation.images.{names[n]}": image for n, image in seen["images"].items()}
        state = seen["state"].astype(float)
        return {**images, "observation.state": state, "task": seen["instruction"]}

    return ask_chunks(policy.infer, message, lambda answer: answer["action"])


def ask_vllm(checkout: str, port: int) -> Any:
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    policy = WebsocketClientPolicy(f"ws://127.0.0.1:{port}{PATH}", None)
    policy.infer({"endpoint": "reset"})
    names = {"head": "base", "left_wrist": "left_wrist", "right_wrist": "right_wrist"}

    def message(seen: Any) -> Any:
        images = {f"observation.images.{names[n]}_0_rgb": i for n, i in seen["images"].items()}
        state = seen["state"].astype(float)
        return {"images": images, "state": state, "prompt": seen["instruction"]}

    return ask_chunks(policy.infer, message, lambda answer: answer)


if __name__ == "__main__":
    name = sys.argv[-1]
    main(globals()[f"serve_{name}"], globals()[f"ask_{name}"])
