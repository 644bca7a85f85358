"""Which pieces of each task are official under `--world official`: the table of
docs/official-world.md, made of the code.

    python tools/official_table.py          writes it into the page

A test holds the page against it, and the rules below against docs/fidelity.md and the goals.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from robospa.geometry import Pose
from robospa.harness.official.slots import official_values
from robospa.harness.official.switches import SWITCHES, Switch
from robospa.tasks import catalog, objects, plan
from robospa.tasks.goals.arranging import Layer, Nested, Pair
from robospa.tasks.goals.conditions import Inside, Rests
from robospa.tasks.goals.counters import PressCounter
from robospa.tasks.goals.pick import Lift, PickTracker
from robospa.tasks.official import needs, official_assets, official_models
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import ObjectModel

PAGE = Path(__file__).resolve().parents[1] / "docs" / "official-world.md"
HEAD = (
    "task", "objects of the archive", "built in", "by likeness", "rule", "switches", "filled with",
)  # fmt: skip
NONE = "–"
SEED = 100_000
SEEDS = 2
"""Scenes of each level that are looked at for what lies in them; at one of them for the rest."""


@dataclass(frozen=True)
class Rule:
    """A test of success that is not quite the official one: `rows` begin its lines of
    docs/fidelity.md. `applies` tells by a part of a goal; the other tasks are named, or matched."""

    name: str
    rows: tuple[str, ...]
    tasks: tuple[str, ...] = ()
    applies: Callable[[object], bool] | None = None

    def holds(self, task: str, parts: Sequence[object]) -> bool:
        """Whether it is about `task`, whose goals have these `parts`."""
        named = any(fnmatch(task, pattern) for pattern in self.tasks)
        return named or (self.applies is not None and any(map(self.applies, parts)))


def _is_a(*kinds: type) -> Callable[[object], bool]:
    return lambda part: isinstance(part, kinds)


RULES = (
    Rule(
        "carried",
        ("| all | the target counts as lifted", "| Pick_Blocks_Height | the tallest block needs"),
        applies=_is_a(PickTracker),
    ),
    Rule(
        "near-arm",
        ("| Pick_*_Relational, Pick_*_Multi_View | closed gripper of the arm",),
        applies=lambda part: isinstance(part, Lift) and part.closed,
    ),
    Rule(
        "itself",
        ("| Pick_Seals_Multi_View, Pick_Breads_Multi_View, Pick_Sauce_Can_Multi_View | touching",),
        ("Pick_Seals_Multi_View", "Pick_Breads_Multi_View", "Pick_Sauce_Can_Multi_View"),
    ),
    Rule(
        "re-arm",
        ("| clicks and presses |", "| Stamp_Seals_Press_Stapler | a stamp re-arms"),
        applies=_is_a(PressCounter),
    ),
    Rule(
        "let-go",
        ("| placing |",),
        applies=lambda part: (
            isinstance(part, Nested | Pair | Layer)
            or (isinstance(part, Rests) and part.held_radius > 0)
        ),
    ),
    Rule(
        "low",
        (
            "| height when placed |",
            "| Stamp_Seals_Order | carried over the pads at any height |",
            "| Observe_Blocks_Move_Memory | a block below the strip",
        ),
        (
            "Rank_Blocks_*", "Stack_Blocks_*", "Hang_Mug_Stack_Blocks", "Place_Object_Scale_Click",
            "Place_Burger_Fries_Click_Bell", "Click_Can_Place_Items", "Stamp_Seals_Order",
            "Observe_Blocks_Move_Memory",
        ),
    ),
    Rule("in-bin", ("| thrown into a bin |",), applies=_is_a(Inside)),
    Rule(
        "on-table",
        ("| Move_Blocks_Apart, Move_Playing_Cards_Away, Separate_Fries_Bread | what was pushed",),
        ("Move_Blocks_Apart", "Move_Playing_Cards_Away", "Separate_Fries_Bread"),
    ),
    Rule(
        "one-rule",
        (
            "| Stack_Blocks_* | levels check heights only",
            "| Place_Bowls_Plates | least height between bowls",
            "| Place_Burger_Fries_Click_Bell | returned:",
        ),
        ("Stack_Blocks_*", "Place_Bowls_Plates", "Place_Burger_Fries_Click_Bell"),
    ),
    Rule(
        "thin-layers",
        ("| Stack_Blocks_Size_Order | height tolerance 2 cm",),
        ("Stack_Blocks_Size_Order",),
    ),
    Rule(
        "handle-on-peg",
        ("| Hang_Mug_Stack_Blocks | functional points of mug and rack |",),
        ("Hang_Mug_Stack_Blocks",),
    ),
    Rule(
        "mended",
        (
            "| Lift_Pot_Repeat | lift and put-down bands may overlap",
            "| Click_Bell_Clockwise_Order | progress update cannot run",
        ),
        ("Lift_Pot_Repeat", "Click_Bell_Clockwise_Order"),
    ),
)  # fmt: skip
"""Where success is not tested quite as officially, beyond what holds of all tasks."""


@dataclass(frozen=True)
class Pieces:
    """A row: assets, frames with the assets that have them, names of rules and switches. `filled`
    says what the official sentences' placeholders are filled with."""

    archive: tuple[str, ...]
    built_in: tuple[str, ...]
    by_likeness: Mapping[str, tuple[str, ...]]
    rules: tuple[str, ...]
    switches: tuple[str, ...]
    filled: str

    def cells(self) -> tuple[str, ...]:
        """The row's cells after the task's name."""
        return (
            *map(_listed, (self.archive, self.built_in)),
            "; ".join(f"{at}: {_listed(assets)}" for at, assets in self.by_likeness.items())
            or NONE,
            *map(_listed, (self.rules, self.switches)),
            self.filled,
        )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or NONE


