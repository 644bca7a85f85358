"""A small made-up checkout of RoboSPA: the folders and keys of the official one, our own words."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

TEMPLATES: Mapping[tuple[str, int], tuple[Sequence[str], Sequence[str]]] = {
    ("Pick_Blocks_Size", 2): (
        ["take number {A} by bulk", "with {a} take number {A} by bulk", "bring me nothing"],
        ["fetch whatever is {A} by bulk please", "Take  number {A} by bulk"],
    ),
    ("Rank_Blocks_Color", 2): (["line both up by hue"], ["sort this pair by hue, red first"]),
    ("Click_Objects_Order", 2): (
        ["first tap {A}, next tap {B}", "tap {A} by {a}, then {B} by {b}", "tap {A} by {a}, {B}"],
        ["poke {A} and thereafter {B}", "use {a} on {A} and {b} on {B}"],
    ),
    ("Put_Bottles_Dustbin", 1): (["drop {A} into {B}"], ["get rid of {A}: {B} is on your left"]),
}  # fmt: skip
"""(seen, unseen) of a few variants; one test template of the first equals one of training."""

MODELS = {
    "011_dustbin/base0": ("bin", ["tall grey bin"], ["grey tub"]),
    "046_alarm-clock/base1": ("clock", ["round clock", "red clock"], ["old clock"]),
    "046_alarm-clock/base3": ("clock", ["square clock"], []),
    "048_stapler/base0": ("stapler", ["blue stapler"], ["small stapler"]),
    "114_bottle/base1": ("bottle", ["green bottle"], ["thin bottle"]),
}


def write_checkout(folder: Path) -> Path:
    """Write the sentences and the descriptions of models below `folder`."""
    for (task, level), (seen, unseen) in TEMPLATES.items():
        path = folder / "description" / "task_instruction" / f"{task}_{level}.json"
        _write(path, {"full_description": "made up", "seen": seen, "unseen": unseen})
    for model, (plain, seen, unseen) in MODELS.items():
        path = folder / "description" / "objects_description" / f"{model}.json"
        _write(path, {"raw_description": plain, "seen": seen, "unseen": unseen})
    return folder


def _write(path: Path, data: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
