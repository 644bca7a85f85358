"""Phrasings of the slots of memory tasks in which a stand is shown and then hidden by a wall.

No phrasing names a colour or an object that has to be remembered.
"""

from __future__ import annotations

from robospa.tasks.instructions.words import NUMBERS, Slots, with_common

_WALL = (
    ("the wall appears", "the wall has come up", "the wall hides the stand"),
    ("the stand is hidden", "the stand is out of sight", "a wall is there"),
)
"""The moment from which motion is allowed, as a clause."""

_STRIP = (
    (
        "the strip along the robot's edge of the table, nearer to the robot than all blocks",
        "the empty strip at the table's near edge, closer to the robot than any block",
    ),
    (
        "the free zone right in front of the robot, where no block lay at first",
        "the edge zone on the robot's side of the table, closer in than any block lay",
        "the empty band close to the robot, along the table's edge",
        "the near part of the table, between the robot and where all the blocks lay",
    ),
)
"""Where the blocks have to go."""


def shown_blocks(count: int) -> Slots:
    """{wall}, {blocks} and {strip}."""
    number = NUMBERS[count]
    if count == 1:
        blocks: tuple[tuple[str, ...], tuple[str, ...]] = (
            (
                "the block of the color shown on the stand",
                "the block whose color was on display",
            ),
            (
                "the block matching the one on the stand",
                "that block whose color could be seen on the stand",
                "the one block colored like the block on the stand",
            ),
        )
    else:
        blocks = (
            (
                f"the {number} blocks of the colors shown on the stand",
                f"the {number} blocks whose colors were on display",
            ),
            (
                f"the {number} blocks matching those on the stand",
                f"those {number} blocks whose colors could be seen on the stand",
                f"all {number} blocks colored like the ones on the stand",
            ),
        )
        if count == 2:
            blocks = (blocks[0], (*blocks[1][:2], "both blocks colored like the ones on the stand"))
    return with_common({"wall": _WALL, "blocks": blocks, "strip": _STRIP})


def shown_objects(count: int) -> Slots:
    """{wall} and {objects}: what to click, in which order."""
    number = NUMBERS[count]
    if count == 1:
        objects: tuple[tuple[str, ...], tuple[str, ...]] = (
            ("the object on the table that was shown on the stand", "the twin of the shown object"),
            (
                "the object equal to the one on the stand",
                "the table object that is the same as the one seen on the stand",
                "the counterpart of the displayed object",
                "the table's copy of what the stand showed",
            ),
        )
    else:
        both = "both" if count == 2 else f"all {number}"
        objects = (
            (
                f"the {number} objects on the table in the order in which their twins stood on "
                "the stand from left to right",
                f"{both} objects in the left-to-right order shown on the stand",
            ),
            (
                f"{both} objects on the table in the left-to-right order of the display",
                f"the {number} table objects in the order that the stand showed from its left end",
                f"the copies of the {number} displayed objects in the stand's left-to-right order",
                f"the {number} objects in the order remembered from the stand's left to its right",
            ),
        )
    return with_common({"wall": _WALL, "objects": objects})


def turned_blocks(count: int) -> Slots:
    """{wall}, {near} and {far}: the row to be turned, and the row that says how."""
    if count == 1:
        return with_common(
            {
                "wall": (
                    ("the wall appears", "the wall has come up", "the wall hides the far block"),
                    ("the far block is hidden", "the far block is out of sight", "a wall is there"),
                ),
                "near": (
                    ("the block closer to the robot", "the near T-shaped block"),
                    ("the T nearer to the robot", "the T-shaped block at the near side",
                     "the closer one of the two T-blocks"),
                ),
                "far": (
                    ("the block farther away", "the far T-shaped block"),
                    ("the T at the far side", "the more distant T-block",
                     "the T-shaped block farther back"),
                ),
            }
        )  # fmt: skip
    number = NUMBERS[count]
    return with_common(
        {
            "wall": (
                ("the wall appears", "the wall has come up", "the wall hides the far row"),
                ("the far row is hidden", "the far row is out of sight", "a wall is there"),
            ),
            "near": (
                (f"each of the {number} blocks in the near row",
                 "every T-shaped block in the row closer to the robot"),
                ("each T in the row nearer to the robot",
                 f"each of the {number} T-blocks in the close row",
                 "every T-block at the near side"),
            ),
            "far": (
                ("the block behind it in the far row", "its counterpart in the far row"),
                ("the T at the same place in the far row", "the far T straight behind it",
                 "the one opposite in the distant row"),
            ),
        }
    )  # fmt: skip