def pieces(task: str) -> Pieces:
    """What of `task` is official, found in its scenes, goals and plans."""
    held: set[str] = set()
    frames: set[tuple[str, str]] = set()
    parts: list[object] = []
    values: list[object] = []
    switches: set[str] = set()
    for level in catalog.LEVELS:
        scenes = [catalog.build_scene(task, level, SEED + k) for k in range(SEEDS)]
        held |= {item.asset for scene in scenes for item in scene.objects}
        switches |= {s.name for s in SWITCHES for scene in scenes if _changes(s, scene)}
        found, used = goal_and_frames(scenes[0])
        parts += found
        frames |= used
        values += official_values(scenes[0]).values()
    official = {*official_assets()}
    at = {pair for pair in frames if _at_point(*pair)}
    others = {(asset, frame) for asset, frame in frames - at if asset in official}
    things = any(isinstance(value, SceneObject) for value in values)
    return Pieces(
        archive=tuple(sorted({*needs()[task]} | held & official)),
        built_in=tuple(sorted(held - official)),
        by_likeness=_by_frame(others),
        rules=tuple(rule.name for rule in RULES if rule.holds(task, parts)),
        switches=tuple(switch.name for switch in SWITCHES if switch.name in switches),
        filled="things" if things else "words" if values else "nothing",
    )


def _changes(switch: Switch, scene: Scene) -> bool:
    """Whether the switch is about the scene's task; of one about all, whether it changes it."""
    return scene.task in switch.tasks or (not switch.tasks and switch.change(scene, 0) != scene)


def _by_frame(pairs: set[tuple[str, str]]) -> Mapping[str, tuple[str, ...]]:
    """The assets of each frame, sorted."""
    frames = sorted({frame for _, frame in pairs})
    return {name: tuple(sorted(a for a, frame in pairs if frame == name)) for name in frames}


def _at_point(asset: str, frame: str) -> bool:
    return any(frame in model.points for model in official_models(asset))


def goal_and_frames(scene: Scene) -> tuple[list[object], set[tuple[str, str]]]:
    """All parts of the scene's goal, and the frames (asset, name) that goal and expert take."""
    task = catalog.task(scene.task)
    with _noted() as frames:
        goal = task.goal(scene)
        calls = task.plan(scene)
    assets = {item.name: item.asset for item in scene.objects}
    frames |= {(assets[name], frame) for call in calls for name, frame in _of_call(call)}
    return list(_inside(goal, set())), frames


def _of_call(call: plan.Skill) -> list[tuple[str, str]]:
    """The frames that a skill takes, by the objects' names (see robospa/harness/skills)."""
    match call:
        case plan.Press(name, frame):
            return [(name, frame)]
        case plan.Place(on=str(name)) | plan.Stamp(on=name):
            return [(name, "support")]
        case plan.Dock(on=name, frame=frame):
            return [(name, frame)]
        case plan.Hang(name, on, frame, handle):
            return [(on, frame), (name, handle)]
        case plan.Open(name):
            return [(name, "handle")]
        case plan.Hit(tool, targets):
            return [(tool, "head"), *((name, "press") for name in targets)]
        case plan.RaiseLower(name, arms=arms) if len(arms) > 1:
            return [(name, arm) for arm in arms]
    return []


class _Frames(dict[str, Pose]):
    """Frames of an asset that note which of them are asked for."""

    def __init__(self, frames: Mapping[str, Pose], asset: str, found: set[tuple[str, str]]) -> None:
        super().__init__(frames)
        self._asset, self._found = asset, found

    def __getitem__(self, name: str) -> Pose:
        self._found.add((self._asset, name))
        return super().__getitem__(name)


@contextmanager
def _noted() -> Iterator[set[tuple[str, str]]]:
    """Notes which frames of objects are asked for meanwhile."""
    found: set[tuple[str, str]] = set()
    build = objects._build

    def noting(name: str, text: str) -> ObjectModel:
        model = build(name, text)
        return replace(model, frames=_Frames(model.frames, name, found))

    objects._build = noting  # type: ignore[assignment]
    try:
        yield found
    finally:
        objects._build = build


def _inside(thing: Any, seen: set[int]) -> Iterator[object]:
    """`thing` and all that it is made of."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    yield thing
    if isinstance(thing, Mapping):
        within: list[Any] = list(thing.values())
    elif isinstance(thing, list | tuple | set):
        within = list(thing)
    else:
        within = list(getattr(thing, "__dict__", {}).values())
    for one in within:
        yield from _inside(one, seen)


def table() -> str:
    """The table as Markdown."""
    rows = [HEAD, ("---",) * len(HEAD)]
    rows += [(task, *pieces(task).cells()) for task in needs()]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def written(text: str, new: str) -> str:
    """The page's `text` with the table `new` in the place of the one that it has."""
    return re.sub(rf"^\| {HEAD[0]} \| {HEAD[1]} .*\n(\|.*\n)+", lambda _: new, text, flags=re.M)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text("utf-8"), table()), "utf-8")
