"""Reads a whole data set with the real LeRobot; runs in the models' environment (.venv-models).

    python lerobot_export.py FOLDER OUT.npz EVERY

OUT has every column of numbers of every frame, the head camera's pictures of one episode in EVERY
(`pictures`, uint8 (N, height, width, 3), and `pictured`, the frames that they are of), and `about`,
a JSON text: episodes and frames as LeRobot counts them, the sentence of every episode, and how many
frames were read one by one as a learner would, each equal to its row of the columns.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

os.environ.setdefault("HF_HUB_OFFLINE", "1")

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset

HEAD = "observation.images.head"


def main(folder: Path, out: Path, every: int) -> None:
    """See above."""
    found = LeRobotDataset("robospa/read", root=folder, video_backend="pyav")
    names = [name for name in found.hf_dataset.column_names if name != HEAD]
    table = found.hf_dataset.select_columns(names).with_format("numpy")[:]
    arrays = {name: np.asarray(table[name]) for name in names}
    episode_of = arrays["episode_index"]
    first = np.searchsorted(episode_of, np.arange(found.num_episodes))
    filmed = HEAD in found.meta.features
    wanted = np.flatnonzero(episode_of % every == 0) if filmed else first[:0]
    tasks, pictures, read_one_by_one = {}, [], sorted({*wanted.tolist(), *first.tolist()})
    for i in read_one_by_one:
        item = found[i]
        for name, column in arrays.items():
            assert np.array_equal(np.asarray(item[name]).reshape(-1), column[i].reshape(-1)), name
        tasks[i] = item["task"]
        if filmed and episode_of[i] % every == 0:
            seen = 255 * item[HEAD].permute(1, 2, 0)
            pictures.append(seen.round().to(torch.uint8).numpy())
    if filmed:
        arrays["pictures"] = np.stack(pictures)
    about = {
        "episodes": found.num_episodes,
        "frames": found.num_frames,
        "tasks": [tasks[int(i)] for i in first],
        "items": len(read_one_by_one),
    }
    np.savez(out, about=json.dumps(about), pictured=wanted, **arrays)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]))
