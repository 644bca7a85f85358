"""Phrasings of the spatial tasks' slots, from what a scene drew.

Directions are the robot's: left and right as it sees them, near is close to it. In the relational
and multi-view tasks the official words are kept (front = far from the viewer, back = near), which
is not how everybody speaks, so a slot `convention` says it; "in front of" and "behind", which
many readers take the other way round, are never used.
"""

from __future__ import annotations

from typing import NamedTuple

from robospa.tasks.instructions.words import Phrasings, Slots, ordinal, with_common


class _Measure(NamedTuple):
    """How a measure of blocks is called, how it is looked at, and its two ends."""

    measure: str
    how: str
    most: str
    least: str


_REFERENCES: Slots = {
    "tea box": (("tea box", "box of tea"), ("tea carton", "tea packet", "tea package")),
    "sauce can": (("sauce can", "can of sauce"), ("sauce tin", "tin of sauce", "canned sauce")),
    "bowl": (("bowl", "round bowl"), ("open bowl", "serving bowl", "kitchen bowl")),
    "toycar": (("toy car", "small toy car"), ("model car", "miniature car", "little car")),
    "fan": (("fan", "electric fan"), ("desk fan", "table fan", "little fan")),
    "tissue box": (
        ("tissue box", "box of tissues"),
        ("tissue carton", "tissue package", "carton of tissues"),
    ),
    "cup": (("cup", "drinking cup"), ("tumbler", "round cup", "handleless cup")),
    "bread": (("bread", "piece of bread"), ("fresh bread", "bakery bread", "bread piece")),
    "can": (("can", "drink can"), ("soda can", "beverage can", "metal can")),
    "stapler": (("stapler", "paper stapler"), ("desk stapler", "office stapler", "hand stapler")),
    "bell": (("bell", "call bell"), ("desk bell", "service bell", "reception bell")),
    "apple": (("apple", "round apple"), ("whole apple", "fresh apple", "ripe apple")),
    "payment sign": (
        ("payment sign", "sign for payments"),
        ("pay sign", "payment code sign", "mobile payment sign"),
    ),
    "french fries": (
        ("box of french fries", "french fries box"),
        ("carton of fries", "packet of fries", "fries carton"),
    ),
}

_TRAILING = {"with", "that", "in", "on", "wrapped"}
"""Words that start a modifier behind a noun."""

_COLUMNS: Slots = {
    f"from {a} to {b}": (
        (f"from {a} to {b}", f"counted from {a} to {b}"),
        (
            f"going from {a} to {b}",
            f"counting from the {a} end to the {b}",
            f"counting from the {a} side to the {b}",
        ),
    )
    for a, b in (("left", "right"), ("right", "left"))
}

_ROWS: Slots = {
    f"from {a} to {b}": (
        (f"from {a} to {b}", f"counted from {a} to {b}"),
        (
            f"going from {a} to {b}",
            f"counting from the {long_a} to the {long_b}",
            f"counting from the {a} edge to the {b}",
        ),
    )
    for (a, long_a), (b, long_b) in (
        (("near", "nearest"), ("far", "farthest")),
        (("far", "farthest"), ("near", "nearest")),
    )
}

_ROBOT_VIEW = (
    ("as seen from the robot", "from the robot's viewpoint"),
    ("from the robot's perspective", "through the robot's eyes", "from where the robot stands"),
)

_VIEWS: Slots = {
    "robot": (
        ("from the robot's own viewpoint", "from the robot's side of the table"),
        (
            "from where the robot stands",
            "from the robot's own perspective",
            "from the robot's own position",
        ),
    ),
    "opposite": (
        ("from the viewpoint opposite the robot", "from the side of the table opposite the robot"),
        (
            "from across the table opposite the robot",
            "from where someone facing the robot stands",
            "from the far side of the table towards the robot",
        ),
    ),
    "left": (
        (
            "from the end of the table on the robot's left",
            "from the side of the table on the robot's left",
        ),
        (
            "from the table end to the left of the robot",
            "from a seat at the table on the robot's left",
            "from the table edge to the robot's left",
        ),
    ),
    "right": (
        (
            "from the end of the table on the robot's right",
            "from the side of the table on the robot's right",
        ),
        (
            "from the table end to the right of the robot",
            "from a seat at the table on the robot's right",
            "from the table edge to the robot's right",
        ),
    ),
}


