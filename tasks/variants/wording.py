"""Phrasings that the pick tasks share. Each pair is (train phrasings, held-out phrasings)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]
Slots = Mapping[str, Phrasings]

WORDS = (
    "zeroth", "first", "second", "third", "fourth", "fifth", "sixth",
    "seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth",
)  # fmt: skip

NOUN_CUBE: Phrasings = (("block", "cube"), ("cubic block", "coloured cube", "solid cube"))
NOUN_OBJECT: Phrasings = (("object", "item"), ("thing", "article"))


def numeral(k: int) -> str:
    """1 -> "1st", 2 -> "2nd", ... 12 -> "12th"."""
    return f"{k}{ {1: 'st', 2: 'nd', 3: 'rd'}.get(k, 'th') }"


def ordinals(k: int, train: Sequence[str], held_out: Sequence[str]) -> Phrasings:
    """Rank `k` with each superlative: "2nd largest", "second largest"; rank 1 also "largest"."""

    def phrasings(superlatives: Sequence[str]) -> tuple[str, ...]:
        numbers = (numeral(k), WORDS[k])
        ranked = tuple(f"{n} {s}" for s in superlatives for n in numbers)
        return (*superlatives, *ranked[::2]) if k == 1 else ranked

    return phrasings(train), phrasings(held_out)


VIEWPOINTS: Mapping[str, Phrasings] = {
    "robot": (("robot's", "robot"), ("robot's own", "robot arm's")),
    "opposite": (("opposite", "facing"), ("directly opposite", "far-end")),
    "left": (("left", "left-hand"), ("left table", "left-edge")),
    "right": (("right", "right-hand"), ("right table", "right-edge")),
}
"""Who looks; goes before "side", "viewpoint" or "view"."""

POSITIONS: Mapping[str, Phrasings] = {
    "leftmost": (("leftmost", "left-most"), ("furthest-left", "far-left")),
    "rightmost": (("rightmost", "right-most"), ("furthest-right", "far-right")),
    "frontmost": (("frontmost", "front-most"), ("furthest-forward", "foremost")),
    "backmost": (("backmost", "back-most"), ("furthest-back", "rearmost")),
}
"""Extremes as adjectives."""

COLUMN_DIRECTIONS: Mapping[str, Phrasings] = {
    "left_to_right": (
        ("from left to right", "counting from the left", "from the left"),
        ("going left to right", "starting at the left end"),
    ),
    "right_to_left": (
        ("from right to left", "counting from the right", "from the right"),
        ("going right to left", "starting at the right end"),
    ),
}

ROW_DIRECTIONS: Mapping[str, Phrasings] = {
    "near_to_far": (
        ("from near to far", "counting from the near side", "from the near side"),
        ("going near to far", "starting at the row nearest the robot"),
    ),
    "far_to_near": (
        ("from far to near", "counting from the far side", "from the far side"),
        ("going far to near", "starting at the row farthest from the robot"),
    ),
}


def index(k: int) -> Phrasings:
    """Position `k` alone: "2nd", "second"."""
    return (numeral(k), WORDS[k]), (f"no. {k}", f"number-{WORDS_CARDINAL[k]}")


WORDS_CARDINAL = ("zero", "one", "two", "three", "four", "five", "six")

NOUN_SOAP: Phrasings = (("soap bar", "soap"), ("bar of soap", "piece of soap"))

_AXIS: Mapping[str, tuple[str, str, str]] = {
    # plain, after an adverb, held-out form
    "left": ("to the left of", "left of", "on the left-hand side of"),
    "right": ("to the right of", "right of", "on the right-hand side of"),
    "front": ("in front of", "on the front side of", "on the far side of"),
    "back": ("at the back of", "behind", "on the near side of"),
}


def relation_phrases(direction: str, adjacent: bool) -> Phrasings:
    """How the target lies to the reference; ends with a preposition.

    With `adjacent` (three objects or more) it says that nothing lies between.
    """
    if direction in _AXIS:
        to, short, held = _AXIS[direction]
        if not adjacent:
            return (to, short), (held, f"located {to}")
        return (
            (f"directly {to}", f"immediately {short}"),
            (f"right next to and {to}", f"directly {held}"),
        )
    words = direction.replace("_", "-")
    if not adjacent:
        return (
            (f"to the {words} of", f"on the {words} side of"),
            (f"diagonally to the {words} of", f"at the {words} of"),
        )
    return (
        (f"diagonally next to, on the {words} side of", f"nearest to the {words} of"),
        (f"diagonally adjacent to, and to the {words} of", f"closest on the {words} side of"),
    )


def place_phrases(label: str) -> Phrasings:
    """A soap bar by its place in the layout, without article: "front-left soap bar"."""
    words = label.replace("_", "-")
    return (
        (f"{words} soap bar", f"{words} soap", f"soap bar at the {words}"),
        (f"{words} bar of soap", f"soap bar in the {words} position"),
    )
