"""Phrasings of the slots of the three ranking tasks: how many blocks, and in which order.

A single block is only to be brought somewhere: {block} and {middle}. From two blocks on {blocks}
and {order}; templates say that the row runs from left to right.
"""

from __future__ import annotations

from robospa.tasks.instructions.words import NUMBERS, Slots, listed, with_common

COLORS = ("red", "green", "blue", "yellow", "purple")


def by_height(count: int) -> Slots:
    """From the tallest to the shortest."""
    return _one("the block") if count == 1 else _several(count, _falling(count, "tall", "short"))


def by_size(count: int) -> Slots:
    """From the largest to the smallest."""
    return _one("the block") if count == 1 else _several(count, _falling(count, "large", "small"))


def by_color(count: int) -> Slots:
    """Red, green, blue, yellow, purple, as far as there are blocks."""
    if count == 1:
        return _one("the red block")
    colors = COLORS[:count]
    steps = (", then " if count > 2 else " and then ").join(colors)
    return _several(
        count,
        (
            (f"in the order {listed(colors)}", f"with the colors {steps}"),
            (
                f"with {listed(colors)} in this sequence",
                f"with {colors[0]} first and then {listed(colors[1:])}",
                f"having {colors[0]} first, followed by {listed(colors[1:])}",
                f"in the color sequence {listed(colors)}",
            ),
        ),
    )


def _falling(count: int, most: str, least: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Phrasings of an order by a measure: comparatives for two blocks, superlatives for more."""
    ending = "er" if count == 2 else "est"
    first, last = (word + ending.removeprefix("e" if word.endswith("e") else "")
                   for word in (most, least))  # fmt: skip
    measure = {"tall": "height", "large": "size"}[most]
    return (
        (f"from the {first} to the {last}", f"in order of decreasing {measure}"),
        (
            f"with the {first} one first and the {last} one last",
            f"going down in {measure}",
            f"beginning with the {first} one and ending with the {last} one",
            f"sorted so that their {measure} falls",
        ),
    )


def _several(count: int, order: tuple[tuple[str, ...], tuple[str, ...]]) -> Slots:
    word = NUMBERS[count]
    blocks = (
        ("both blocks", "the two blocks")
        if count == 2
        else (f"all {word} blocks", f"the {word} blocks"),
        (f"these {word} blocks", f"the {count} blocks", f"the {word} blocks on the table"),
    )
    return with_common({"blocks": blocks, "order": order})


def _one(block: str) -> Slots:
    kind = block.removeprefix("the ")
    return with_common(
        {
            "block": (
                (block, block.replace("block", "cube")),
                (f"the single {kind}", f"the only {kind}", f"the one {kind}"),
            ),
            "middle": (
                (
                    "the middle of the table close to the robot",
                    "the center of the table near the robot",
                ),
                (
                    "the spot on the table's center line right by the robot",
                    "the central spot close to the robot",
                    "the middle spot near the robot",
                    "the center of the robot's side of the table",
                ),
            ),
        }
    )
