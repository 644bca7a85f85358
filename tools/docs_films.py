"""The pictures of the documentation that show more than one task: films of the expert, and sheets.

`python tools/docs_films.py FOLDER` writes FOLDER/trials.webp, three tasks with their sentences
below, FOLDER/ROBOT.webp for the robots of the paper, robots.jpg, which has them side by side, and
randomized.jpg. Pages show WebP without a player. Needs a device that draws.
"""

from __future__ import annotations

import io
import sys
import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.harness.demonstrations.demonstration import demonstrate
from robospa.harness.pictures.gallery import first_frame
from robospa.harness.pictures.video import FPS, FilmRecorder
from robospa.harness.world import World
from robospa.tasks.catalog import build_scene
from robospa.tasks.sentences import instruction
from robospa.trial import REFERENCE, TrialKey

if TYPE_CHECKING:
    from PIL import Image

SEED = 100_000
SHOWN = (
    ("Pick_Mixed_Objects_Distance_B", 5),
    ("Stack_Blocks_Color_Order", 3),
    ("Click_Can_Place_Items", 3),
)
"""Task and level: one of spatial understanding, and two of several steps."""
ROBOTS = (REFERENCE, "franka-panda", "ur5-wsg", "piper", "ARX-X5")
ROBOTS_TASK, TRIES = ("Stack_Blocks_Color_Order", 3), 10
"""What every robot does: three blocks, both arms; the first of so many scenes that it solves."""
CAMERA, DRAWN = "third", (960, 720)
CUT, SIZE = (48, 90, 912, 606), (576, 344)
"""Left, top, right and bottom of what is shown of it [px]: the arms and most of the table; and its
width and height in the film. Of the robots:"""
ROBOT_CUT, ROBOT_SIZE = (96, 0, 864, 576), (384, 288)
STRIP, TEXT, MOST_LETTERS = 52, 15, 72
"""Height of the strip with the sentence, size of its letters [px], and how many are a line."""
EVERY = 2
"""One of so many frames of the tasks is kept: four times real time."""
QUALITY = (85, 70, 55, 40, 25)
"""Of WebP: the best of these that is small enough."""
MOST_BYTES, ROBOT_BYTES = 1_500_000, 900_000
DARK, LIGHT = (24, 28, 34), (236, 239, 243)
RANDOMIZED = (
    "Pick_Blocks_Size,Pick_Blocks_Area,Pick_Pill_Bottles_Distance,Pick_Blocks_Canonical,"
    "Pick_Mixed_Objects_Canonical_A,Pick_Cans_Relational,Pick_Mixed_Objects_Relational_B,"
    "Pick_Breads_Multi_View,Press_Stapler_Repeat,Click_Bell_Repeat,Move_Playing_Cards_Away,"
    "Rank_Blocks_Height,Hit_Blocks_Hammer_Order,Click_Bell_Clockwise_Order,"
    "Stack_Blocks_Length_Order,Hang_Mug_Stack_Blocks,Click_Can_Place_Items,"
    "Observe_Blocks_Move_Memory,Remember_Orientation_Restore,Pick_Mugs_Distance"
)
SHEET, LABEL, APART = (320, 240), 22, 6
"""Width and height of a picture on a sheet, height of its label and the gap beside it [px]."""


class Animation(FilmRecorder):
    """Keeps one of `every` frames of a trial as `drawn` makes a page of it."""

    def __init__(self, drawn: Callable[[Image.Image], Image.Image], every: int = 1) -> None:
        super().__init__((CAMERA,), DRAWN)
        self._page, self._every, self._count = drawn, every, 0
        self.frames: list[Image.Image] = []

    def add(self, image: NDArray[np.uint8]) -> None:
        """Take one RGB frame, uint8 (height, width, 3)."""
        from PIL import Image

        if self._count % self._every == 0:
            self.frames.append(self._page(Image.fromarray(image)))
        self._count += 1


