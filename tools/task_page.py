"""The page of all tasks, `docs/tasks.md`, written from the catalog and from scenes it draws.

`python tools/task_page.py` writes the page and, where this machine draws, the
pictures that are missing; `--all` draws every picture again, `--text` none. Run it from the
repository's root after a task has come or changed; a test compares the page with the catalog.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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

FLOORS = Path("benchmarks/results/floors.csv")
"""What `tools/task_rates.py --csv` wrote of the expert and of policies that read no sentence."""
EXPERT = "expert"
COUNT = "trials"

HEAD = """<!-- Written by `python tools/task_page.py`: do not edit. -->
# Tasks

{bases} base tasks and {basics} basic ones, each at five levels; the pictures show levels {first}
and {last}, and `robospa tasks NAME --level 3 --seed 100007` any other scene.

| | |
|---|---|
| n | objects that a guesser could pick, or kinds of things to handle |
| T | subtasks; 1 in spatial and basic tasks |
| limit | actions that a trial may take; 150 in spatial and basic tasks |
| `a to b` | levels 1 to 5 in equal steps |
| 100/17 | SR/SR@1 in percent, of procedures SR/SR@1/PS |

The columns are [policies that read no sentence](policies.md#floors) at levels 1, 3 and 5, and
[the learned reference](learned.md) ({extents}); *doing nothing* is its PS. The expert has 100
everywhere{but}. Where a policy that reads no sentence has 100, [the official rule asks for
none](fidelity.md#what-the-official-rule-allows).
"""

Rates = Mapping[str, Mapping[str, str]]
"""By task and policy "SR/SR@1" or "SR/SR@1/PS" in percent."""


def page(root: Path = Path()) -> str:
    """The page's text, with the figures that lie below `root`."""
    found = list(tasks().values())
    basics = sum(task.dimension == "basic" for task in found)
    rates, trials = floors(root / FLOORS)
    extents = ", ".join(f"{name} {count} trials" for name, count in trials.items())
    poor = [name for name, by in rates.items() if set(by.get(EXPERT, "100").split("/")) != {"100"}]
    head = HEAD.format(
        bases=len(found) - basics, basics=basics, first=SHOWN[0], last=SHOWN[-1],
        extents=extents, but=f" but in {', '.join(poor)}" if poor else "",
    )  # fmt: skip
    parts = [head]
    by_category = sorted(found, key=lambda task: list(CATEGORY_NAMES).index(task.category))
    for category, grouped in groupby(by_category, key=lambda task: task.category):
        parts.append(f"## {CATEGORY_NAMES[category]} ({category})\n")
        parts += [*table(list(grouped), rates), ""]
    return "\n".join(parts)


def floors(path: Path) -> tuple[Rates, Mapping[str, str]]:
    """Rates by task and policy, and how many trials of a task every policy has."""
    rates: dict[str, dict[str, str]] = {}
    counts: dict[str, set[int]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            task, policy, text = row["row"], row["group"], row["text"]
            if not text:
                continue
            if row["column"] == COUNT:
                counts.setdefault(policy, set()).add(int(text))
                continue
            before = rates.setdefault(task, {}).get(policy)
            rates[task][policy] = text if before is None else f"{before}/{text}"
    spans = {name: sorted({min(n), max(n)}) for name, n in counts.items() if name != EXPERT}
    return rates, {name: " to ".join(map(str, span)) for name, span in spans.items()}


def table(members: Sequence[Task], rates: Rates) -> list[str]:
    """The lines of a category: a row a task, what success is, and the rates of policies."""
    (most, count), *_ = Counter(task.success for task in members).most_common(1)
    shared = count >= len(members) - 1
    lines = []
    if shared:
        others = [f"{task.name}: {task.success}" for task in members if task.success != most]
        sentences = [text.rstrip(".") + "." for text in (f"Success: {most}", *others)]
        lines.append(" ".join(sentences) + "\n")
    named = dict.fromkeys(policy for by in rates.values() for policy in by if policy != EXPERT)
    columns = [p for p in named if any(p in rates.get(task.name, {}) for task in members)]
    heads = ["task", "levels 1 to 5", *([] if shared else ["success"]), *columns]
    lines += [f"| | {' | '.join(heads)} |", "|---" * (1 + len(heads)) + "|"]
    return lines + [row(task, not shared, rates.get(task.name, {}), columns) for task in members]


def row(task: Task, success: bool, rates: Mapping[str, str], policies: Sequence[str]) -> str:
    """The line of one task, with or without what `success` is, and its rates."""
    levels = [task.levels[k] for k in sorted(task.levels)]
    n, total, limit = (
        per_level([getattr(level, name) for level in levels])
        for name in ("candidates", "subtasks", "steps")
    )
    things = f"n, T {n}" if n == total else f"n {n}; T {total}"
    cells = (
        f"![{task.name}]({PICTURES.relative_to(PAGE.parent).as_posix()}/{picture_name(task)})",
        f"**{task.name}**<br>{task.summary}",
        f"{things}<br>limit {limit}" if task.dimension == "procedural" else f"n {n}",
        *([task.success[:1].upper() + task.success[1:].rstrip(".")] if success else []),
        *(rates.get(policy, "-") for policy in policies),
    )
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def picture_name(task: Task) -> str:
    """File name of a task's picture."""
    return f"{task.name.lower()}.jpg"


def per_level(values: Sequence[int]) -> str:
    """The values of all levels: "150" if they agree, "1 to 5" in equal steps, else each."""
    if len(set(values)) == 1:
        return str(values[0])
    even = len({b - a for a, b in pairwise(values)}) == 1
    return f"{values[0]} to {values[-1]}" if even else ", ".join(map(str, values))


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
        sys.exit("usage, in the repository's root: python tools/task_page.py [--text|--all]")
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
