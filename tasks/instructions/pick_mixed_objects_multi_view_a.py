"""Templates of Pick_Mixed_Objects_Multi_View_A: the extreme object, named from a viewpoint.

Every sentence says where the viewer is ({view}) and what front and back mean to that viewer
({convention}); the picture that the robot gets is always its own.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import named, wrapped

_WRAPPERS = (
    "seen {view}, where {convention}, <C>.",
    "looking {view}, <C>; {convention}.",
    "imagine the scene {view}, where {convention}, then <C>.",
    "<C>, as judged {view}, where {convention}.",
    "picture the scene {view}; {convention}. Then <C>.",
    "assume a viewer looking {view}; {convention}. Now <C>.",
    "<C>. The scene is viewed {view}, and {convention}.",
    "judge positions {view}, where {convention}: <C>.",
    "as if looking {view}, where {convention}, <C>.",
    "<C>, with positions as they appear {view}; {convention}.",
)

_NAMES = ("{target}",)

_HELDOUT = (
    "what I need is <X> raised, the viewer looking {view}; {convention}.",
    "could <X> be brought up for me, if one looks {view} and {convention}?",
    "to someone looking {view}, <X> should be off {table} in the end; {convention}.",
    "the goal is a gripper holding <X> as seen {view}; {convention}.",
    "I would like to see <X> in the air; the scene is described {view}, so {convention}.",
    "if one looks {view}, it is <X> that has to go up; {convention}.",
    "<X> has to leave {table}; that is its place when viewed {view}, and {convention}.",
    "which one should go up when the view is {view}? It is <X>; {convention}.",
    "success requires {arm} to hold <X> as named {view}; {convention}.",
    "viewed {view}, <X> is the one wanted in the grip of {arm}; {convention}.",
)


def templates(level: int) -> Templates:
    """The same at every level: the wording holds for any number of objects."""
    return templates_of(wrapped(_WRAPPERS, _NAMES), named(_HELDOUT, _NAMES))
