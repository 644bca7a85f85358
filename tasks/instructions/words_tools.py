"""Phrasings of the slots of tasks with a tool: hitting blocks with a hammer, stamping pads."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.tasks.instructions.words import NUMBERS, Slots, listed, with_common
from robospa.tasks.instructions.words_procedural import color_orders
from robospa.tasks.shapes import ObjectModel

_HAMMER = (
    ("the hammer", "the mallet"),
    ("the hammer on the table", "the small mallet", "the little hammer", "the small hammer"),
)


def hammer(colors: Sequence[str]) -> Slots:
    """{hammer} and {order}, or {block} instead for a single one."""
    slots: Slots = {"hammer": _HAMMER}
    if len(colors) == 1:
        color = colors[0]
        slots["block"] = (
            (f"the {color} block", f"the {color} cube"),
            (f"the block colored {color}", f"the cube in {color}", f"that {color} block"),
        )
    else:
        slots["order"] = color_orders(colors)
    return with_common(slots)


def stamps(colors: Sequence[str], seal: ObjectModel) -> Slots:
    """{seal}, {pads} and {order}, from right to left; {pad} instead for a single one."""
    cut = len(seal.phrases) - max(2, len(seal.phrases) // 3)
    phrases = tuple(f"the {p}" for p in seal.phrases)
    slots: Slots = {"seal": (("the stamp", *phrases[:cut]), ("the hand seal", *phrases[cut:]))}
    if len(colors) == 1:
        color = colors[0]
        slots["pad"] = (
            (f"the {color} pad", f"the {color} square"),
            (
                f"the pad in {color}",
                f"the flat {color} square",
                f"the {color} mat",
                f"the {color} patch",
            ),
        )
        return with_common(slots)
    number = NUMBERS[len(colors)]
    slots["pads"] = (
        (f"the {number} pads", f"all {len(colors)} pads" if len(colors) > 2 else "both pads"),
        (f"each of the {number} pads", f"these {number} mats", f"the {number} flat squares"),
    )
    train, held = color_orders(colors)
    slots["order"] = (
        (f"from right to left, {train[0]}", f"right to left: {listed(list(colors))}"),
        tuple(f"{text}, that is, from the rightmost to the leftmost" for text in held),
    )
    return with_common(slots)
