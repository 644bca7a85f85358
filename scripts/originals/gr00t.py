"""GR00T: `PolicyServer` in front of `Gr00tPolicy`'s own checks, and its `PolicyClient`.

The word `flat` is for `Gr00tSimPolicyWrapper`, `nd` for answers in msgpack-numpy's form, as newer
versions write them; `n15` for N1.5's server and client.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any

import numpy as np
from world import ROWS, TEXT, Robot, flat, free_port, joints, main, namespace, report, stub

WAY = sys.argv[-1]
PARTS = {
    "left_arm": slice(0, 6),
    "left_gripper": slice(6, 7),
    "right_arm": slice(7, 13),
    "right_gripper": slice(13, 14),
}
VIDEOS = {"cam_high": "head_camera", "cam_left_wrist": "left_camera"}
KEYS = {"video": VIDEOS, "state": PARTS, "action": PARTS, "language": ["task"]}


def configs(kind: Any) -> Any:
    """What the model reads, as the original's ModalityConfig."""
    steps = {name: [0] for name in KEYS} | {"action": list(range(ROWS))}
    return {name: kind(delta_indices=steps[name], modality_keys=list(KEYS[name])) for name in KEYS}


def actions(seen: Any) -> Any:
    """The answer to a query, by name."""
    report(flat(seen))
    return {name: joints()[None, :, columns] for name, columns in PARTS.items()}


def serve(checkout: str) -> None:
    sys.path.insert(0, checkout)
    port = free_port()
    if WAY == "n15":
        server = old().RobotInferenceServer(OldPolicy(), "127.0.0.1", port)
        report({"port": port})
        return server.run()  # type: ignore[no-any-return]
    wire, policies, types = modern()

    class Stub(policies.Gr00tPolicy):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            self.strict, self.modality_configs = True, configs(types.ModalityConfig)

        def _get_action(self, observation: Any, options: Any = None) -> Any:
            return actions(observation), {}

    policy = policies.Gr00tSimPolicyWrapper(Stub()) if WAY == "flat" else Stub()
    server = wire.PolicyServer(policy, "127.0.0.1", port)
    report({"port": port})
    server.run()


def modern() -> Any:
    stub("torch", "transformers")
    importlib.import_module("gr00t")
    stub("gr00t.model")
    names = ("gr00t.policy.server_client", "gr00t.policy.gr00t_policy", "gr00t.data.types")
    found = [importlib.import_module(name) for name in names]
    if WAY == "nd":
        import msgpack_numpy

        form = found[0].MsgSerializer
        write, read = form.encode_custom_classes, form.decode_custom_classes
        form.encode_custom_classes = lambda item: msgpack_numpy.encode(item, chain=write)
        form.decode_custom_classes = lambda item: msgpack_numpy.decode(item, chain=read)
    return found


def old() -> Any:
    from pydantic import BaseModel

    class ModalityConfig(BaseModel):
        delta_indices: list[int]
        modality_keys: list[str]

    OldPolicy.kind = ModalityConfig
    namespace("gr00t.data.dataset", ModalityConfig=ModalityConfig)
    namespace("gr00t.model.policy", BasePolicy=object)
    return importlib.import_module("gr00t.eval.robot")


class OldPolicy:
    """N1.5's policy drops the axes of one number."""

    kind: Any = None

    def get_modality_config(self) -> Any:
        return configs(self.kind)

    def get_action(self, seen: Any) -> Any:
        return {f"action.{name}": np.squeeze(part) for name, part in actions(seen).items()}


def ask(checkout: str, port: int) -> Any:
    sys.path.insert(0, checkout)
    client = (
        old().RobotInferenceClient("127.0.0.1", port)
        if WAY == "n15"
        else modern()[0].PolicyClient("127.0.0.1", port)
    )
    robot = Robot()
    while not robot.done:
        seen = robot.get_obs()
        state = np.asarray(seen["joint_action"]["vector"], np.float32)
        sent = {f"video.{n}": seen["observation"][c]["rgb"][None] for n, c in VIDEOS.items()}
        sent |= {f"state.{n}": state[None, columns] for n, columns in PARTS.items()}
        if WAY == "n15":
            answer = client.get_action({**sent, "task": [TEXT]})
        else:
            batch: Any = {name: value[None] for name, value in sent.items()} | {"task": [TEXT]}
            tree: Any = {"video": {}, "state": {}, "language": {"task": [[TEXT]]}}
            for name, value in sent.items():
                tree[name.split(".")[0]][name.split(".")[1]] = value[None]
            answer, _ = client.get_action(batch if WAY == "flat" else tree)
        found = {name.removeprefix("action."): value for name, value in answer.items()}
        rows = [np.reshape(found[name], (ROWS, -1)) for name in PARTS]
        for row in np.concatenate(rows, axis=1):
            robot.take_action(row)
    return robot.actions


if __name__ == "__main__":
    main(serve, ask)