MEASURES = {
    "size": _Measure("size", "big each block is", "largest", "smallest"),
    "height": _Measure("height", "tall each block is", "tallest", "shortest"),
    "length": _Measure("length", "long each block is from left to right", "longest", "shortest"),
    "area": _Measure("base area", "much table each block covers", "largest base", "smallest base"),
}


def measured(measure: str, rank: int, count: int) -> Slots:
    """{block}: the block of `rank` (1 = largest) in "size", "height", "length" or "area".

    {measure}, {how}, {most} and {least} are words about the measure. Length is always said to be
    measured from left to right, because a short block may be wider than long.
    """
    if not 1 <= rank <= count:
        raise ValueError(f"{measure} rank {rank} does not exist among {count} blocks")
    blocks = {"size": size, "height": _height, "length": _length, "area": _area}[measure]
    about = MEASURES[measure]
    fixed = {name: ((word,), (word,)) for name, word in about._asdict().items()}
    return with_common({"block": blocks(rank, count), **fixed})


def _height(rank: int, count: int) -> Phrasings:
    number, word = ordinal(rank)
    if count == 2:
        more, most, degree = (
            ("taller", "tallest", "greater") if rank == 1 else ("shorter", "shortest", "smaller")
        )
        return (
            (f"the {more} block", f"the {most} block"),
            (
                f"the {more} of the two blocks",
                f"the block that is {more} than the other",
                f"the {more} one of the two blocks",
                f"the block of {degree} height",
            ),
        )
    if rank == 1:
        return (
            ("the tallest block", "the block with the greatest height"),
            (
                "the tallest of the blocks",
                "the block that is taller than all others",
                "the tallest of all the blocks",
                "the block of greatest height",
            ),
        )
    return (
        (
            f"the {number} tallest block",
            f"the {word} tallest block",
            f"the block with the {number} greatest height",
        ),
        (
            f"the {word} tallest of the blocks",
            f"the block that ranks {number} when the tallest ranks first",
            f"the block that comes {word} if the tallest comes first",
            f"the {number} tallest of all the blocks",
        ),
    )


def _length(rank: int, count: int) -> Phrasings:
    number, word = ordinal(rank)
    if count == 2:
        more, most = ("longer", "greater") if rank == 1 else ("shorter", "smaller")
        return (
            (
                f"the block that is {more} from left to right",
                f"the block with the {most} left-to-right length",
            ),
            (
                f"the block that is {more} when measured from left to right",
                f"the block whose left-to-right extent is {most}",
                f"the block that is {more} than the other between its left and right ends",
                f"the one block of {most} extent from left to right",
            ),
        )
    if rank == 1:
        return (
            (
                "the block that is longest from left to right",
                "the block with the greatest left-to-right length",
            ),
            (
                "the block that is longest when measured from left to right",
                "the block whose left-to-right extent is greatest",
                "the block that is longer than all others between its left and right ends",
                "the one block of greatest extent from left to right",
            ),
        )
    return (
        (
            f"the block that is {number} longest from left to right",
            f"the block with the {number} greatest left-to-right length",
            f"the block with the {word} greatest left-to-right length",
        ),
        (
            f"the block that is {word} longest when measured from left to right",
            f"the block whose left-to-right extent is {number} greatest",
            f"the block that is {word} longest between its left and right ends",
            f"the one block of {number} greatest extent from left to right",
        ),
    )


def _area(rank: int, count: int) -> Phrasings:
    number, word = ordinal(rank)
    if count == 2:
        more = "larger" if rank == 1 else "smaller"
        return (
            (f"the block with the {more} base", f"the block with the {more} base area"),
            (
                f"the block whose base is {more} than the other's",
                f"the block that stands on the {more} base",
                f"the block that has the {more} footprint",
                f"the block that covers the {more} area",
            ),
        )
    most = ("largest", "largest") if rank == 1 else (f"{number} largest", f"{word} largest")
    return (
        (
            f"the block with the {most[0]} base",
            f"the block with the {most[1]} base area",
        ),
        (
            f"the block whose base area is {most[1]}",
            f"the block that stands on the {most[0]} base",
            f"the block that has the {most[1]} footprint",
            f"the block that covers the {most[0]} area",
        ),
    )


