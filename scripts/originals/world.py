"""What both clients of a comparison see and do, in any Python that has numpy.

A case is a script with `serve(checkout)` and `ask(checkout, port)`, which `check_originals.py` runs
in the Python of the original. `serve` reports what the original server's model has read, one JSON
line a query; `ask` lets the original client act in `Robot` and reports the actions.
"""

from __future__ import annotations

import hashlib
import importlib.util
import itertools
import json
import os
import socket
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any
from unittest.mock import MagicMock

import numpy as np

CAMERAS = {"head": "head_camera", "left_wrist": "left_camera", "right_wrist": "right_camera"}
TEXT = "pick the “red” block"
TASK, SEED = "Pick_Blocks_Size", 100_000
ROWS = 6
"""Actions that a model answers."""


def observation(step: int = 0, text: str = TEXT) -> dict[str, Any]:
    """Noise that follows from `step`, in the shapes of a trial; grippers from 0 to 1."""
    random = np.random.default_rng(step)
    ee = random.normal(size=(2, 8)).astype(np.float32)
    ee[:, 3:7] /= np.linalg.norm(ee[:, 3:7], axis=1, keepdims=True)
    state = random.normal(size=14).astype(np.float32)
    state[[6, 13]] = ee[:, 7] = random.uniform(size=2)
    return {
        "images": {name: random.integers(0, 256, (240, 320, 3), np.uint8) for name in CAMERAS},
        "state": state,
        "ee": ee,
        "instruction": text,
        "step": step,
    }


def joints() -> Any:
    """The model's chunk of joints, float32 (ROWS, 14), grippers from 0 to 1."""
    return np.random.default_rng(1).uniform(size=(ROWS, 14)).astype(np.float32)


def as_robotwin(seen: dict[str, Any]) -> dict[str, Any]:
    """An observation as RoboTwin's simulator gives it."""
    state, ee = seen["state"].astype(float), seen["ee"].astype(float)
    cameras = {theirs: {"rgb": seen["images"][ours]} for ours, theirs in CAMERAS.items()}
    return {
        "observation": {**cameras, "front_camera": cameras["head_camera"]},
        "joint_action": {
            "left_arm": state[:6].tolist(),
            "left_gripper": float(state[6]),
            "right_arm": state[7:13].tolist(),
            "right_gripper": float(state[13]),
            "vector": state,
        },
        "endpose": {
            "left_endpose": ee[0, :7].tolist(),
            "left_gripper": float(ee[0, 7]),
            "right_endpose": ee[1, :7].tolist(),
            "right_gripper": float(ee[1, 7]),
        },
    }


class Robot:
    """RoboTwin's environment as its clients use it: ends after `limit` actions."""

    render_freq, suc, actor_pose, viewer = 0, 0, True, None

    def __init__(self, limit: int = 2 * ROWS) -> None:
        self.limit = limit
        self.actions: list[list[float]] = []

    def get_obs(self) -> dict[str, Any]:
        return as_robotwin(observation(len(self.actions)))

    def get_instruction(self) -> str:
        return TEXT

    def take_action(self, action: Any, action_type: str = "qpos") -> None:
        self.actions.append(np.asarray(action, float).tolist())

    def check_success(self) -> bool:
        return self.done

    @property
    def done(self) -> bool:
        return len(self.actions) >= self.limit

    def _update_render(self) -> None:
        return None


def flat(value: Any, path: str = "") -> dict[str, Any]:
    """Every leaf by its path: arrays as dtype, shape and digest, others as they are."""
    if isinstance(value, dict):
        found: dict[str, Any] = {}
        for key, item in value.items():
            found |= flat(item, f"{path}.{key}" if path else str(key))
        return found
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:16]
        return {path: [str(value.dtype), list(value.shape), digest, small(value)]}
    return {path: list(value) if isinstance(value, tuple) else value}


def small(value: Any) -> Any:
    """The numbers of a short array, so that two dtypes can be compared by value."""
    return value.astype(float).ravel().tolist() if value.size <= 64 else None


OUT = sys.stdout
FAILS = int(os.environ.get("ROBOSPA_FAIL_AFTER", "0"))
"""The query at which the model raises; 0: none."""
queries = itertools.count()


def report(value: Any) -> None:
    """One line for `scripts/check_originals`: first the port, then what the model reads."""
    print(json.dumps(value), file=OUT, flush=True)
    if next(queries) == FAILS > 0:
        raise RuntimeError("CUDA out of memory on rank 0")


def load(path: str) -> Any:
    """The module in a file, which is in no package."""
    spec = importlib.util.spec_from_file_location("original", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def announced_port() -> int:
    """A port that is free, after a report of it."""
    port = free_port()
    report({"port": port})
    return port


def free_port() -> int:
    """ROBOSPA_PORT if that is set."""
    if given := os.environ.get("ROBOSPA_PORT"):
        return int(given)
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
    return port


def stub(*names: str) -> None:
    """Stand-ins for modules that a server or a client imports and that play no part here."""
    for name in names:
        parts = name.split(".")
        for end in range(1, len(parts) + 1):
            sys.modules.setdefault(".".join(parts[:end]), MagicMock())


def namespace(name: str, **members: Any) -> None:
    """A module with just these members."""
    module = ModuleType(name)
    module.__dict__.update(members)
    sys.modules[name] = module


def main(serve: Callable[[str], None], ask: Callable[[str, int], Any]) -> None:
    """`case.py serve CHECKOUT` or `case.py ask CHECKOUT PORT`."""
    sys.stdout = sys.stderr  # what the originals print is no report
    if sys.argv[1] == "serve":
        serve(sys.argv[2])
    else:
        found = ask(sys.argv[2], int(sys.argv[3]))
        report({"actions": [np.asarray(row, float).tolist() for row in found]})
