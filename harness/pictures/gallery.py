"""Pictures of scenes: one first frame, and the contact sheet of all variants.

A contact sheet has a row a task and a column a level; below every picture stands the instruction
of that very scene. Text is drawn by Pillow with its built-in font, so no system font is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.harness.world import SceneUnstable, World
from robospa.observation import CameraSpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene
from robospa.tasks.task import Task

if TYPE_CHECKING:
    from PIL import Image, ImageFont

CELL = (320, 240)
"""Size of a picture on the sheet [px]; it is rendered at twice that and averaged."""
GAP, MARGIN, HEADER, TITLE, CAPTION = 10, 24, 34, 64, 66  # [px]
TEXT, CAPTION_SIZE, LINES = "#20262e", 12, 4
PAPER, QUIET = "#ffffff", "#68727f"
LEAST, SHARE = 1_000_000, 75_000
"""Most bytes of a sheet: so many, or so many for each task; a README's picture stays below 1 MB."""
Build = Callable[[str, int, int], Scene]
"""Makes the scene of a task, level and seed."""
TRIES = 20
"""Seeds that `settled_scene` tries."""


@dataclass(frozen=True)
class Cell:
    """One variant: its level, its instruction and its picture (uint8 RGB)."""

    level: int
    instruction: str
    image: NDArray[np.uint8]


@dataclass(frozen=True)
class GalleryRow:
    """One task and its levels."""

    title: str
    note: str
    cells: tuple[Cell, ...]


def first_frame(
    world: World, scene: Scene, camera: str = "head", size: tuple[int, int] = CELL
) -> NDArray[np.uint8]:
    """The settled scene as `camera` sees it: RGB, uint8 (height, width, 3). Raises SceneUnstable or
    RenderUnavailable."""
    world.load(scene)
    return world.render(CameraSpec(camera, *size))


def settled_scene(
    world: World, name: str, level: int, seed: int, build: Build = build_scene
) -> Scene:
    """The first scene from `seed` up that comes to rest, loaded; SceneUnstable after 20 seeds."""
    for attempt in range(seed, seed + TRIES):
        scene = build(name, level, attempt)
        try:
            world.load(scene)
        except SceneUnstable:
            continue
        return scene
    raise SceneUnstable(f"{name} level {level}: none of the seeds {seed}..{attempt} comes to rest")


def task_row(
    world: World,
    task: Task,
    seed: int,
    sentence: Callable[[Scene], str],
    build: Build = build_scene,
) -> GalleryRow:
    """The row of `task`: one settled scene a level, which `build` makes of the task's name, level
    and seed, seen by the head camera."""
    cells = []
    for level in sorted(task.levels):
        scene = settled_scene(world, task.name, level, seed, build)
        image = world.render(CameraSpec("head", 2 * CELL[0], 2 * CELL[1]))
        cells.append(Cell(level, sentence(scene), image))
    return GalleryRow(
        task.name.replace("_", " "), f"{task.category} · {task.summary}", tuple(cells)
    )


def sheet(rows: Sequence[GalleryRow], title: str) -> Image.Image:
    """The contact sheet as a Pillow image; every row is as wide as the longest one."""
    from PIL import Image, ImageDraw

    columns = max(len(row.cells) for row in rows)
    row_height = HEADER + CELL[1] + CAPTION + GAP
    width = 2 * MARGIN + columns * CELL[0] + (columns - 1) * GAP
    page = Image.new("RGB", (width, TITLE + len(rows) * row_height + MARGIN), PAPER)
    draw = ImageDraw.Draw(page)
    draw.text((MARGIN, TITLE // 2), title, TEXT, font=_font(26), anchor="lm")
    for i, row in enumerate(rows):
        top = TITLE + i * row_height
        base = top + HEADER - 9
        draw.text((MARGIN, base), row.title, TEXT, font=_font(19), anchor="ls")
        left = MARGIN + draw.textlength(row.title, _font(19)) + 12
        draw.text((left, base), row.note, QUIET, font=_font(14), anchor="ls")
        for j, cell in enumerate(row.cells):
            _paste(page, cell, MARGIN + j * (CELL[0] + GAP), top + HEADER)
    return page


def _paste(page: Image.Image, cell: Cell, left: int, top: int) -> None:
    from PIL import Image, ImageDraw

    page.paste(Image.fromarray(cell.image).resize(CELL, Image.Resampling.BOX), (left, top))
    draw = ImageDraw.Draw(page)
    font = _font(CAPTION_SIZE)
    text = f"L{cell.level}  {cell.instruction}"
    lines = wrapped(text, CELL[0], lambda line: draw.textlength(line, font))
    for k, line in enumerate(lines):
        draw.text((left, top + CELL[1] + 4 + 15 * k), line, TEXT, font=font)


def wrapped(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """`text` in at most LINES lines no wider than `width`; what is cut off becomes an ellipsis."""
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if lines[-1] and measure(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    if len(lines) <= LINES:
        return lines
    last = lines[LINES - 1]
    while " " in last and measure(last + " …") > width:
        last = last.rpartition(" ")[0]
    return [*lines[: LINES - 1], last + " …"]


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def save_png(image: NDArray[np.uint8], path: Path) -> None:
    """Write one RGB image; folders are made."""
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path, format="PNG", optimize=True)


def save_jpeg(
    page: Image.Image,
    path: Path,
    limit: int = LEAST,
    qualities: Iterable[int] = (90, 85, 80, 75, 70, 60, 50),
) -> int:
    """Write `page` at the best quality that stays below `limit` bytes; returns the size [bytes].
    ValueError, with nothing written, if even the lowest quality is larger."""
    data = b""
    for quality in qualities:
        buffer = BytesIO()
        page.save(buffer, format="JPEG", quality=quality, optimize=True, progressive=True)
        data = buffer.getvalue()
        if len(data) < limit:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            return len(data)
    raise ValueError(f"{path} would take {len(data)} bytes, more than {limit}; show fewer tasks")
