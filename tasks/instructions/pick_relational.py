"""Templates of the relational tasks, with the object's name as a slot ({noun}).

The frames are those of Pick_Soaps_Relational: every sentence says whose directions are meant and
what front and back mean ({convention}).
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import named, wrapped
from robospa.tasks.instructions.pick_soaps_relational import HELDOUT, WRAPPERS

_NAMES = (
    "the {noun} {relation} {reference}",
    "the one {relation} {reference}",
    "the one that is {relation} {reference}",
)

_NAMES_HELDOUT = ("the {noun} {relation} {reference}", "the {noun} that is {relation} {reference}")


def templates(level: int) -> Templates:
    """The same at every level: what differs is inside the slots."""
    return templates_of(wrapped(WRAPPERS, _NAMES), named(HELDOUT, _NAMES_HELDOUT))
