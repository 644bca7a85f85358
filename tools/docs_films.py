"""The pictures of the documentation that show more than one task: films of the expert, and sheets.

`python tools/docs_films.py FOLDER` writes FOLDER/trials.webp, three tasks with their sentences
below, FOLDER/ROBOT.webp for the robots of the paper, robots.jpg, which has them side by side, and
randomized.jpg. Pages show WebP without a player. Needs a device that draws.
"""

from __future__ import annotations

import io
import math
import sys
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from robospa.geometry import Pose, look_rotation
from robospa.harness.demonstrations.demonstration import demonstrate
from robospa.harness.pictures.gallery import first_frame
from robospa.harness.pictures.video import FPS, FilmRecorder
from robospa.harness.sim import furniture, renderer
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.world import CameraView, World
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.sentences import instruction
from robospa.tasks.shapes import Shape, Skin
from robospa.trial import REFERENCE, TrialKey

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
ROBOT_CUT, ROBOT_SIZE = (96, 0, 864, 576), (384, 288)
"""Left, top, right and bottom of what is shown of a robot's film [px], and its size there."""
STUDIO, SIZE = (1600, 960), (1000, 600)
"""Width and height of a picture of the tasks as it is drawn and as it is shown [px]."""
EYE, AT, VIEW = np.array((0.95, 0.62, 1.5)), np.array((-0.03, -0.2, 0.84)), math.radians(35)
"""Where the studio's camera is, where it looks [m] and its vertical field of view."""
SUNS, WIDE = 12, 0.13
"""So many pictures with the lights elsewhere are one: shadows as of lamps this wide."""
SUN, LAMP = (0.9, 0.88, 0.84), (0.75, 0.77, 0.8)
STRIP, TEXT, MOST_LETTERS = 76, 22, 84
"""Height of the strip with the sentence, size of its letters [px], and how many are a line."""
EVERY = 2
"""One of so many frames of the tasks is kept: four times real time."""
QUALITY = (85, 70, 55, 40, 25)
"""Of WebP: the best of these that is small enough."""
MOST_BYTES, ROBOT_BYTES = 3_800_000, 900_000
DARK, LIGHT = (24, 28, 34), (236, 239, 243)
RANDOMIZED = (
    "Pick_Blocks_Size,Pick_Blocks_Area,Pick_Pill_Bottles_Distance,Pick_Blocks_Canonical,"
    "Pick_Mixed_Objects_Canonical_A,Pick_Cans_Relational,Pick_Mixed_Objects_Relational_B,"
    "Pick_Breads_Multi_View,Press_Stapler_Repeat,Click_Bell_Repeat,Move_Playing_Cards_Away,"
    "Rank_Blocks_Height,Hit_Blocks_Hammer_Order,Click_Bell_Clockwise_Order,"
    "Stack_Blocks_Length_Order,Hang_Mug_Stack_Blocks,Click_Can_Place_Items,"
    "Observe_Blocks_Move_Memory,Remember_Orientation_Restore,Pick_Mugs_Distance"
)
SHEET, LABEL, APART, SMALL = (320, 240), 22, 6, 15
"""Width and height of a picture on a sheet, height of its label, the gap beside it and the
size of its letters [px]."""


class Studio(renderer.Renderer):
    """A light robot on a dark floor, seen from its left side under wide lamps. For the film of the
    tasks alone: nothing that a policy sees is drawn so."""

    def _draw(self, shapes: Sequence[Shape], name: str, skin: Skin | None = None) -> object:
        if name.startswith(("left ", "right ", "stand")):
            shapes = [
                replace(shape, color=tuple(0.76 - 1.3 * c for c in shape.color))
                if max(shape.color) - min(shape.color) < 0.1
                else shape
                for shape in shapes
            ]
        return super()._draw(shapes, name, skin)

    def view(self, spec: CameraSpec, links: renderer.Links) -> CameraView:
        """The same for every name."""
        aside = look_rotation(AT - EYE, np.cross((0.0, 0.0, 1.0), AT - EYE))
        return CameraView(Pose(tuple(EYE), aside), VIEW, 0.1, spec.width / spec.height)

    def render(self, *words: object, **more: object) -> list[NDArray[np.uint8]]:
        """The mean of SUNS pictures whose lights stand on a spiral about their places."""
        room, pictures = self._room, []
        room.sky = lambda: np.array(DARK, np.uint8)
        for number in range(SUNS):
            share = (number + 0.5) / SUNS
            r, turn = WIDE * math.sqrt(share), 15.0 * share
            x, y = r * math.cos(turn), r * math.sin(turn)
            room._sun.color = SUN
            way = look_rotation((0.35 + x, 0.25 + y, -1.0), (-1.0, 0.0, 0.0))
            room._sun.entity.pose = to_sapien(Pose(furniture.SHADOW_CENTRE, way))
            for lamp, (left, back, up) in zip(room._lamps, furniture.LAMPS, strict=True):
                lamp.color, tilt = LAMP, furniture.LAMP_TILT
                way = look_rotation((-left * math.sin(tilt), 0.0, -math.cos(tilt)), (0.0, 1.0, 0.0))
                lamp.entity.pose = to_sapien(Pose((left + x, back + y, up), way))
            pictures += super().render(*words, **more)
        return [np.mean(pictures, axis=0).round().astype(np.uint8)]


