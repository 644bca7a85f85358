"""The facts of every variant: the paper's n and T, the limit of steps, how many objects there are.

The numbers are those of the official sheets, written down once more here.
"""

from __future__ import annotations

from drawn_scenes import FIRST_SEED, each_task

from robospa.tasks.catalog import LEVELS, build_scene, task, tasks
from robospa.tasks.task import Level

Five = tuple[int, int, int, int, int]

T: Five = (1, 2, 3, 4, 5)
ONE: Five = (1, 1, 1, 1, 1)
BY_200: Five = (200, 400, 600, 800, 1000)
CHAIN: Five = (400, 600, 800, 1000, 1200)
WALL: Five = (250, 450, 650, 850, 1050)

SPATIAL: dict[str, Five] = {
    "GAC": (2, 3, 4, 5, 6),
    **dict.fromkeys(("SDE", "CBG"), (3, 4, 5, 6, 7)),
    **dict.fromkeys(("CPI", "SOI"), (3, 6, 8, 9, 12)),
    "RRR": (2, 3, 4, 6, 9),
    **dict.fromkeys(("CVR", "EPG"), (3, 4, 5, 6, 7)),
}
"""Objects on the table, by category."""
MANY_BLOCKS: Five = (3, 6, 8, 9, 10)
"""Of the tasks about distances and colours that have blocks alone."""

PROCEDURAL: dict[str, tuple[Five, Five]] = {
    "Press_Stapler_Repeat": (ONE, BY_200),
    "Lift_Pot_Repeat": (ONE, BY_200),
    "Lift_Fan_Repeat": (ONE, BY_200),
    "Click_Bell_Repeat": (ONE, BY_200),
    "Put_Bottles_Dustbin": (T, (400, 800, 1200, 1600, 2000)),
    "Move_Blocks_Apart": (T, BY_200),
    "Move_Playing_Cards_Away": (T, BY_200),
    "Place_Bowls_Plates": (T, BY_200),
    "Separate_Fries_Bread": (T, BY_200),
    "Rank_Blocks_Height": (T, BY_200),
    "Rank_Blocks_Color": (T, BY_200),
    "Rank_Blocks_Size": (T, BY_200),
    "Hit_Blocks_Hammer_Order": (T, BY_200),
    "Click_Objects_Order": (T, BY_200),
    "Stamp_Seals_Order": (T, BY_200),
    "Click_Bell_Clockwise_Order": (T, BY_200),
    "Stack_Blocks_Color_Order": (T, BY_200),
    "Stack_Blocks_Size_Order": (T, BY_200),
    "Stack_Blocks_Length_Order": (T, BY_200),
    "Place_Phone_Press_Stapler": ((1, 2, 2, 2, 3), (400, 600, 800, 1000, 1300)),
    "Place_Bottle_Cup": (T, (400, 800, 1200, 1400, 1600)),
    "Hang_Mug_Stack_Blocks": (T, CHAIN),
    "Place_Object_Scale_Click": ((1, 2, 3, 3, 3), BY_200),
    "Place_Burger_Fries_Click_Bell": ((1, 2, 3, 3, 3), BY_200),
    "Click_Can_Place_Items": ((1, 2, 2, 3, 3), BY_200),
    "Stamp_Seals_Press_Stapler": ((1, 1, 2, 2, 3), BY_200),
    "Click_Bell_Open_Microwave_Place_Object": ((1, 2, 2, 3, 3), (200, 1000, 1200, 1400, 1600)),
    "Observe_Blocks_Move_Memory": ((2, 4, 6, 8, 10), WALL),
    "Observe_Objects_Click_Memory": (T, WALL),
    "Remember_Color_Cover": (T, WALL),
    "Remember_Orientation_Restore": ((2, 4, 6, 8, 10), WALL),
    "Press_Stapler_Memory": (T, BY_200),
}
"""Candidates and limits [steps]; the subtasks are the level."""


def objects_of(name: str) -> Five:
    """How many objects the levels of a spatial or basic task have."""
    found = task(name)
    if found.category in ("SDE", "CBG") and name.endswith(("Blocks", "Blocks_Distance")):
        return MANY_BLOCKS
    return SPATIAL[found.category]


def test_every_task_has_its_row() -> None:
    assert {n for n, t in tasks().items() if t.dimension == "procedural"} == set(PROCEDURAL)


@each_task
def test_levels_are_those_of_the_benchmark(name: str) -> None:
    found = task(name)
    for level in LEVELS:
        scene = build_scene(name, level, FIRST_SEED)
        if name in PROCEDURAL:
            candidates, steps = PROCEDURAL[name]
            wanted = Level(candidates[level - 1], level, steps[level - 1])
        else:
            count = objects_of(name)[level - 1]
            assert len(scene.objects) == count, level
            asked = min(count, 4) if found.category in ("CVR", "EPG") else count
            wanted = Level(asked, 1, 150)
        assert found.levels[level] == wanted, level
        assert found.goal(scene).total == wanted.subtasks, level
