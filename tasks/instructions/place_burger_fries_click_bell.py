"""Templates of Place_Burger_Fries_Click_Bell: onto {tray}, a click of {bell}, and back again."""

from __future__ import annotations

from robospa.tasks.instructions.chains import chained
from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.place_clauses import placing

_STEPS = (
    (
        "put {burger} on {tray}",
        "put {fries} on the right half",
        "press {bell}",
        "put {burger} back in its old place",
        "put {fries} back too",
    ),
    (
        "place {burger} on {tray}",
        "place {fries} on the right-hand half",
        "click {bell}",
        "return {burger} to where it was",
        "do the same with {fries}",
    ),
    (
        "set {burger} onto {tray}",
        "set {fries} onto the right part",
        "ring {bell}",
        "take {burger} back to its first spot",
        "take {fries} back likewise",
    ),
    (
        "serve {burger} on {tray}",
        "serve {fries} on the right",
        "tap {bell}",
        "bring {burger} back to where it came from",
        "bring {fries} back as well",
    ),
    (
        "move {burger} onto {tray}",
        "move {fries} onto the right side",
        "push {bell}",
        "move {burger} back to its starting place",
        "move {fries} back to its own",
    ),
)
_RESULTS = (
    "{burger} set on {tray}",
    "{fries} brought to the tray's right half",
    "{bell} pressed",
    "{burger} put back where it was",
    "{fries} put back in its own place",
)
_EVENTS = (
    "{burger} going onto {tray}",
    "{fries} going onto the tray's right half",
    "a press of {bell}",
    "{burger} going back to its place",
    "{fries} going back to its own place",
)


def templates(level: int) -> Templates:
    """The first `level` steps of the sequence."""
    if level == 1:
        return templates_of(*placing("{burger}", "{tray}"))
    return chained([steps[:level] for steps in _STEPS], _RESULTS[:level], _EVENTS[:level])
