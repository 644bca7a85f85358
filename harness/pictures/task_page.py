"""The page of all tasks, `docs/tasks.md`, written from the catalog and from scenes it draws.

`python -m robospa.harness.pictures.task_page` writes the page and, where this machine draws, the
pictures that are missing; `--all` draws every picture again, `--text` none. Run it from the
repository's root after a task has come or changed; a test compares the page with the catalog.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from itertools import groupby, pairwise
from pathlib import Path

from robospa.harness.world import RenderUnavailable, SceneUnstable
from robospa.tasks.catalog import tasks
from robospa.tasks.task import Task
from robospa.trial import CATEGORY_NAMES

PAGE = Path("docs/tasks.md")
PICTURES = Path("docs/images/tasks")
SEED = 100_000
SHOWN = (1, 5)
"""Levels in a task's picture, side by side."""
SIZE = (192, 144)
"""Size of each of them [px]; rendered at twice that and averaged."""
QUALITY = 78

HEAD = """# Tasks

Written by `python -m robospa.harness.pictures.task_page` from the catalog: do not edit. {bases}
base tasks and {basics} basic ones for reference, each with five levels; the pictures show levels
{first} and {last}. *n* is the number of objects that a guesser could pick or of the kinds of things
to handle, *T* the number of subtasks, *limit* the policy actions that a trial may take: one value
where all levels agree, else one a level or a range. What is on the table and what the seed decides:
`robospa tasks NAME --level 3 --seed 100007` shows a scene in words and as a picture.
Departures from the official tasks are in [fidelity.md](fidelity.md).
"""


def page() -> str:
    """The page's text."""
    found = list(tasks().values())
    basics = sum(task.dimension == "basic" for task in found)
    head = HEAD.format(bases=len(found) - basics, basics=basics, first=SHOWN[0], last=SHOWN[-1])
    parts = [head]
    by_category = sorted(found, key=lambda task: list(CATEGORY_NAMES).index(task.category))
    for category, grouped in groupby(by_category, key=lambda task: task.category):
        members = list(grouped)
        parts.append(f"## {CATEGORY_NAMES[category]} ({category})\n")
        alike = len({task.success for task in members}) == 1
        if alike:
            parts.append(f"Success: {members[0].success.rstrip('.')}.\n")
        parts.append("| | task | levels 1 to 5 |" + ("" if alike else " success |"))
        parts.append("|---|---|---|" + ("" if alike else "---|"))
        parts += [row(task, success=not alike) for task in members]
        parts.append("")
    return "\n".join(parts)


def row(task: Task, success: bool) -> str:
    """The line of one task, with or without what `success` is."""
    levels = [task.levels[k] for k in sorted(task.levels)]
    n, total, limit = (
        per_level([getattr(level, name) for level in levels])
        for name in ("candidates", "subtasks", "steps")
    )
    cells = (
        f"![{task.name}]({PICTURES.relative_to(PAGE.parent).as_posix()}/{picture_name(task)})",
        f"**{task.name}**<br>{task.summary}",
        f"n {n}; T {total}<br>limit {limit}",
        *([task.success[:1].upper() + task.success[1:].rstrip(".")] if success else []),
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def picture_name(task: Task) -> str:
    """File name of a task's picture."""
    return f"{task.name.lower()}.jpg"


def per_level(values: Sequence[int]) -> str:
    """The values of all levels: "150" if they agree, "1 to 5" if they count up, else each."""
    if len(set(values)) == 1:
        return str(values[0])
    steps = {b - a for a, b in pairwise(values)}
    return f"{values[0]} to {values[-1]}" if steps == {1} else ", ".join(map(str, values))


def draw(chosen: Iterable[Task], folder: Path) -> int:
    """One picture a task, the levels of SHOWN side by side; how many were written."""
    from PIL import Image

    from robospa.harness.pictures.gallery import settled_scene
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.observation import CameraSpec

    folder.mkdir(parents=True, exist_ok=True)
    world = SapienWorld()
    count = 0
    try:
        for task in chosen:
            strip = Image.new("RGB", (SIZE[0] * len(SHOWN), SIZE[1]))
            for i, level in enumerate(SHOWN):
                settled_scene(world, task.name, level, SEED)
                image = world.render(CameraSpec("head", 2 * SIZE[0], 2 * SIZE[1]))
                small = Image.fromarray(image).resize(SIZE, Image.Resampling.BOX)
                strip.paste(small, (i * SIZE[0], 0))
            strip.save(folder / picture_name(task), quality=QUALITY, optimize=True)
            count += 1
    finally:
        world.close()
    return count


def main(arguments: Sequence[str]) -> None:
    """Write the page, then the pictures that were asked for."""
    unknown = set(arguments) - {"--text", "--all"}
    if unknown or not PAGE.parent.is_dir():
        sys.exit(
            "usage, in the repository's root: "
            "python -m robospa.harness.pictures.task_page [--text|--all]"
        )
    PAGE.write_text(page())
    print(f"{PAGE}: {len(tasks())} tasks")
    if "--text" in arguments:
        return
    requested = [
        task
        for task in tasks().values()
        if "--all" in arguments or not (PICTURES / picture_name(task)).exists()
    ]
    try:
        print(f"{PICTURES}: {draw(requested, PICTURES)} pictures")
    except (RenderUnavailable, SceneUnstable) as error:
        sys.exit(f"no pictures: {error}")


if __name__ == "__main__":
    main(sys.argv[1:])
