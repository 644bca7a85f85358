"""The list of tasks, and the one way to build a scene."""

import hashlib
import importlib
from functools import cache
from importlib import metadata

import numpy as np

from robospa.registry import TASKS, load
from robospa.tasks.modes import canonical
from robospa.tasks.modes import mode as scene_mode
from robospa.tasks.scene import SCENES, Scene
from robospa.tasks.task import Task
from robospa.trial import REFERENCE
from robospa.workcell import WORKCELL

DEFINED = (
    "block_measures.TASKS",
    "distance.TASKS",
    "canonical_index.TASKS",
    "relational.TASKS",
    "cross_view.TASKS",
    "repeat.PRESS_STAPLER",
    "repeat.LIFT",
    "repeat.CLICK_BELL",
    "dustbin.BOTTLES",
    "move_apart.BLOCKS",
    "move_apart.CARDS",
    "towers.BOWLS",
    "move_apart.FOOD",
    "rank_blocks.TASKS",
    "in_order.HAMMER",
    "in_order.OBJECTS",
    "in_order.SEAL",
    "in_order.BELLS",
    "towers.COLOR",
    "towers.SIZE",
    "towers.LENGTH",
    "chain_first.PHONE",
    "dustbin.CUPS",
    "chain_first.MUG",
    "chain_back.SCALE",
    "chain_back.TRAY",
    "chain_clicks.CAN",
    "chain_first.SEALS",
    "chain_clicks.MICROWAVE",
    "memory.BLOCKS",
    "memory.OBJECTS",
    "memory.COVER",
    "memory.ORIENTATION",
    "memory.COUNTS",
)
"""Tasks in the paper's order: a module of `robospa.tasks.families` and its Task, or a tuple of
several that differ in data alone."""

BASIC = ("basic_color.TASKS", "cross_view.BASIC", "canonical_index.BASIC")
"""The appendix's basic grounding tasks, outside the 280 variants."""

LEVELS = (1, 2, 3, 4, 5)


@cache
def tasks() -> dict[str, Task]:
    """All tasks by name, in the paper's order, the basic ones last; no extensions."""
    return {t.name: t for where in (*DEFINED, *BASIC) for t in _defined(where)}


@cache
def extensions() -> dict[str, Task]:
    """Tasks of other installed packages.

    They are found by name only: what is installed never changes what "all tasks" means. ValueError
    for an entry point that leads to no task, or to one with a name of the benchmark's; UnknownName
    for one that cannot be loaded.
    """
    found = {}
    for point in metadata.entry_points(group=TASKS):
        item = load(point.value)
        if not isinstance(item, Task) or item.name in tasks():
            raise ValueError(
                f"entry point {point.name!r} ({point.value}) offers no new task; "
                "it has to name a Task with a name of its own"
            )
        found[item.name] = item
    return found


def offer(task: Task) -> None:
    """Let `task` be found by its name in this process, as an entry point does in every process.

    ValueError if the benchmark has a task of that name.
    """
    if task.name in tasks():
        raise ValueError(f"the benchmark has a task {task.name}; give yours another name")
    extensions()[task.name] = task


@cache
def _defined(where: str) -> tuple[Task, ...]:
    module, _, name = where.rpartition(".")
    found = getattr(importlib.import_module(f"robospa.tasks.families.{module}"), name)
    return found if isinstance(found, tuple) else (found,)


@cache
def home_of(name: str) -> str:
    """The module that defines the task called `name`, "" if there is none."""
    for where in (*DEFINED, *BASIC):
        if any(found.name == name for found in _defined(where)):
            return f"robospa.tasks.families.{where.rpartition('.')[0]}"
    for point in metadata.entry_points(group=TASKS):
        if getattr(load(point.value), "name", "") == name:
            return point.value.partition(":")[0]
    return ""


def task(name: str) -> Task:
    """The task called `name` (case and underscores do not matter); KeyError with near matches."""
    import difflib

    if name in tasks():
        return tasks()[name]

    def plain(text: str) -> str:
        return text.lower().replace("_", "").replace(" ", "").replace("-", "")

    known = {plain(n): t for n, t in tasks().items()}
    if plain(name) not in known:
        known |= {plain(n): t for n, t in extensions().items()}
    if plain(name) in known:
        return known[plain(name)]
    near = difflib.get_close_matches(plain(name), list(known), n=3, cutoff=0.5)
    hint = f"did you mean {', '.join(known[n].name for n in near)}?" if near else ""
    raise KeyError(f"no task {name!r}; {hint or 'see `robospa tasks` for all of them'}")


def build_scene(
    name: str,
    level: int,
    seed: int,
    embodiment: str = REFERENCE,
    mode: str = "clean",
    salt: str = "",
) -> Scene:
    """The scene of one trial: a pure function of its arguments.

        scene = robospa.build_scene("Pick_Blocks_Size", level=1, seed=100000)
        [(item.name, item.pose.position) for item in scene.objects]

    The task's objects are drawn by one generator seeded by (stream, task, level, seed), for one
    workcell: every robot and every mode gets the same ones. What the
    mode varies has generators of its own, seeded by the part's name too. A salt enters all of
    these seeds and stands nowhere in the scene: who does not have it cannot draw the scene.

    Args:
        name: Name of the task.
        level: 1 to 5.
        seed: A whole number; the benchmark's begin at 100000.
        embodiment: Name of the robot; written into the scene, it changes nothing else.
        mode: Name of the scene mode, such as "clean" or "randomized:light,clutter".
        salt: Secret of a hidden scene; empty for the benchmark's public ones.

    Raises:
        KeyError: There is no such task.
        ValueError: There is no such level or mode.
        LayoutError: The seed has no valid scene.
    """
    found = task(name)
    if level not in found.levels:
        raise ValueError(f"{found.name} has levels {sorted(found.levels)}, not {level}")
    vary = scene_mode(mode)
    identity = "/".join([SCENES, *([salt] if salt else []), found.name, str(level), str(seed)])
    draft = found.draw(level, generator(identity), WORKCELL)
    if len({item.name for item in draft.objects}) < len(draft.objects):
        raise ValueError(f"{found.name} level {level} seed {seed} has two objects of one name")
    scene = Scene(
        task=found.name,
        level=level,
        seed=seed,
        embodiment=embodiment,
        mode=canonical(mode),
        objects=draft.objects,
        facts=draft.facts.to_json(),
        table_shift=draft.table_shift,
    )
    return vary(scene, lambda part: generator(f"{identity}/{part}"))


def generator(text: str) -> np.random.Generator:
    """A generator seeded by `text`."""
    entropy = int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "big")
    return np.random.Generator(np.random.PCG64(entropy))