def encode(frames: list[Image.Image], most_bytes: int) -> bytes:
    """An animated WebP of ten `frames` a second, in the best quality below `most_bytes`."""
    for quality in QUALITY:
        data = io.BytesIO()
        frames[0].save(
            data, "webp", save_all=True, append_images=frames[1:], duration=1000 // FPS, loop=0,
            quality=quality, method=4,
        )  # fmt: skip
        if data.tell() <= most_bytes:
            break
    return data.getvalue()


def captioned(image: Image.Image, sentence: str) -> Image.Image:
    """The part of `image` that is shown, and `sentence` below it."""
    from PIL import Image, ImageDraw, ImageFont

    made = Image.new("RGB", (SIZE[0], SIZE[1] + STRIP), DARK)
    made.paste(image.crop(CUT).resize(SIZE, Image.Resampling.LANCZOS), (0, 0))
    draw, font = ImageDraw.Draw(made), ImageFont.load_default(TEXT)
    middle = (SIZE[0] / 2, SIZE[1] + STRIP / 2)
    text = "\n".join(textwrap.wrap(sentence, MOST_LETTERS))
    draw.multiline_text(middle, text, font=font, fill=LIGHT, anchor="mm", align="center")
    return made


def tasks_film(world: World) -> bytes:
    """The expert at all tasks of SHOWN, one after the other; RuntimeError if it fails at one."""
    frames: list[Image.Image] = []
    for task, level in SHOWN:
        sentence = instruction(build_scene(task, level, SEED), "heldout")
        recorder = Animation(partial(captioned, sentence=sentence), EVERY)
        if not demonstrate(world, TrialKey(task, level, SEED), recorder).success:
            raise RuntimeError(f"the expert does not solve {task} level {level} seed {SEED}")
        frames += recorder.frames
    return encode(frames, MOST_BYTES)


def robot_frames(world: World, robot: str) -> list[Image.Image]:
    """The expert with `robot` in the first scene that it solves; RuntimeError for none."""
    for seed in range(SEED, SEED + TRIES):
        recorder = Animation(lambda image: image.crop(ROBOT_CUT).resize(ROBOT_SIZE))
        if demonstrate(world, TrialKey(*ROBOTS_TASK, seed, robot), recorder).success:
            return recorder.frames
    raise RuntimeError(f"{robot} solves none of {TRIES} scenes")


def tiled(cells: list[tuple[str, Image.Image]], across: int) -> Image.Image:
    """Labelled pictures on one sheet, `across` of them in a row."""
    from PIL import Image, ImageDraw, ImageFont

    wide, high = SHEET[0] + APART, SHEET[1] + LABEL + APART
    made = Image.new("RGB", (across * wide, -(-len(cells) // across) * high), "white")
    draw, font = ImageDraw.Draw(made), ImageFont.load_default(TEXT)
    for number, (label, picture) in enumerate(cells):
        x, y = number % across * wide, number // across * high
        draw.text((x + 2, y + 2), label, font=font, fill=DARK)
        made.paste(picture.resize(SHEET, Image.Resampling.LANCZOS), (x, y + LABEL))
    return made


def randomized_sheet(world: World) -> Image.Image:
    """Twenty randomised scenes as the head camera sees them."""
    from PIL import Image

    cells = []
    for task in RANDOMIZED.split(","):
        scene = build_scene(task, 4, SEED, mode="randomized")
        picture = Image.fromarray(first_frame(world, scene))
        cells.append((task.replace("_", " "), picture))
    return tiled(cells, 5)


def main(folder: Path) -> None:
    """Write all films into `folder`."""
    from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=True, limits=DEMONSTRATION_LIMITS)
    (folder / "trials.webp").write_bytes(tasks_film(world))
    films = {robot: robot_frames(world, robot) for robot in ROBOTS}
    for robot, frames in films.items():
        (folder / f"{robot}.webp").write_bytes(encode(frames, ROBOT_BYTES))
    stills = [(robot, frames[0]) for robot, frames in films.items()]
    stills += [("", frames[len(frames) // 5]) for frames in films.values()]
    tiled(stills, len(ROBOTS)).save(folder / "robots.jpg", quality=88)
    randomized_sheet(SapienWorld(render=True)).save(folder / "randomized.jpg", quality=88)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/docs_films.py FOLDER")
    main(Path(sys.argv[1]))
