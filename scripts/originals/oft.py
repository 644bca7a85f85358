"""OpenVLA-OFT: `deploy.py`'s server in front of its own reading of images, and its ALOHA client."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
from world import TEXT, Robot, announced_port, flat, joints, load, main, report, stub

LIMITS = SimpleNamespace(num_images_in_input=3, center_crop=False)


def utils(checkout: str) -> Any:
    """Its helpers, with its real resizing of images."""
    sys.path.insert(0, checkout)
    stub("torch", "transformers", "huggingface_hub", "draccus", "prismatic.models")
    for name in ("action_heads", "film_vit_wrapper", "projectors"):
        stub(f"prismatic.models.{name}")
    for name in ("configuration", "modeling", "processing"):
        stub(f"prismatic.extern.hf.{name}_prismatic")
    stub("prismatic.vla.constants", "prismatic.vla.datasets.rlds.utils.data_utils")
    stub("experiments.robot.robot_utils")
    stub("experiments.robot.openvla_utils")
    return load(f"{checkout}/experiments/robot/openvla_utils.py")


def serve(checkout: str) -> None:
    helpers = utils(checkout)
    module = load(f"{checkout}/vla-scripts/deploy.py")

    def act(cfg: Any, vla: Any, processor: Any, seen: Any, text: str, **_: Any) -> Any:
        pictures = [seen["full_image"], *(seen[name] for name in seen if "wrist" in name)]
        shown = helpers.prepare_images_for_vla(pictures, LIMITS)
        read = {f"image{place}": np.asarray(one) for place, one in enumerate(shown)}
        report(flat({**read, "state": seen["state"], "prompt": text.lower()}))
        return list(joints())

    module.get_vla_action = act
    server = module.OpenVLAServer.__new__(module.OpenVLAServer)
    server.__dict__.update(dict.fromkeys(("vla", "processor", "action_head", "proprio_projector")))
    server.cfg = SimpleNamespace(use_film=False)
    server.run("127.0.0.1", announced_port())


def ask(checkout: str, port: int) -> Any:
    import json_numpy

    helpers, robot = utils(checkout), Robot()
    json_numpy.patch()
    names = ("full_image", "left_wrist_image", "right_wrist_image")
    state = robot.get_obs()["joint_action"]["vector"]
    while not robot.done:
        seen = robot.get_obs()
        pictures = [seen["observation"][f"{c}_camera"]["rgb"] for c in ("head", "left", "right")]
        small = [helpers.resize_image_for_policy(picture, 224) for picture in pictures]
        sent = {**dict(zip(names, small, strict=True)), "instruction": TEXT}
        sent["state"] = seen["joint_action"]["vector"]
        for row in helpers.get_action_from_server(sent, f"http://127.0.0.1:{port}/act"):
            state = state + row
            robot.take_action(state if sys.argv[-1] == "relative" else row)
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
