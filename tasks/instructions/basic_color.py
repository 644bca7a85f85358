"""Templates of the basic tasks about colour: {target} is "the red block" or "the red object"."""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.pick_clauses import CLAUSES, named

_HELDOUT = (
    "what has to come off {table} is {target}.",
    "would you mind bringing {target} up from {table}?",
    "what {arm} should carry upward is {target}.",
    "if color decides what leaves {table}, it must be {target}.",
    "{target} is wanted in the air, held by {arm}.",
    "my request is that {arm} lifts {target} and that all else stays.",
    "which item should go up with {arm}? It is {target}.",
    "success means that {target} hangs clear of {table}.",
    "by the end, {target} must no longer touch {table}.",
    "there is one thing for {arm} to lift, and that is {target}.",
)


def templates(level: int) -> Templates:
    """The same at every level: a colour is a colour among any number."""
    return templates_of((f"{c}." for c in named(CLAUSES, ("{target}",))), _HELDOUT)
