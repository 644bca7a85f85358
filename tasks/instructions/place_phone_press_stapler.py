"""Templates of Place_Phone_Press_Stapler: {phone} onto {stand}, {stapler} {times}, empty {bin}."""

from __future__ import annotations

from robospa.tasks.instructions.chains import chained
from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.place_clauses import placing

_STEPS = (
    (
        "put {phone} on {stand}",
        "press {stapler} {times}",
        "empty {bin} into {dustbin}",
    ),
    (
        "place {phone} onto {stand}",
        "push down {stapler} {times}",
        "tip out {bin} over {dustbin}",
    ),
    (
        "set {phone} on {stand}",
        "press down on {stapler} {times}",
        "pour out {bin} above {dustbin}",
    ),
    (
        "prop {phone} up on {stand}",
        "push {stapler} {times}",
        "dump what is in {bin} into {dustbin}",
    ),
    (
        "pick up {phone} and rest it on {stand}",
        "tap the top of {stapler} {times}",
        "turn {bin} over above {dustbin}",
    ),
)
_RESULTS = (
    "{phone} set on {stand}",
    "{stapler} pressed {times}",
    "{bin} emptied into {dustbin}",
)
_EVENTS = (
    "{phone} going onto {stand}",
    "{stapler} going down {times}",
    "{bin} being emptied into {dustbin}",
)


def templates(level: int) -> Templates:
    """The phone alone at level 1, presses too up to 4, all three steps at 5."""
    if level == 1:
        return templates_of(*placing("{phone}", "{stand}"))
    n = 2 if level < 5 else 3
    return chained([steps[:n] for steps in _STEPS], _RESULTS[:n], _EVENTS[:n])
