"""Templates of Pick_Soaps_Relational: the soap bar on one side of another one.

Every sentence says whose directions are meant and what front and back mean ({convention}), because
the official convention (front = far from the robot) is not the everyday one. That the neighbour is
meant, and not a bar further out, is in {relation} ("directly", "immediately").
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import named, wrapped

REQUIRED = ("relation", "reference", "convention")

_WRAPPERS = (
    "given that {convention}, <C>.",
    "<C>, where {convention}.",
    "note that {convention}, and <C>.",
    "remember that {convention}; <C>.",
    "<C>; here {convention}.",
    "<C>. In this scene, {convention}.",
    "<C>, bearing in mind that {convention}.",
    "assuming that {convention}, <C>.",
    "keep in mind that {convention}, then <C>.",
    "since {convention}, <C>.",
)

_NAMES = (
    "the soap bar {relation} {reference}",
    "the one {relation} {reference}",
    "the soap that is {relation} {reference}",
)

_NAMES_HELDOUT = ("the soap bar {relation} {reference}", "the bar {relation} {reference}")

_HELDOUT = (
    "what I need is <X> raised off {table}, and {convention}.",
    "could <X> be brought up for me, if {convention}?",
    "if {convention}, then <X> should be off {table} in the end.",
    "the goal, in which {convention}, is a gripper holding <X>.",
    "I would like to see <X> in the air; as for words, {convention}.",
    "the convention is this: {convention}. It is <X> that has to go up.",
    "<X> has to leave {table}, with the understanding that {convention}.",
    "which one should go up? It is <X>, and {convention}.",
    "success requires {arm} to hold <X>, provided {convention}.",
    "it would help to have <X> in the grip of {arm}; {convention}.",
)


def templates(level: int) -> Templates:
    """The same at every level: what differs is inside the slots."""
    return templates_of(wrapped(_WRAPPERS, _NAMES), named(_HELDOUT, _NAMES_HELDOUT))
