"""GO-1: `evaluate/deploy.py`'s server, and RoboTwin's client of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from world import Robot, announced_port, flat, joints, load, main, report, stub


def serve(checkout: str) -> None:
    stub("torch", "transformers", "draccus", "go1.internvl.model.go1")
    stub("go1.internvl.train.constants", "go1.internvl.train.dataset")
    module = load(f"{checkout}/AgiBot-World/evaluate/deploy.py")
    server = module.GO1Server.__new__(module.GO1Server)

    def inference(seen: Any) -> Any:
        report(flat(seen))
        return joints()

    server.model = SimpleNamespace(inference=inference)
    server.run("127.0.0.1", announced_port())


def ask(checkout: str, port: int) -> Any:
    module = load(f"{checkout}/RoboTwin/policy/GO1/deploy_policy.py")
    robot, model = Robot(), module.get_model({"host": "127.0.0.1", "port": port})
    while not robot.done:
        module.eval(robot, model, robot.get_obs())
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