def studio() -> World:
    """A world that is drawn in the studio; only for this process's films of tasks."""
    furniture.SHADOW_SIZE, furniture.LAMP_SIZE, furniture.AMBIENT = 2048, 1024, 0.36
    furniture.FLOOR, furniture.LEGS = (0.03, 0.036, 0.046), (0.3, 0.3, 0.3)
    world = SapienWorld(render=True, limits=DEMONSTRATION_LIMITS)
    world._renderer = Studio()
    return world


class Animation(FilmRecorder):
    """Keeps one of `every` frames of a trial as `drawn` makes a page of it."""

    def __init__(
        self,
        drawn: Callable[[Image.Image], Image.Image],
        every: int = 1,
        size: tuple[int, int] = DRAWN,
    ) -> None:
        super().__init__((CAMERA,))
        self._cameras = [CameraSpec(CAMERA, *size)]
        self._page, self._every, self._count = drawn, every, 0
        self.frames: list[Image.Image] = []

    def add(self, image: NDArray[np.uint8]) -> None:
        """Take one RGB frame, uint8 (height, width, 3)."""
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
    """`image` in the size that is shown, and `sentence` below it."""
    made = Image.new("RGB", (SIZE[0], SIZE[1] + STRIP), DARK)
    made.paste(image.resize(SIZE, Image.Resampling.LANCZOS), (0, 0))
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
        recorder = Animation(partial(captioned, sentence=sentence), EVERY, STUDIO)
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
    wide, high = SHEET[0] + APART, SHEET[1] + LABEL + APART
    made = Image.new("RGB", (across * wide, -(-len(cells) // across) * high), "white")
    draw, font = ImageDraw.Draw(made), ImageFont.load_default(SMALL)
    for number, (label, picture) in enumerate(cells):
        x, y = number % across * wide, number // across * high
        draw.text((x + 2, y + 2), label, font=font, fill=DARK)
        made.paste(picture.resize(SHEET, Image.Resampling.LANCZOS), (x, y + LABEL))
    return made


def randomized_sheet(world: World) -> Image.Image:
    """Twenty randomised scenes as the head camera sees them."""
    cells = []
    for task in RANDOMIZED.split(","):
        scene = build_scene(task, 4, SEED, mode="randomized")
        picture = Image.fromarray(first_frame(world, scene))
        cells.append((task.replace("_", " "), picture))
    return tiled(cells, 5)


def main(folder: Path) -> None:
    """Write all films into `folder`."""
    world = SapienWorld(render=True, limits=DEMONSTRATION_LIMITS)
    films = {robot: robot_frames(world, robot) for robot in ROBOTS}
    for robot, frames in films.items():
        (folder / f"{robot}.webp").write_bytes(encode(frames, ROBOT_BYTES))
    stills = [(robot, frames[0]) for robot, frames in films.items()]
    stills += [("", frames[len(frames) // 5]) for frames in films.values()]
    tiled(stills, len(ROBOTS)).save(folder / "robots.jpg", quality=88)
    randomized_sheet(SapienWorld(render=True)).save(folder / "randomized.jpg", quality=88)
    (folder / "trials.webp").write_bytes(tasks_film(studio()))  # last: the studio stays


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/docs_films.py FOLDER")
    main(Path(sys.argv[1]))
