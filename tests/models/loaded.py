"""Loads a data set with the real LeRobot; runs in the models' environment.

python loaded.py FOLDER OUT.npz              every frame of a data set of version 3.0
python loaded.py --convert FOLDER OUT.npz    the same, of one of version 2.1, by LeRobot's converter

The file OUT has every column and camera, `chunks`: the four actions from every frame on, `padded`:
which of them lie beyond the episode, and `about`, a JSON text: tasks and statistics.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("HF_HUB_OFFLINE", "1")

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

CHUNK = 4


def load(folder: Path, out: Path) -> None:
    """Write what the library gives of every frame."""
    fps = json.loads((folder / "meta" / "info.json").read_text())["fps"]
    ahead = {"action": [i / fps for i in range(CHUNK)]}
    found = LeRobotDataset(
        "robospa/test", root=folder, delta_timestamps=ahead, video_backend="pyav"
    )
    items: list[dict[str, Any]] = [found[i] for i in range(len(found))]
    arrays = {
        name: np.stack([np.asarray(item[name]) for item in items])
        for name, value in items[0].items()
        if isinstance(value, torch.Tensor)
    }
    arrays["chunks"], arrays["padded"] = arrays.pop("action"), arrays.pop("action_is_pad")
    stats = {k: {n: v.tolist() for n, v in of.items()} for k, of in found.meta.stats.items()}
    about = {"tasks": [item["task"] for item in items], "stats": stats}
    loader = torch.utils.data.DataLoader(found, batch_size=8, shuffle=True)
    about["batch"] = list(next(iter(loader))["observation.images.head"].shape)
    np.savez(out, about=json.dumps(about), **arrays)


def main(words: list[str]) -> None:
    """See above."""
    if words[0] == "--convert":
        from lerobot.scripts.convert_dataset_v21_to_v30 import convert_dataset

        words = words[1:]
        convert_dataset("robospa/test", root=words[0], push_to_hub=False)
    load(Path(words[0]), Path(words[1]))


if __name__ == "__main__":
    main(sys.argv[1:])