def size(rank: int, count: int) -> Phrasings:
    """Names of the block of size `rank` (1 = largest) among `count`."""
    number, word = ordinal(rank)
    train: tuple[str, ...]
    held: tuple[str, ...]
    if count == 2:
        more = "larger" if rank == 1 else "smaller"
        train = (f"the {more} block", "the bigger block" if rank == 1 else "the 2nd largest block")
        held = (
            f"the {more} of the two blocks",
            f"the block that is {more} than the other",
            f"the {more} one of the two blocks",
            "the bigger of the two blocks" if rank == 1 else "the second largest of the two blocks",
        )
    elif rank == 1:
        train = ("the largest block", "the biggest block")
        held = (
            "the largest of the blocks",
            "the block that is larger than all others",
            "the biggest of all the blocks",
            "the block of greatest size",
        )
    else:
        train = (
            f"the {number} largest block",
            f"the {word} largest block",
            f"the {number} biggest block",
        )
        held = (
            f"the {word} largest of the blocks",
            f"the block that ranks {number} when the largest ranks first",
            f"the block that comes {word} if the largest comes first",
            f"the {number} biggest of the blocks",
        )
    return train, held


_COLORED = {
    "block": (("block", "cube"), ("building block", "square block", "cubic block")),
    "mug": (("mug", "coffee mug"), ("ceramic mug", "tea mug", "drinking mug")),
    "pill bottle": (
        ("pill bottle", "medicine bottle"),
        ("bottle of pills", "pill container", "tablet bottle"),
    ),
}


def colored(noun: str, color: str) -> Phrasings:
    """Names, without article, of the block, mug or pill bottle of a colour."""
    train, held = _COLORED[noun]
    return tuple(f"{color} {n}" for n in train), tuple(f"{color} {n}" for n in held)


def reference_names(asset: str, phrases: Phrasings = ((), ())) -> Phrasings:
    """Names of a reference, without article, by its category.

    `asset` is a category ("tea box") or an asset ("112_tea-box"), KeyError if unknown; `phrases`
    are further (train, held-out) names of this very object. Those with a modifier behind the noun
    are left out: "the object farthest from the bowl that is blue" could be read as a blue object.
    """
    plain = _REFERENCES[category(asset)]
    usable = ([p for p in some if not _TRAILING & set(p.split())] for some in phrases)
    names = tuple(tuple(dict.fromkeys((*a, *b))) for a, b in zip(plain, usable, strict=True))
    return names[0], tuple(name for name in names[1] if name not in names[0])


def distance(rank: int, reference: Phrasings, noun: str = "object") -> Slots:
    """{rank}, {reference}, {object}: the one `rank` farthest (1 = farthest) from `reference`.

    `reference` are names without article; `noun` is what the candidates are called.
    """
    number, word = ordinal(rank)
    if rank == 1:
        train: tuple[str, ...] = ("farthest", "farthest away")
        held: tuple[str, ...] = ("furthest", "furthest away", "most distant", "most remote")
    else:
        train = (f"{number} farthest", f"{word} farthest")
        held = (
            f"{number} furthest",
            f"{word} furthest",
            f"{number} most distant",
            f"{word} most distant",
        )
    return with_common(
        {"rank": (train, held), "reference": reference, "object": ((noun,), (noun,))}
    )


def by_color(color: str, noun: str) -> Slots:
    """{target}: the only `noun` of a colour."""
    train = (f"the {color} {noun}", f"the {color} one among the {noun}s")
    held = (
        f"the {noun} that is {color}",
        f"the {noun} of {color} color",
        f"the only {color} {noun}",
        f"the one {noun} colored {color}",
    )
    return with_common({"target": (train, held)})


def category(name: str) -> str:
    """The category word of an asset name: "112_tea-box" -> "tea box"."""
    plain = name.split("_", 1)[1] if name[:3].isdigit() else name
    plain = plain.replace("-", " ").replace("_", " ")
    return {"toy car": "toycar", "fries": "french fries"}.get(plain, plain)


