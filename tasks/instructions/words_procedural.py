"""Phrasings of the procedural tasks' slots, from what a scene drew.

Counts are words or digits with the right number ("once", "twice", "3 times"); orders are lists
from the first to the last, or from the bottom to the top of a stack.
"""

from __future__ import annotations

from collections.abc import Sequence

from robospa.tasks.instructions.words import NUMBERS, Slots, listed, with_common

NEAR_EDGE_MIDDLE = (
    ("the middle of the table close to the robot", "the center of the table near the robot"),
    (
        "the spot on the table's center line right by the robot",
        "the central spot close to the robot",
        "the middle spot near the robot",
        "the center of the robot's side of the table",
    ),
)
"""Where a single block has to go, as a place."""

TABLE_MIDDLE = (
    ("near the middle of the table", "close to the center of the table"),
    (
        "around the table's center",
        "close to the tabletop's midpoint",
        "near the table's central spot",
        "in the table's central area",
    ),
)
"""Where a tower stands."""


def press(count: int) -> Slots:
    """{stapler} and, from two presses on, {times} and {presses}."""
    if not 1 <= count <= 10:
        raise ValueError(f"cannot word {count} presses; use 1 to 10")
    slots: Slots = {
        "stapler": (
            ("the stapler", "the desk stapler", "the office stapler"),
            ("the paper stapler", "the stapling device", "the stapling tool", "that stapler"),
        )
    }
    word = NUMBERS[count]
    if count == 1:
        return with_common(slots)
    plain = ("twice", "two times", "2 times") if count == 2 else (f"{word} times", f"{count} times")
    slots["times"] = (
        plain,
        (f"exactly {plain[0]}", f"a total of {count} times", f"exactly {count} times"),
    )
    slots["presses"] = (
        (f"{word} presses", f"{count} presses"),
        (f"exactly {word} presses", f"exactly {count} presses", f"{word} separate presses"),
    )
    return with_common(slots)


def dustbin(count: int) -> Slots:
    """{bottles}, {bin}, {side}: `count` bottles, the bin and where it stands."""
    word = NUMBERS[count]
    if count == 1:
        bottles = (
            ("the bottle", "the one bottle"),
            ("the single bottle", "the only bottle", "the lone bottle"),
        )
    elif count == 2:
        bottles = (
            ("both bottles", "the two bottles"),
            ("each of the two bottles", "the pair of bottles", "both of the bottles"),
        )
    else:
        bottles = (
            (f"all {word} bottles", f"the {word} bottles"),
            (
                f"each of the {word} bottles",
                f"every one of the {word} bottles",
                f"all {count} of the bottles",
            ),
        )
    return with_common(
        {
            "bottles": bottles,
            "bin": (
                ("the dustbin", "the trash bin"),
                ("the waste bin", "the rubbish bin", "the garbage bin"),
            ),
            "side": (
                ("on the left", "at the robot's left", "to the left of the table"),
                ("on the robot's left side", "left of the table", "on the left-hand side"),
            ),
        }
    )


def stack(colors: Sequence[str]) -> Slots:
    """{order}, {pairs}, {bottom}, {top}, {number}, {middle}; for one block {block} and {middle}.

    `colors` runs from the bottom to the top.
    """
    if len(colors) == 1:
        color = colors[0]
        return with_common(
            {
                "block": (
                    (f"the {color} block", f"the {color} cube"),
                    (f"the block colored {color}", f"the cube in {color}", f"the {color} object"),
                ),
                "middle": NEAR_EDGE_MIDDLE,
            }
        )
    onto = list(zip(colors[1:], colors[:-1], strict=True))
    number = NUMBERS[len(colors)]
    return with_common(
        {
            "order": color_orders(colors),
            "pairs": (
                (
                    listed([f"{a} on {b}" for a, b in onto]),
                    listed([f"{a} onto {b}" for a, b in onto], ", then "),
                ),
                (
                    listed([f"{a} over {b}" for a, b in onto]),
                    listed([f"{a} on top of {b}" for a, b in onto]),
                    listed([f"{a} above {b}" for a, b in onto]),
                ),
            ),
            "bottom": (
                (f"the {colors[0]} block", f"the {colors[0]} cube"),
                (f"the block in {colors[0]}", f"the cube in {colors[0]}"),
            ),
            "top": (
                (f"the {colors[-1]} block", f"the {colors[-1]} cube"),
                (f"the block in {colors[-1]}", f"the cube in {colors[-1]}"),
            ),
            "number": (
                (number, str(len(colors))),
                (f"all {number}" if len(colors) > 2 else "both", f"these {number}"),
            ),
            "middle": TABLE_MIDDLE,
        }
    )


def color_orders(colors: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """How the order of two or more colours is said, from the first to the last."""
    last = ", ".join(f"{c} {p}" for c, p in zip(colors, _places(len(colors)), strict=True))
    return (
        (listed(colors, ", then "), _steps(colors)),
        (last, " followed by ".join(colors), ", next ".join(colors)),
    )


def _steps(colors: Sequence[str]) -> str:
    """ "red, then green, then blue"; two colours are joined by "and then"."""
    return (", then " if len(colors) > 2 else " and then ").join(colors)


def _places(count: int) -> tuple[str, ...]:
    return (*("first", "second", "third", "fourth")[: count - 1], "last")


def click(level: int) -> Slots:
    """{can} and, from level 2 on, {bread}, {basket}; from level 4 on {bottle}, {pad}."""
    slots: Slots = {
        "can": (
            ("the can", "the drink can", "the metal can"),
            ("the soda can", "the beverage can", "the tin can", "the drinks tin"),
        )
    }
    if level >= 2:
        slots["bread"] = (
            ("the bread", "the piece of bread"),
            ("the bread item", "the baked bread", "the bakery item"),
        )
        slots["basket"] = (
            ("the basket", "the bread basket"),
            ("the breadbasket", "the basket for bread", "the bread container"),
        )
    if level >= 4:
        slots["bottle"] = (
            ("the pill bottle", "the medicine bottle"),
            ("the pill container", "the bottle of pills", "the pill jar"),
        )
        slots["pad"] = (
            ("the blue pad", "the blue square"),
            ("the blue mat", "the blue patch", "the blue marker"),
        )
    return with_common(slots)


def memory(colors: Sequence[str]) -> Slots:
    """{order}, {where}; {block} instead of {order} for one block.

    {where} says which way a cover goes and where it ends: the goal region is a spot 13 cm behind
    the block, and nothing else in the sentence could tell.
    """
    slots: Slots = {
        "where": (
            (
                "away from the robot, to the spot 13 cm behind its block",
                "straight back, away from the robot, to 13 cm behind its block",
            ),
            (
                "directly away from the robot, ending 13 cm behind its block",
                "in a straight line away from the robot, to 13 cm beyond its block",
                "away from the robot, to a point 13 cm past its block",
                "straight back from the robot until it lies 13 cm behind its block",
            ),
        ),
    }
    if len(colors) == 1:
        slots["block"] = (
            (f"the {colors[0]} block", f"the {colors[0]} cube"),
            (
                f"the block colored {colors[0]}",
                f"the cube in {colors[0]}",
                f"that {colors[0]} block",
            ),
        )
    else:
        slots["order"] = color_orders(colors)
    return with_common(slots)
