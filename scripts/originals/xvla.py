"""X-VLA: the FastAPI application of its model, and its own RoboTwin client."""

from __future__ import annotations

import importlib
import os
from types import SimpleNamespace
from typing import Any

import numpy as np
from world import Robot, announced_port, flat, load, main, namespace, report, stub


class Tensor:
    """As much of torch as the application touches."""

    def __init__(self, value: Any) -> None:
        self.value = np.asarray(value)

    def unsqueeze(self, axis: int) -> Tensor:
        return Tensor(np.expand_dims(self.value, axis))

    def squeeze(self, axis: int) -> Tensor:
        return Tensor(self.value.squeeze(axis))

    def is_floating_point(self) -> bool:
        return self.value.dtype.kind == "f"

    def to(self, *_: Any, **__: Any) -> Tensor:
        return self

    def float(self) -> Tensor:
        return self

    cpu = float

    def numpy(self) -> Any:
        return self.value


def ee6d() -> Any:
    """(30, 20) with proper rotations, not orthonormal; grippers on both sides of 0.7."""
    random = np.random.default_rng(2)
    return random.uniform(0.0, 1.0, size=(30, 20)).astype(np.float32)


def serve(checkout: str) -> None:
    namespace(
        "torch",
        Tensor=Tensor,
        as_tensor=Tensor,
        tensor=lambda value, dtype: Tensor(value),
        long=0,
        no_grad=lambda: lambda function: function,
    )
    namespace("transformers", PreTrainedModel=object)
    namespace("models", __path__=[f"{checkout}/models"])
    for name in ("modeling_florence2", "transformer", "action_hub", "configuration_xvla"):
        stub(f"models.{name}")
    module = importlib.import_module("models.modeling_xvla")
    shown: dict[str, Any] = {}

    class Model(module.XVLA):
        def __init__(self) -> None:
            self.app = None

        def eval(self) -> Any:
            return self

        def parameters(self) -> Any:
            return iter([SimpleNamespace(device="cpu", dtype="float32")])

        def generate_actions(self, steps: int, **given: Tensor) -> Tensor:
            read = {name: given[name].value for name in ("proprio", "domain_id")}
            report(flat({**shown, **read, "steps": steps}))
            return Tensor(ee6d()[None])

    def process(images: Any, text: str) -> Any:
        shown.clear()
        shown.update({f"image{n}": np.asarray(image) for n, image in enumerate(images)}, text=text)
        return {name: Tensor(np.zeros(1)) for name in ("input_ids", "image_input", "image_mask")}

    Model().run(process, "127.0.0.1", announced_port())


class Grippers(Robot):
    """Its grippers are where they were commanded last, as RoboTwin's are."""

    def get_obs(self) -> dict[str, Any]:
        seen = super().get_obs()
        if self.actions:
            left, right = (float(np.clip(self.actions[-1][n], 0, 1)) for n in (7, 15))
            seen["endpose"] |= {"left_gripper": left, "right_gripper": right}
        return seen


def ask(checkout: str, port: int) -> Any:
    namespace("torch", Tensor=Tensor, set_default_dtype=lambda kind: None, float32=0)
    stub("imageio", "matplotlib.pyplot")
    os.chdir = lambda path: None  # type: ignore[assignment]
    module = load(f"{checkout}/evaluation/robotwin-2.0/client.py")
    robot, model = Grippers(limit=60), module.ClientModel("127.0.0.1", port)
    model.set_instruction(robot.get_instruction())
    module._rollout(robot, model)
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