NOUNS: Slots = {
    "object": (("object", "item"), ("thing", "piece")),
    "block": (("block", "cube"), ("cubic block", "cube-shaped block")),
    "cup": (("cup", "drinking cup"), ("tumbler", "beaker")),
    "rubik cube": (("Rubik's cube", "puzzle cube"), ("cube puzzle", "Rubik cube")),
    "soap bar": (("soap bar", "soap"), ("bar of soap", "soap")),
    "tea box": (("tea box",), ("tea carton",)),
    "can": (("can", "drinks can"), ("drink can", "soda can")),
}
"""What the objects of a scene are called, singular and without article."""


def canonical(
    column: int,
    column_direction: str,
    row: int | None = None,
    row_direction: str | None = None,
    noun: str = "object",
) -> Slots:
    """{noun}, {column}, {column_direction}, {viewer} and, if there are rows, {row},
    {row_direction}.

    Positions count from 1 along "left_to_right" or "right_to_left", and along "near_to_far" or
    "far_to_near".
    """
    spelled = ordinal(column)
    slots: Slots = {
        "noun": NOUNS[noun],
        "column": (spelled, spelled),
        "column_direction": _COLUMNS[_direction(column_direction)],
        "viewer": _ROBOT_VIEW,
    }
    if row is not None and row_direction is not None:
        spelled = ordinal(row)
        slots["row"] = (spelled, spelled)
        slots["row_direction"] = _ROWS[_direction(row_direction)]
    return with_common(slots)


def _direction(name: str) -> str:
    """ "left_to_right" or "from left to right", as the latter."""
    return "from " + name.removeprefix("from ").replace("_", " ")


def relational(direction: str, reference: str, level: int, noun: str = "soap bar") -> Slots:
    """{noun}, {relation}, {reference}, {convention}: the neighbour in `direction` of `reference`.

    `direction` is left, right, front, back or a compound such as front_left; `reference` is the
    position label of the reference object ("left", "front-left", "front-middle", "center"...). From
    level 2 on an axis neighbour is "directly" there (official wording); from level 4 on a diagonal
    neighbour is "immediately" there, because another object may lie further out on the same side.
    """
    side = direction.replace("_", "-")
    how = ""
    if "-" in side:
        how = "immediately " if level >= 4 else ""
    elif level >= 2:
        how = "directly "
    relation = (
        (f"{how}to the {side} of", f"{how}on the {side} side of"),
        (
            f"lying {how}to the {side} of",
            f"placed {how}on the {side} side of",
            f"located {how}to the {side} of",
            f"found {how}on the {side} side of",
        ),
    )
    label = reference.replace("_", "-")
    where = label.replace("-", " ")
    at = {"left": "on the left", "right": "on the right", "center": "in the center"}.get(
        where, f"at the {where}"
    )
    plain = NOUNS[noun][0][0]
    names = (
        (f"the {label} {plain}", f"the {plain} {at}"),
        (f"the {label} one", f"the one {at}"),
    )
    convention = (
        (
            "front means far and back means near",
            "the front is the far side and the back the near side",
        ),
        (
            "front stands for far and back for near",
            "the far side counts as front and the near side as back",
        ),
    )
    return with_common(
        {
            "noun": NOUNS[noun],
            "relation": relation,
            "reference": names,
            "convention": convention,
        }
    )


def multi_view(position: str, view: str) -> Slots:
    """{target}, {view}, {convention}: the extreme object, named from a viewpoint.

    `position` is leftmost, rightmost, frontmost or backmost *in that view*; the viewer is the
    robot, someone opposite, or someone at the robot's left or right.
    """
    side = position.removesuffix("most")
    if side not in ("left", "right", "front", "back"):
        raise ValueError(f"no position {position!r}; use leftmost, rightmost, frontmost, backmost")
    target = (
        (f"the {position} object", f"the object at the very {side}"),
        (
            f"the object lying at the extreme {side}",
            f"the object placed at the {side} extreme",
            f"the {position} of all the objects",
            f"the object that is {position} of all",
        ),
    )
    convention = (
        (
            "front means far from that viewer and back means near",
            "the front is the viewer's far side and the back the near side",
        ),
        (
            "front points away from that viewer and back points towards the viewer",
            "the front lies far from the viewer and the back close by",
        ),
    )
    return with_common({"target": target, "view": _VIEWS[view], "convention": convention})
