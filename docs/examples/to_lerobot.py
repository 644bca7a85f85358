"""Official or own HDF5 episodes as a LeRobot dataset (format v3.0).

    python to_lerobot.py FOLDER_OF_EPISODES NEW_FOLDER

Needs an environment with `lerobot[dataset]` and `robospa[demos]`. The state of frame t is what was
commanded then, its action what was commanded next.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robospa.harness.convention_check.episodes import read_episode
from robospa.observation import CameraSpec

CAMERAS = [CameraSpec("head"), CameraSpec("left_wrist"), CameraSpec("right_wrist")]
JOINTS = [f"{arm}_{j}" for arm in ("left", "right") for j in (*range(1, 7), "gripper")]
PIXELS = {"dtype": "image", "shape": (240, 320, 3), "names": ["height", "width", "channels"]}
NUMBERS = {"dtype": "float32", "shape": (14,), "names": JOINTS}


def convert(files: list[Path], out: Path) -> None:
    """Write all episodes into the new folder `out`."""
    images = {f"observation.images.{camera.name}": PIXELS for camera in CAMERAS}
    dataset = LeRobotDataset.create(
        repo_id=f"local/{out.name}",
        fps=25,
        features={**images, "observation.state": NUMBERS, "action": NUMBERS},
        root=out,
        robot_type="aloha-agilex",
        use_videos=False,
    )
    for file in files:
        episode = read_episode(file)
        for t in range(len(episode) - 1):
            frame = {f"observation.images.{c.name}": episode.picture(c, t) for c in CAMERAS}
            frame["observation.state"] = episode.commanded[t].astype(np.float32)
            frame["action"] = episode.commanded[t + 1].astype(np.float32)
            dataset.add_frame({**frame, "task": episode.instruction})
        dataset.save_episode()
    dataset.finalize()


if __name__ == "__main__":
    convert(sorted(Path(sys.argv[1]).glob("*.hdf5")), Path(sys.argv[2]))
