"""The moving picture of the first page: a robot at three tasks, with the sentence of each.

`python -m robospa.harness.pictures.front_film FILE` runs the expert and writes an animated WebP,
which pages show without a player. Needs a device that draws.
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.harness.demonstrations.demonstration import demonstrate
from robospa.harness.pictures.robot_films import encode
from robospa.harness.pictures.video import FilmRecorder
from robospa.harness.world import World
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.sentences import instruction
from robospa.trial import REFERENCE, TrialKey

if TYPE_CHECKING:
    from PIL import Image

SHOWN = (
    ("Pick_Mixed_Objects_Distance_B", 5, 100_000),
    ("Stack_Blocks_Color_Order", 3, 100_000),
    ("Click_Can_Place_Items", 3, 100_000),
)
"""Task, level and seed: one of spatial understanding, and two of several steps."""
CAMERA = CameraSpec("third", 960, 720)
CUT = (48, 90, 912, 606)
"""Left, top, right and bottom of the part that is shown [px]: the arms and most of the table."""
SIZE, STRIP = (576, 344), 52
"""Width and height of the picture, and height of the strip with the sentence below it [px]."""
TEXT, MOST_LETTERS = 15, 72
"""Size of the sentence's letters [px], and how many of them are a line."""
EVERY = 2
"""One of so many frames is kept: four times real time, at ten frames a second."""
MOST_BYTES = 1_500_000
DARK, LIGHT = (24, 28, 34), (236, 239, 243)


class Captioned:
    """Takes the frames of a film, and keeps some of them with a sentence below."""

    def __init__(self, sentence: str) -> None:
        self._sentence = sentence
        self._count = 0
        self.frames: list[Image.Image] = []

    def add(self, image: NDArray[np.uint8]) -> None:
        """Take one RGB frame, uint8 (height, width, 3)."""
        if self._count % EVERY == 0:
            self.frames.append(captioned(image, self._sentence))
        self._count += 1

    def finish(self) -> bytes:
        """Nothing: its frames become part of a longer film."""
        return b""


def captioned(image: NDArray[np.uint8], sentence: str) -> Image.Image:
    """The part of `image` (height, width, 3) that is shown, and `sentence` below it."""
    from PIL import Image, ImageDraw, ImageFont

    page = Image.new("RGB", (SIZE[0], SIZE[1] + STRIP), DARK)
    part = Image.fromarray(image).crop(CUT)
    page.paste(part.resize(SIZE, Image.Resampling.LANCZOS), (0, 0))
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(TEXT)
    middle = (SIZE[0] / 2, SIZE[1] + STRIP / 2)
    text = "\n".join(textwrap.wrap(sentence, MOST_LETTERS))
    draw.multiline_text(middle, text, font=font, fill=LIGHT, anchor="mm", align="center")
    return page


def front_film(world: World, robot: str = REFERENCE) -> bytes:
    """The expert at all tasks of SHOWN, one after the other; RuntimeError if it fails at one."""
    frames: list[Image.Image] = []
    for task, level, seed in SHOWN:
        video = Captioned(instruction(build_scene(task, level, seed, robot), "heldout"))
        recorder = FilmRecorder([CAMERA], video)
        if not demonstrate(world, TrialKey(task, level, seed, robot), recorder).success:
            raise RuntimeError(f"{robot} does not solve {task} level {level} seed {seed}")
        frames += video.frames
    return encode(frames, MOST_BYTES)


def main(path: Path) -> None:
    """Write the film to `path`."""
    from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=True, limits=DEMONSTRATION_LIMITS)
    path.write_bytes(front_film(world))
    world.close()
    print(path, path.stat().st_size, "bytes")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m robospa.harness.pictures.front_film FILE")
    main(Path(sys.argv[1]))
