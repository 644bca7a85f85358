"""Templates of Place_Object_Scale_Click: {bell}, {object}, a click of {cards}, and back again."""

from __future__ import annotations

from robospa.tasks.instructions.chains import chained
from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.place_clauses import placing

_STEPS = (
    (
        "put {bell} on {scale}",
        "put {object} on {stand}",
        "press {cards}",
        "put {bell} back on {table}",
        "put {object} back there too",
    ),
    (
        "place {bell} onto {scale}",
        "place {object} onto {stand}",
        "click {cards}",
        "return {bell} to {table}",
        "return {object} likewise",
    ),
    (
        "set {bell} on {scale}",
        "stand {object} on {stand}",
        "tap {cards}",
        "set {bell} back down on {table}",
        "set {object} back down there",
    ),
    (
        "move {bell} onto {scale}",
        "move {object} onto {stand}",
        "push down on {cards}",
        "move {bell} back to {table}",
        "move {object} back as well",
    ),
    (
        "weigh {bell} on {scale}",
        "present {object} on {stand}",
        "touch {cards} from above",
        "bring {bell} back onto {table}",
        "bring {object} back too",
    ),
)
_RESULTS = (
    "{bell} set on {scale}",
    "{object} set on {stand}",
    "{cards} pressed",
    "{bell} put back on {table}",
    "{object} put back there",
)
_EVENTS = (
    "{bell} going onto {scale}",
    "{object} going onto {stand}",
    "a press of {cards}",
    "{bell} going back to {table}",
    "{object} going back to {table}",
)


def templates(level: int) -> Templates:
    """The first `level` steps of the sequence."""
    if level == 1:
        return templates_of(*placing("{bell}", "{scale}"))
    return chained([steps[:level] for steps in _STEPS], _RESULTS[:level], _EVENTS[:level])
