"""Templates of Pick_Mixed_Objects_Canonical_A: a place in a grid, counted in given directions.

Level 1 has a single row, so its sentences name a place in the line; from level 2 on they name a
row and a place in it. Every sentence says that the robot is the viewer ({viewer}).
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import named, wrapped

WRAPPERS = (
    "{viewer}, <C>.",
    "counting {viewer}, <C>.",
    "view the objects {viewer}, then <C>.",
    "read the arrangement {viewer}; <C>.",
    "with positions counted {viewer}, <C>.",
    "<C>, counting {viewer}.",
    "<C>, with directions taken {viewer}.",
    "take directions {viewer}: <C>.",
    "<C>; positions are meant {viewer}.",
    "please <C>, judging positions {viewer}.",
)

_LINE = (
    "the {column} object {column_direction}",
    "the {column} item {column_direction}",
    "the object that is {column} {column_direction}",
)
_GRID = (
    "the {column} object {column_direction} in the {row} row {row_direction}",
    "the object in the {row} row {row_direction} and the {column} column {column_direction}",
    "the {column} item {column_direction} within the {row} row {row_direction}",
)

_LINE_HELDOUT = (
    "the object in {column} position {column_direction}",
    "the thing found {column} {column_direction}",
)
_GRID_HELDOUT = (
    "the object where the {row} row {row_direction} meets the {column} column {column_direction}",
    "the thing found {column} {column_direction} along the {row} row {row_direction}",
)

HELDOUT = (
    "what I need, with places read {viewer}, is for <X> to be raised.",
    "could <X> be brought up for me, with positions read {viewer}?",
    "seen {viewer}, <X> should be off {table} in the end.",
    "the goal, counting {viewer}, is a gripper holding <X>.",
    "I would like <X> to be raised, the count being made {viewer}.",
    "if the count is made {viewer}, it is <X> that has to go up.",
    "<X> has to leave {table}; the order is as it appears {viewer}.",
    "which one should go up? Counted {viewer}, it is <X>.",
    "success requires {arm} to hold <X>, positions being those seen {viewer}.",
    "it would help if {arm} held <X>, as counted {viewer}.",
)


def templates(level: int) -> Templates:
    """A line of objects at level 1, a grid from level 2 on."""
    if level == 1:
        return templates_of(wrapped(WRAPPERS, _LINE), named(HELDOUT, _LINE_HELDOUT))
    return templates_of(wrapped(WRAPPERS, _GRID), named(HELDOUT, _GRID_HELDOUT))
