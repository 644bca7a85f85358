"""Phrasings of the slots of tasks in which several things are clicked or pressed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robospa.tasks.instructions.words import NUMBERS, Slots, listed, ordinal, with_common

NOUNS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "alarm_clock": (
        ("the alarm clock", "the clock"),
        ("the twin-bell clock", "the bedside clock", "the clock with two bells", "the alarm"),
    ),
    "stapler": (
        ("the stapler", "the desk stapler"),
        ("the paper stapler", "the stapling device", "the stapling tool", "the office stapler"),
    ),
    "can": (
        ("the can", "the drink can"),
        ("the soda can", "the beverage can", "the tin can", "the drinks tin"),
    ),
    "playing_cards": (
        ("the playing cards", "the deck of cards"),
        ("the card deck", "the pack of cards", "the card pack", "the deck of playing cards"),
    ),
    "bread": (
        ("the bread", "the piece of bread"),
        ("the bread item", "the baked bread", "the bakery item", "the baked item"),
    ),
    "bell": (
        ("the bell", "the call bell"),
        ("the desk bell", "the reception bell", "the service bell", "the counter bell"),
    ),
}
"""Nouns of what can be clicked, by asset."""

_TRAIN_LINKS = (", then ", ", and then ")
_HELD_LINKS = (" followed by ", ", next ", ", after that ")


def click_in_order(assets: Sequence[str]) -> Slots:
    """{order}: the things from the first to the last; {thing} instead if there is only one."""
    if len(assets) == 1:
        return with_common({"thing": NOUNS[assets[0]]})
    return with_common({"order": _chained([NOUNS[a] for a in assets])})


def _chained(
    nouns: Sequence[tuple[tuple[str, ...], tuple[str, ...]]],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    train = tuple(
        link.join(noun[0][k] for noun in nouns) for k in range(2) for link in _TRAIN_LINKS
    )
    held = tuple(link.join(noun[1][k] for noun in nouns) for k in range(4) for link in _HELD_LINKS)
    return train, held


def ring_of_bells(count: int) -> Slots:
    """{thing} for one bell, {order} for two, {bells} and {way} for a ring of more."""
    if count == 1:
        return click_in_order(["bell"])
    if count == 2:
        far = (
            ("the bell farther from the robot", "the far bell"),
            ("the bell at the far side", "the more distant bell", "the bell further away",
             "the farther one of the two bells"),
        )  # fmt: skip
        near = (
            ("the bell closer to the robot", "the near bell"),
            ("the bell at the near side", "the less distant bell", "the bell closer by",
             "the nearer one of the two bells"),
        )  # fmt: skip
        return with_common({"order": _chained([far, near])})
    number = NUMBERS[count]
    return with_common(
        {
            "bells": (
                (f"the {number} bells", f"all {count} bells"),
                (f"each of the {number} bells", f"every one of the {count} bells",
                 f"all {number} of the bells"),
            ),
            "way": (
                (
                    "clockwise as seen from above, starting with the bell farthest from the robot",
                    "in clockwise order seen from above, beginning at the bell farthest from "
                    "the robot",
                ),
                (
                    "one after another clockwise, looking down on the table, the farthest bell "
                    "being first",
                    "in turn, clockwise when viewed from above, from the most distant bell on",
                    "following the direction of a clock's hands seen from above, with the bell "
                    "most distant from the robot first",
                    "clockwise in a top view, where the bell at the greatest distance from the "
                    "robot comes first",
                ),
            ),
        }
    )  # fmt: skip


def staplers_in_a_row(counts: Sequence[int]) -> Slots:
    """{counts}, from left to right, and {number}; for one stapler {stapler} and {times}."""
    if len(counts) == 1:
        train, held = _times(counts[0])
        return with_common({"stapler": NOUNS["stapler"], "times": (train, held)})
    words = [_times(n)[0][0] for n in counts]
    ranks = [f"the {ordinal(i)[1]} {word}" for i, word in enumerate(words, 1)]
    places = [f"number {i} {word}" for i, word in enumerate(words, 1)]
    each = [f"the {ordinal(i)[1]} one {word}" for i, word in enumerate(words, 1)]
    return with_common(
        {
            "counts": (
                (listed(ranks), ", ".join(ranks)),
                (listed(places), ", ".join(places), listed(each)),
            ),
            "row": (
                ("from left to right", "counting from the left"),
                (
                    "numbered from the left",
                    "going from the left end to the right end",
                    "starting at the left end",
                    "in left-to-right numbering",
                ),
            ),
        }
    )


def _times(count: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    word = NUMBERS[count]
    plain = {1: ("once", "one time"), 2: ("twice", "two times")}.get(
        count, (f"{word} times", f"{count} times")
    )
    return plain, (
        f"exactly {plain[0]}",
        f"just {plain[1]}",
        f"{plain[0]} in total",
        f"{plain[0]} and not more",
    )
