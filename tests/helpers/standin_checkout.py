"""A stand-in for a RoboSPA checkout: the folders and the class surface of the official one, in a
simulation that is a counter. Our own code; nothing of theirs.

The goal of its only task, Click_Bell_Repeat: the left arm's first joint was told 1 rad, as often as
the level says. An action takes 50 physics steps.
"""

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec, TrialInfo

ENVS = """
class UnStableError(Exception):
    pass
"""
TASK = """
import os, sys, time
import numpy as np
from envs import UnStableError

class Robot:
    def __init__(self):
        self.joints = {"left": [0.0] * 6 + [1.0], "right": [0.0] * 6 + [1.0]}
    def get_left_arm_jointState(self):
        return self.joints["left"]
    def get_right_arm_jointState(self):
        return self.joints["right"]
    def get_left_ee_pose(self):
        return [-0.3, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]
    def get_right_ee_pose(self):
        return [0.3, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]

class NAME:
    made = 0
    def setup_demo(self, now_ep_num, seed, is_test, **kwags):
        print("noise on standard output")
        assert kwags["eval_mode"] and kwags["left_embodiment_config"]["arms"] == 6
        assert os.path.basename(os.getcwd()) == "checkout"
        if seed % 10 == 1:
            raise UnStableError("the bell falls")
        if seed == 100007:
            os._exit(3)
        if seed == 100008:
            time.sleep(60)
        if seed == 100009:
            raise RuntimeError("no texture 7")
        self.seed, self.ep_num = seed, now_ep_num
        self.size = kwags["head_camera_h"], kwags["head_camera_w"]
        self.robot, self.plan_success, self.eval_success = Robot(), seed % 10 != 2, False
        self.take_action_cnt, self.step_lim, self.stage_sum = 0, 1, LEVEL
        self.task_success, self.done, self.down = [0] * LEVEL, 0, False
        self.info = {"info": {}}
    def play_once(self):
        if seed_breaks(self.seed):
            raise RuntimeError("no plan")
        self.done = self.stage_sum
        self.info["info"] = {"{A}": "050_bell/base1", "{a}": "left"}
        if self.stage_sum > 1:
            self.info["info"]["{B}"] = str(self.stage_sum)
        return self.info
    def update_progress(self):
        now = self.robot.joints["left"][0] > 0.99
        self.done += now and not self.down
        self.down = now
    def check_success(self):
        for i in range(self.stage_sum):
            self.task_success[i] = int(self.done > i)
        return self.done >= self.stage_sum
    def take_action(self, action, action_type="qpos"):
        if self.take_action_cnt == self.step_lim or self.eval_success:
            return
        self.take_action_cnt += 1
        if action_type == "qpos":
            self.robot.joints = {"left": action[:7].tolist(), "right": action[7:].tolist()}
        for _ in range(50):
            self.update_progress()
            if self.check_success():
                self.eval_success = True
                return
    def get_obs(self):
        height, width = self.size
        rgb = np.tile(np.arange(width).astype(np.uint8)[None, :, None], (height, 1, 3))
        rgb[0, 0] = [self.ep_num, self.seed % 256, self.take_action_cnt % 256]
        names = ("head_camera", "left_camera", "right_camera")
        return {"observation": {name: {"rgb": rgb} for name in names}}
    def close_env(self, clear_cache=False):
        self.robot = None

def seed_breaks(seed):
    return seed % 10 == 3
"""
SENTENCES = {
    1: (["ring {A}", "ring {A} with {a}"], ["make {A} sound"]),
    2: (["ring {A} {B} times"], ["make {A} sound {B} times"]),
}


def write_standin(folder: Path) -> Path:
    """The stand-in at `folder`/checkout."""
    root = folder / "checkout"
    files = {
        "envs/__init__.py": ENVS,
        "assets/robot/config.yml": json.dumps({"arms": 6}),
        "task_config/_embodiment_config.yml": json.dumps(
            {"aloha-agilex": {"file_path": "./assets/robot"}}
        ),
        "task_config/_camera_config.yml": json.dumps({"D435": {"h": 240, "w": 320}}),
        "task_config/demo_clean.yml": json.dumps({"camera": {"head_camera_type": "D435"}}),
        "description/objects_description/050_bell/base1.json": json.dumps(
            {"raw_description": "bell", "seen": ["brass bell"], "unseen": ["golden bell"]}
        ),
    }
    for level, (seen, unseen) in SENTENCES.items():
        name = f"Click_Bell_Repeat_{level}"
        files[f"envs/{name}.py"] = TASK.replace("NAME", name).replace("LEVEL", str(level))
        files[f"description/task_instruction/{name}.json"] = json.dumps(
            {"seen": seen, "unseen": unseen}
        )
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


class Ringer:
    """A policy that moves the left arm's first joint to 1 rad and back; it never sends more."""

    def __init__(self) -> None:
        self.spec = PolicySpec(name="ringer", cameras=(CameraSpec("head"),), horizon=1)
        self.trials: list[TrialInfo] = []
        self.seen: list[Observation] = []

    def reset(self, trial: TrialInfo) -> None:
        self.trials.append(trial)

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        self.seen.append(observation)
        action = np.array(observation["state"], copy=True)[None]
        action[0, 0] = 1.0 if action[0, 0] < 0.5 else 0.0
        return action
