"""Pick Blocks, Mugs, Pill Bottles and Mixed Objects A, B Distance (SDE): the k-th farthest."""

from __future__ import annotations

from robospa.tasks.families.distance import object_sets as sets
from robospa.tasks.families.distance.scenes import distance_task
from robospa.tasks.families.picking import pick_name

WHAT = {
    "Blocks": "3 to 10 blocks",
    "Mugs": "3 to 7 mugs",
    "Pill_Bottles": "3 to 7 pill bottles",
    "Mixed_Objects_A": "3 to 7 different objects",
    "Mixed_Objects_B": "3 to 7 different objects",
}

TASKS = tuple(distance_task(f, pick_name(f.name, "Distance"), WHAT[f.name]) for f in sets.FAMILIES)
