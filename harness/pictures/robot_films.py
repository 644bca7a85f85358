"""Films of the robots: the expert on one of the paper's tasks for several embodiments.

`python -m robospa.harness.pictures.robot_films FOLDER` writes FOLDER/ROBOT.webp for every robot of
the paper: animated pictures, which pages show without a player. Needs a device that draws.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.harness.demonstrations.demonstration import demonstrate
from robospa.harness.pictures.variety import ROBOTS
from robospa.harness.pictures.video import FPS, FilmRecorder
from robospa.harness.world import World
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from PIL import Image

    Frames = list[Image.Image]

SHOWN = ("Stack_Blocks_Color_Order", 3)
"""Task and level: three blocks, both arms."""
FIRST_SEED, TRIES = 100_000, 10
CAMERA = CameraSpec("third", 960, 720)
CUT = (96, 0, 864, 576)
"""Left, top, right and bottom of the part that is shown [px]: the arms and most of the table."""
SIZE = (384, 288)
"""Width and height of a film [px]."""
QUALITY = (85, 70, 55, 40, 25)
"""Of WebP: the best of these that stays below MOST_BYTES."""
MOST_BYTES = 900_000


class Animation:
    """An animated WebP in memory, ten frames a second, that begins again at its end."""

    def __init__(self) -> None:
        self._frames: list[Image.Image] = []

    def add(self, image: NDArray[np.uint8]) -> None:
        """Append one RGB frame, uint8 (height, width, 3), cut and scaled to SIZE."""
        from PIL import Image

        part = Image.fromarray(image).crop(CUT)
        self._frames.append(part.resize(SIZE, Image.Resampling.BOX))

    def finish(self) -> bytes:
        """The file, in the best quality that fits."""
        return encode(self._frames, MOST_BYTES)


def encode(frames: Frames, most_bytes: int) -> bytes:
    """An animated WebP of ten `frames` a second, in the best quality below `most_bytes`."""
    for quality in QUALITY:
        data = io.BytesIO()
        frames[0].save(
            data,
            "webp",
            save_all=True,
            append_images=frames[1:],
            duration=1000 // FPS,
            loop=0,
            quality=quality,
            method=4,
        )
        if data.tell() <= most_bytes:
            break
    return data.getvalue()


def robot_film(world: World, robot: str) -> bytes:
    """The expert with `robot` in the first scene of SHOWN that it solves; RuntimeError for none."""
    task, level = SHOWN
    for seed in range(FIRST_SEED, FIRST_SEED + TRIES):
        recorder = FilmRecorder([CAMERA], Animation())
        if demonstrate(world, TrialKey(task, level, seed, robot), recorder).success:
            return recorder.finish()
    raise RuntimeError(f"{robot} solves {task} level {level} at none of {TRIES} seeds")


def write(folder: Path) -> list[Path]:
    """Write all films into `folder`; their paths."""
    from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=True, limits=DEMONSTRATION_LIMITS)
    written = []
    for robot in ROBOTS:
        written.append(folder / f"{robot}.webp")
        written[-1].write_bytes(robot_film(world, robot))
    world.close()
    return written


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m robospa.harness.pictures.robot_films FOLDER")
    for path in write(Path(sys.argv[1])):
        print(path, path.stat().st_size, "bytes")
