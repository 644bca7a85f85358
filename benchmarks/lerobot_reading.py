"""The real LeRobot reads whole data sets: every number against the episodes that were collected.

    python benchmarks/lerobot_reading.py DIR [DIR ...] [--every 10] [--json]

For data sets of `robospa collect --keep-episodes --format lerobot-v3`; what was collected is in
DIR/episodes, or in the folder above, where there is a data set for each robot. Needs the models'
environment (`make models`, or ROBOSPA_MODELS_PYTHON). Of one episode in `--every` the head camera's
pictures are compared as well, with those that were encoded.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import Metric, Result, argument_parser, finish
from numpy.typing import NDArray

from robospa.harness.datasets.episode_file import read_episode_file
from robospa.harness.datasets.features import Written, all_pictures
from robospa.harness.datasets.manifest import EpisodeLine
from robospa.harness.datasets.store import EpisodeStore
from robospa.schema import read
from robospa.tasks.seeds import ListKey

ROOT = Path(__file__).resolve().parents[1]
PYTHON = os.environ.get("ROBOSPA_MODELS_PYTHON", str(ROOT / ".venv-models" / "bin" / "python"))
Arrays = Mapping[str, NDArray[np.generic]]
NOISE = 6.0
"""Mean difference of a picture's values, 0 to 255, that is none: film or JPEG decoded twice."""


@dataclass(frozen=True)
class Compared:
    """A data set's `episodes`, `frames` and pictures, and what of them is not as collected."""

    folder: Path
    episodes: int
    frames: int
    pictures: int
    wrong: tuple[str, ...]
    error: float
    """Largest mean difference of a picture's values, 0 to 255."""


def by_lerobot(folder: Path, every: int) -> dict[str, NDArray[np.generic]]:
    """What LeRobot gives of the data set in `folder`."""
    with tempfile.TemporaryDirectory() as where:
        out = Path(where) / "read.npz"
        script = Path(__file__).with_name("lerobot_export.py")
        command = [PYTHON, str(script), str(folder), str(out), str(every)]
        subprocess.run(command, check=True, env={**os.environ, "CUDA_VISIBLE_DEVICES": ""})
        with np.load(out) as file:
            return dict(file)


def lines_of(folder: Path) -> Iterator[EpisodeLine]:
    """The data set's list of episodes."""
    for line in (folder / "meta" / "robospa_episodes.jsonl").read_text().splitlines():
        yield read(EpisodeLine, json.loads(line), "episode")


def compare(folder: Path, every: int) -> Compared:
    """The data set in `folder`, as LeRobot reads it, against its kept episodes."""
    kept = next(p / "episodes" for p in (folder, folder.parent) if (p / "episodes").is_dir())
    store, written, wrong = EpisodeStore(kept), Written(), []
    found = by_lerobot(folder, every)
    about = json.loads(str(found["about"]))
    pictured = {int(i): n for n, i in enumerate(found["pictured"])}
    errors = [0.0]
    for number, line in enumerate(lines_of(folder)):
        list_key = ListKey(line.key.task, line.key.level, line.key.embodiment, line.key.mode)
        first = written.frames
        episode = read_episode_file(store.path(list_key, line.key.seed), number % every == 0)
        for name, values in written.rows(episode).items():
            if not np.array_equal(found[name][first : first + len(episode)], values):
                wrong.append(f"{name} of {line.key.slug}")
        written.add(episode)
        if about["tasks"][number] != episode.instructions[0]:
            wrong.append(f"the sentence of {line.key.slug}")
        for t, picture in enumerate(
            all_pictures(episode.pictures["head"]) if first in pictured else ()
        ):
            seen = found["pictures"][pictured[first + t]].astype(float)
            errors.append(float(abs(seen - picture).mean()))
    if (about["episodes"], about["frames"]) != (written.episodes, written.frames):
        wrong.append(f"counts: {about['episodes']} episodes with {about['frames']} frames")
    if max(errors) > NOISE:
        wrong.append(f"pictures: {max(errors):.1f} of 255 off")
    done = (written.episodes, written.frames, len(pictured))
    return Compared(folder, *done, tuple(wrong), max(errors))


def result(found: Sequence[Compared]) -> Result:
    """The figures of all data sets."""
    wrong = [text for one in found for text in one.wrong]
    episodes, frames = sum(one.episodes for one in found), sum(one.frames for one in found)
    return Result(
        "lerobot_reading",
        "Data sets read by LeRobot",
        (
            Metric("episodes read, every number of every frame compared", episodes, "episodes"),
            Metric("their frames", frames, "frames"),
            Metric("differences", len(wrong), "", at_most=0, note="; ".join(wrong[:5])),
            Metric("pictures compared", sum(one.pictures for one in found), "pictures"),
            Metric(
                "largest mean error of a picture",
                round(max(one.error for one in found), 2),
                "of 255",
                at_most=NOISE,
            ),
        ),
        data={one.folder.name: [one.episodes, one.frames, one.pictures] for one in found},
    )


def main() -> None:
    """See above."""
    parser = argument_parser(__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR")
    parser.add_argument("--every", type=int, default=10)
    options = parser.parse_args()
    finish(result([compare(folder, options.every) for folder in options.folders]), options)


if __name__ == "__main__":
    main()
