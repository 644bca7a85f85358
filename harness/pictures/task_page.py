"""The page of all tasks, `docs/tasks.md`, written from the catalog and from scenes it draws.

`python -m robospa.harness.pictures.task_page` writes the page and, where this machine draws, the
pictures that are missing; `--all` draws every picture again, `--text` none. Run it from the
repository's root after a task has come or changed; a test compares the page with the catalog. What
a row says of the levels is read off the scenes of a few seeds, never written by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby, pairwise
from pathlib import Path

from robospa.categories import CATEGORY_NAMES
from robospa.harness.world import RenderUnavailable, SceneUnstable
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import Task

PAGE = Path("docs/tasks.md")
PICTURES = Path("docs/images/tasks")
SEEDS = range(100_000, 100_004)
"""Scenes that a row is read off, per level."""
SHOWN = (1, 5)
"""Levels in a task's picture, side by side."""
SIZE = (192, 144)
"""Size of each of them [px]; rendered at twice that and averaged."""
QUALITY = 78
FLAT, HUGE = 0.002, 0.1
"""Half sizes [m] of a box that is a pad, or a wall."""
MANY = 7
"""More kinds of things than this are "various things"."""

HEAD = """# Tasks

Written by `python -m robospa.harness.pictures.task_page` from the catalog: do not edit. {bases}
base tasks and {basics} basic ones for reference, each with five levels; the pictures show levels
{first} and {last}. *n* is the number of objects that a guesser could pick or of the kinds of things
to handle, *T* the number of subtasks, *limit* the policy actions that a trial may take: one value
where all levels agree, else one a level or a range. *Drawn* is what the seed decides beside places
and looks. One scene in words and as a picture: `robospa tasks NAME --level 3 --seed 100007`.
Departures from the official tasks are in [fidelity.md](fidelity.md).
"""


def page() -> str:
    """The page's text."""
    found = list(tasks().values())
    basics = sum(task.dimension == "basic" for task in found)
    head = HEAD.format(bases=len(found) - basics, basics=basics, first=SHOWN[0], last=SHOWN[-1])
    parts = [head]
    by_category = sorted(found, key=lambda task: list(CATEGORY_NAMES).index(task.category))
    for category, members in groupby(by_category, key=lambda task: task.category):
        parts.append(f"## {CATEGORY_NAMES[category]} ({category})\n")
        parts.append("| | task | levels 1 to 5 | success |\n|---|---|---|---|")
        parts += [row(task) for task in members]
        parts.append("")
    return "\n".join(parts)


def row(task: Task) -> str:
    """The line of one task."""
    scenes = {
        level: [build_scene(task.name, level, seed) for seed in SEEDS] for level in task.levels
    }
    cells = (
        f"![{task.name}]({PICTURES.relative_to(PAGE.parent).as_posix()}/{picture_name(task)})",
        f"**{task.name}**<br>{task.summary}",
        "<br>".join((*_limits(task), *_varied(scenes))),
        task.success[:1].upper() + task.success[1:].rstrip("."),
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def picture_name(task: Task) -> str:
    """File name of a task's picture."""
    return f"{task.name.lower()}.jpg"


# -- what the levels vary ---------------------------------------------------------------------


def per_level(values: Sequence[int]) -> str:
    """The values of all levels: "150" if they agree, "1 to 5" if they count up, else each."""
    if len(set(values)) == 1:
        return str(values[0])
    steps = {b - a for a, b in pairwise(values)}
    return f"{values[0]} to {values[-1]}" if steps == {1} else ", ".join(map(str, values))


def _limits(task: Task) -> tuple[str, str]:
    levels = [task.levels[k] for k in sorted(task.levels)]
    n, total, limit = (
        per_level([getattr(level, name) for level in levels])
        for name in ("candidates", "subtasks", "steps")
    )
    return f"n {n}; T {total}", f"limit {limit}"


def _varied(scenes: Mapping[int, Sequence[Scene]]) -> list[str]:
    """Things on the table, counts that follow from the level, and what is drawn anew."""
    levels = sorted(scenes)
    lines = [_things(scenes)]
    drawn = []
    for key in dict.fromkeys(k for level in levels for s in scenes[level] for k in s.facts):
        there = [level for level in levels if all(key in s.facts for s in scenes[level])]
        values = {level: [s.facts[key] for s in scenes[level]] for level in there}
        if _is_counted(values):
            lines.append(f"{_words(key)}: {per_level([_count(values[k][0]) for k in there])}")
        if any(_is_drawn(scenes[level], key) for level in there):
            drawn.append(_words(key) + _where(there, levels))
    return [*lines, "drawn: " + ", ".join(drawn)] if drawn else lines


def _is_counted(values: Mapping[int, Sequence[object]]) -> bool:
    """True if a fact is a number, or a list, whose size the level alone decides."""
    if not all(isinstance(v, int | list) for level in values.values() for v in level):
        return False
    sizes = [{_count(v) for v in level} for level in values.values()]
    return all(len(size) == 1 for size in sizes) and len(set().union(*sizes)) > 1


def _number(value: object) -> int:
    assert isinstance(value, int)
    return int(value)


def _count(value: object) -> int:
    """Length of a list, or the number itself."""
    return len(value) if isinstance(value, list) else _number(value)


def _is_drawn(scenes: Sequence[Scene], key: str) -> bool:
    """True if the scenes of one level differ in this fact, which names no object and no place."""
    seen_values = set()
    for scene in scenes:
        value = scene.facts[key]
        names = {item.name for item in scene.objects}
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, float | list | dict) or item in names:
                return False
        seen_values.add(str(value))
    return len(seen_values) > 1


