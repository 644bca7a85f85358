"""Templates of Click_Bell_Clockwise_Order: one bell, a far and a near one, or a ring of {bells}.

In a ring, {way} says which way round and where to start.
"""

from __future__ import annotations

from robospa.tasks.instructions import order_clauses
from robospa.tasks.instructions.grammar import Templates, templates_of

_DEEDS = (
    "click {bells}",
    "press {bells}",
    "ring {bells}",
    "tap {bells} from above",
    "push down {bells}",
    "touch the buttons of {bells}",
    "sound {bells}",
    "click once on {bells}",
    "hit the buttons of {bells} gently",
    "press {bells} with a closed gripper",
    "use closed grippers to ring {bells}",
    "go around the ring and click {bells}",
    "strike {bells} lightly",
    "work around {bells} and press each once",
    "give a press to {bells}",
    "visit {bells} on {table} and tap each",
    "make {bells} ring",
    "lower a closed gripper onto {bells}",
    "poke {bells} on top",
    "trigger {bells}",
    "activate {bells} by pressing them",
    "walk round {bells}, pressing each",
    "treat {bells} as buttons and push them",
    "let a gripper touch {bells}",
    "bring the fingertips down on {bells}",
)

_HELDOUT = (
    "what I need is a click on {bells}, {way}.",
    "could {bells} be rung {way}?",
    "{bells} should be pressed {way}.",
    "the goal is for {bells} to have been rung {way}.",
    "I would like to hear {bells} ring {way}.",
    "if presses have reached {bells} {way}, the task is complete.",
    "to finish this task, one has to click {bells} {way}.",
    "in which order must {bells} be touched? The answer is this: {way}.",
    "success requires a press of {bells}, {way}.",
    "my request is for {bells} to be sounded {way}.",
)


def templates(level: int) -> Templates:
    """One bell, two bells by distance, a ring."""
    return order_clauses.templates(level) if level < 3 else _RING


_RING = templates_of(
    [f"{deed}, {{way}}." for deed in _DEEDS] + [f"{{way}}, {deed}." for deed in _DEEDS], _HELDOUT
)
