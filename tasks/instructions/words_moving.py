"""Phrasings of the tasks that move things apart: blocks, boxes of cards, bread and fries.

Nouns come with their number where it matters; templates use no pronoun or verb form that depends on
it, because "the fries" are many even where there is one box.
"""

from __future__ import annotations

from robospa.tasks.instructions.words import NUMBERS, Slots, with_common
from robospa.tasks.shapes import ObjectModel

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]


def one_block(color: str, side: str) -> Slots:
    """{block}, and where it goes: {to} with verbs of motion, {at} with verbs of rest."""
    return with_common(
        {
            "block": (
                (f"the {color} block", f"the {color} cube"),
                (f"the block colored {color}", f"the cube in {color}", f"the lone {color} block",
                 f"the single {color} block"),
            ),
            "to": (
                (f"to the {side} side of the table", f"over to the {side}"),
                (f"to the {side}-hand side", f"onto the {side} half of the table",
                 f"clearly to the {side} of the middle"),
            ),
            "at": (
                (f"on the {side} side of the table", f"well to the {side} of the middle"),
                (f"on the {side}-hand side", f"on the {side} half of the table",
                 f"clearly {side} of the middle"),
            ),
        }
    )  # fmt: skip


def blocks_apart(right: tuple[str, int], left: tuple[str, int]) -> Slots:
    """{right} and {left}: the blocks of each side, by colour and number."""
    return with_common({"right": _blocks(*right), "left": _blocks(*left)})


def _blocks(color: str, count: int) -> Phrasings:
    if count == 1:
        return (
            (f"the {color} block", f"the {color} cube"),
            (f"the block colored {color}", f"the cube in {color}", f"the one {color} block",
             f"the lone {color} block"),
        )  # fmt: skip
    word = NUMBERS[count]
    return (
        (f"the {color} blocks", f"the {word} {color} blocks"),
        (f"the blocks colored {color}", f"the cubes in {color}", f"the {count} {color} cubes",
         f"these {word} {color} blocks"),
    )  # fmt: skip


def one_card_box(model: ObjectModel) -> Slots:
    """{box} and its way {out} or its place {at}; either side will do."""
    color = model.phrases[0].split()[0]
    return with_common(
        {
            "box": (
                (f"the {color} card box", f"the {color} deck of cards", "the box of cards"),
                (f"the {color} pack of cards", "the card pack", "the boxed deck of cards"),
            ),
            "out": (
                ("outward, far to the side of the table", "all the way out to one side"),
                (
                    "far out to either side of the table",
                    "outward to the side area of the table",
                    "a long way out from the middle to one side",
                    "sideways to the outer part of the table",
                ),
            ),
            "at": (
                ("far out at the side of the table", "far to one side of the middle"),
                (
                    "in the outer part of the table, left or right",
                    "far from the middle at either side",
                    "well out at the left or the right",
                    "near the left or right end of the table",
                ),
            ),
        }
    )


def cards_away(count: int) -> Slots:
    """{boxes} and their way {out} or their place {at}; either side will do for each."""
    word = NUMBERS[count]
    boxes = (
        ("both card boxes", "the two decks of cards")
        if count == 2
        else (f"all {word} card boxes", f"the {word} decks of cards")
    )
    return with_common(
        {
            "boxes": (
                boxes,
                (f"these {word} card packs", f"the {count} boxes of cards",
                 f"the {word} boxed decks of cards"),
            ),
            "out": (
                (
                    "outward, far to the left and right sides",
                    "all the way out to the sides of the table",
                ),
                (
                    "far out to either side of the table",
                    "outward to the side areas of the table",
                    "a long way out to the left or right",
                    "sideways to the outer parts of the table",
                ),
            ),
            "at": (
                ("far out at the sides of the table", "far left or far right of the middle"),
                (
                    "in the outer parts of the table, left or right",
                    "far from the middle at either side",
                    "well out at the left or the right",
                    "near the left and right ends of the table",
                ),
            ),
        }
    )  # fmt: skip


WAYS: dict[str, Phrasings] = {
    "forward": (
        ("forward, away from the robot", "forward, to a place farther from the robot"),
        (
            "forward, toward the far side of the table",
            "ahead, farther from the robot",
            "forward, in the direction away from the robot",
        ),
    ),
    "backward": (
        ("backward, toward the robot", "backward, to a place nearer the robot"),
        (
            "backward, toward the near side of the table",
            "back, closer to the robot",
            "backward, in the direction of the robot",
        ),
    ),
}


def one_food(kind: str, way: str) -> Slots:
    """{food}, by kind, and the {way} it goes."""
    return with_common({"food": _food(kind, 1), "way": WAYS[way]})


def foods_apart(forward: tuple[str, int], backward: tuple[str, int]) -> Slots:
    """{first} goes {ahead}, {second} goes {back}: the foods by kind and number."""
    return with_common(
        {
            "first": _food(*forward),
            "second": _food(*backward),
            "ahead": WAYS["forward"],
            "back": WAYS["backward"],
        }
    )


def _food(kind: str, count: int) -> Phrasings:
    word = NUMBERS[count]
    if kind == "bread":
        if count == 1:
            return (
                ("the bread", "the piece of bread"),
                ("the bread item", "the bread on the table", "the one piece of bread",
                 "the single bread item"),
            )  # fmt: skip
        return (
            (f"the {word} pieces of bread", "all of the bread"),
            (f"the {word} bread items", f"these {count} pieces of bread",
             f"the {count} bread items", "every bit of the bread"),
        )  # fmt: skip
    if count == 1:
        return (
            ("the fries", "the box of fries"),
            ("the french fries", "the carton of fries", "the one box of french fries",
             "the single box of fries"),
        )  # fmt: skip
    return (
        (f"the {word} boxes of fries", "all of the fries"),
        (f"the {word} cartons of fries", f"these {count} boxes of french fries",
         f"the {count} cartons of fries", "every box of fries"),
    )  # fmt: skip