def _things(scenes: Mapping[int, Sequence[Scene]]) -> str:
    """Number of objects, and their kinds by level."""
    levels = sorted(scenes)
    counts = {level: sorted({len(s.objects) for s in scenes[level]}) for level in levels}
    exact = all(len(counts[level]) == 1 for level in levels)
    number = (
        per_level([counts[level][0] for level in levels])
        if exact
        else ", ".join("-".join(map(str, dict.fromkeys((c[0], c[-1])))) for c in counts.values())
    )
    core = _core(scenes)
    parts = [name + _where(at, levels) for name, at in core.items()]
    loose = [k for k in levels if any(_kinds(s) - set(core) for s in scenes[k])]
    if loose:
        parts.append("various things" + _where(loose, levels))
    return f"objects {number}: {', '.join(parts)}"


def _kinds(scene: Scene) -> set[str]:
    return {_noun(item) for item in scene.objects}


def _noun(item: SceneObject) -> str:
    """The noun of an object; boxes that are made flat or huge are pads and walls."""
    half = item.params.get("half")
    if half and min(half) < FLAT:
        return "pad"
    if half and max(half) > HUGE:
        return "wall"
    return object_model(item.asset).noun


def _core(scenes: Mapping[int, Sequence[Scene]]) -> dict[str, list[int]]:
    """The kinds of things that a task always has, and at which levels; none if they are many.

    A kind that comes with a level belongs to it if the kinds do not vary up to there; else it may
    be there by chance.
    """
    levels = sorted(scenes)
    always = {k: set.intersection(*(_kinds(s) for s in scenes[k])) for k in levels}
    same = {k: all(_kinds(s) == always[k] for s in scenes[k]) for k in levels}
    core = {}
    for name in sorted(set.union(*always.values())):
        at = [k for k in levels if name in always[k]]
        later = levels[levels.index(at[0]) :]
        if at == levels or (at == later and all(same[k] for k in levels if k <= at[0])):
            core[name] = at
    return core if len(core) <= MANY else {}


def _where(at: Iterable[int], levels: Sequence[int]) -> str:
    """ " (levels 2 to 5)", or nothing where it is all of them."""
    found = sorted(at)
    if found == list(levels):
        return ""
    if found[-1] == levels[-1] and len(found) == found[-1] - found[0] + 1:
        return f" (from level {found[0]})" if len(found) > 1 else f" (level {found[0]})"
    return f" (level{'s' if len(found) > 1 else ''} {', '.join(map(str, found))})"


def _words(key: str) -> str:
    return key.replace("_", " ")


# -- pictures ---------------------------------------------------------------------------------


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
                settled_scene(world, task.name, level, SEEDS[0])
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
