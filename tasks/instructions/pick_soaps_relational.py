"""Templates of Pick_Soaps_Relational: the soap bar on one side of another one.

Every sentence says whose directions are meant and what front and back mean ({convention}), because
the official convention (front = far from the robot) is not the everyday one. That the neighbour is
meant, and not a bar further out, is in {relation} ("directly", "immediately").
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import named, wrapped

WRAPPERS = (
    "seen from the robot, {convention}; <C>.",
    "<C>, using the robot's directions, where {convention}.",
    "take the robot's viewpoint, where {convention}, then <C>.",
    "with the robot as the viewer, so that {convention}, <C>.",
    "<C>. From the robot's side, {convention}.",
    "<C>, given that {convention} as the robot sees it.",
    "all directions are the robot's, so {convention}; <C>.",
    "remember that {convention} from the robot's viewpoint, then <C>.",
    "<C>; for the robot, {convention}.",
    "since {convention} when seen from the robot, <C>.",
)

_NAMES = (
    "the soap bar {relation} {reference}",
    "the one {relation} {reference}",
    "the soap that is {relation} {reference}",
)

_NAMES_HELDOUT = ("the soap bar {relation} {reference}", "the bar {relation} {reference}")

HELDOUT = (
    "what I need is for <X> to be raised, with directions as the robot has them: {convention}.",
    "could <X> be brought up for me, if the robot is the viewer and {convention}?",
    "if the robot does the looking and {convention}, then <X> should be off {table}.",
    "the goal, in the robot's own terms, where {convention}, is a gripper holding <X>.",
    "I would like {arm} to hold up <X>; to the robot, {convention}.",
    "the robot is the viewer here, and {convention}. It is <X> that has to go up.",
    "<X> has to leave {table}, with directions as the robot sees them, so {convention}.",
    "which one should go up? It is <X>, from the robot's view, where {convention}.",
    "success requires {arm} to hold <X>, in the robot's terms: {convention}.",
    "it would help if {arm} held <X>; to the robot's eyes, {convention}.",
)


def templates(level: int) -> Templates:
    """The same at every level: what differs is inside the slots."""
    return templates_of(wrapped(WRAPPERS, _NAMES), named(HELDOUT, _NAMES_HELDOUT))
