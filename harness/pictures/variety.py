"""Pictures of what can vary besides the task: the robots, and randomised scenes.

`python -m robospa.harness.pictures.variety FOLDER` writes FOLDER/robots.jpg, every robot at its
start and in the middle of a grasp, FOLDER/robot.jpg, one of them at three tasks, and
FOLDER/randomized.jpg, twenty scenes of as many tasks. Needs a device that draws.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.harness.pictures.gallery import CELL, TRIES, save_jpeg
from robospa.harness.world import SceneUnstable, World
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.scene import Scene
from robospa.trial import REFERENCE

if TYPE_CHECKING:
    from PIL import Image

ROBOTS = (REFERENCE, "franka-panda", "ur5-wsg", "piper", "ARX-X5")
"""The robots of the paper."""
SHOWN = ("Basic_Color_Blocks", 2, 100003)
"""Task, level and seed in which robots are shown."""
AT_WORK = (
    ("Stack_Blocks_Color_Order", 4, 100002, 3),
    ("Click_Can_Place_Items", 3, 100000, 2),
    ("Pick_Mixed_Objects_Distance_B", 5, 100000, 1),
)
"""Task, level, seed and, counted, the grasp in which one robot is shown."""
TABLE, WIDE, HIGH = (64, 240, 1216, 960), 480, 300
"""The part of the third camera's picture with arms and table, and its size on the page [px]."""
CUT = (0.12, 0.0, 0.88, 0.76)
"""Left, top, right and bottom of the part of the third camera's picture that shows the arms."""
COLUMNS, ROWS = 5, 4
GAP, TITLE = 6, 22  # [px]
HELD = 0.5
"""A gripper value below which something is held."""


def at_work(world: World, scene: Scene, grasp: int = 1) -> None:
    """Let the expert go on until it has closed a gripper for so many times, and lifts."""
    from robospa.harness.skills.expert import Expert

    expert, grasps, holding = Expert(scene, world.snapshot()), 0, False
    while not expert.finished:
        for action in expert.next(world.snapshot()):
            held = min(world.snapshot().gripper) < HELD
            world.step(action, "joint", lambda snapshot: False)
            now = held and min(world.snapshot().gripper) < HELD
            grasps, holding = grasps + (now and not holding), now
            if grasps == grasp:
                return


def three_tasks(world: World) -> Image.Image:
    """The usual robot at the tasks of AT_WORK, side by side."""
    from PIL import Image

    pictures = []
    for task, level, seed, grasp in AT_WORK:
        scene = build_scene(task, level, seed)
        world.load(scene)
        at_work(world, scene, grasp)
        picture = Image.fromarray(world.render(CameraSpec("third", 4 * CELL[0], 4 * CELL[1])))
        pictures.append(picture.crop(TABLE).resize((WIDE, HIGH), Image.Resampling.BOX))
    page = Image.new("RGB", (3 * WIDE + 2 * GAP, HIGH), "white")
    for i, picture in enumerate(pictures):
        page.paste(picture, (i * (WIDE + GAP), 0))
    return page


def robot(world: World, name: str) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """A robot at its start and at work, uint8 RGB, cut from the third camera's pictures."""
    task, level, seed = SHOWN
    scene = build_scene(task, level, seed, name)
    world.load(scene)
    camera = CameraSpec("third", 4 * CELL[0], 4 * CELL[1])
    start = _cut(world.render(camera))
    at_work(world, scene)
    return start, _cut(world.render(camera))


def _cut(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    left, top, right, bottom = CUT
    return image[int(top * height) : int(bottom * height), int(left * width) : int(right * width)]


def randomized(world: World, name: str, seed: int) -> NDArray[np.uint8]:
    """The head's picture of a randomised scene of the task's highest level."""
    level = max(tasks()[name].levels)
    for attempt in range(seed, seed + TRIES):
        try:
            world.load(build_scene(name, level, attempt, mode="randomized"))
        except (SceneUnstable, LayoutError):
            continue
        return world.render(CameraSpec("head", *CELL))
    raise SceneUnstable(f"{name}: no randomised scene of seeds {seed}..{attempt} comes to rest")


def sheet(columns: int, cells: Sequence[tuple[str, NDArray[np.uint8]]]) -> Image.Image:
    """Pictures in a grid, scaled to CELL, each with its title above it."""
    from PIL import Image, ImageDraw, ImageFont

    wide, high = CELL[0] + GAP, CELL[1] + GAP + TITLE
    rows = -(-len(cells) // columns)
    page = Image.new("RGB", (columns * wide + GAP, rows * high + GAP), "white")
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(14)
    for i, (title, image) in enumerate(cells):
        x, y = GAP + i % columns * wide, GAP + i // columns * high
        draw.text((x, y + TITLE - 4), title, "#20262e", font=font, anchor="ls")
        page.paste(Image.fromarray(image).resize(CELL, Image.Resampling.BOX), (x, y + TITLE))
    return page


def write(folder: Path) -> list[Path]:
    """Write both sheets into `folder`; their paths."""
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=True)
    pairs = [(name, robot(world, name)) for name in ROBOTS]
    robots = [(name, pair[0]) for name, pair in pairs] + [("", pair[1]) for _, pair in pairs]
    names = list(tasks())
    chosen = names[:: len(names) // (COLUMNS * ROWS)][: COLUMNS * ROWS]
    scenes = [
        (n.replace("_", " "), randomized(world, n, 100_000 + i)) for i, n in enumerate(chosen)
    ]
    written = [folder / "robots.jpg", folder / "randomized.jpg", folder / "robot.jpg"]
    save_jpeg(sheet(len(ROBOTS), robots), written[0], 400_000)
    save_jpeg(sheet(COLUMNS, scenes), written[1], 500_000)
    save_jpeg(three_tasks(world), written[2], 120_000)
    world.close()
    return written


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m robospa.harness.pictures.variety FOLDER")
    for path in write(Path(sys.argv[1])):
        print(path)
