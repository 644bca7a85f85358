"""Fifty ways to ask for an object to be lifted, as imperative clauses.

"<X>" stands for the noun phrase that names the object. The tasks that need to say more than that
(a viewpoint, what front and back mean) wrap each clause into a sentence of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

CLAUSES = (
    "pick up <X>",
    "lift <X>",
    "grab <X>",
    "take hold of <X> and raise it",
    "use {arm} to pick up <X>",
    "use {arm} to lift <X>",
    "find <X> and pick it up",
    "locate <X>, then lift it",
    "reach for <X> and bring it up",
    "close a gripper on <X> and lift it",
    "move {arm} to <X> and pick it up",
    "have {arm} lift <X>",
    "raise <X> above {table}",
    "take <X> off {table}",
    "grasp <X> and hold it up",
    "select <X> and raise it with {arm}",
    "go to <X>, grip it, and lift",
    "fetch <X> with {arm}",
    "hoist <X> into the air",
    "get hold of <X> and lift it clear of {table}",
    "choose <X> and lift nothing else",
    "identify <X> and pick it up with {arm}",
    "seize <X> and carry it upward",
    "single out <X>, then lift it",
    "guide {arm} to <X>, grasp it, and raise it",
    "let {arm} grab <X> and lift it",
    "pinch <X> between the gripper fingers and lift it",
    "lower {arm} onto <X>, close the gripper, and go up",
    "search {table} for <X> and pick it up",
    "leave everything else in place and pick up <X>",
    "lift <X> without touching the rest",
    "pick up only <X>",
    "elevate <X> with {arm}",
    "steer a gripper over <X>, close it, and rise",
    "spot <X> and grab it",
    "collect <X> with {arm}",
    "secure <X> in a gripper and lift it off {table}",
    "get <X> into the air",
    "bring {arm} down to <X> and lift it",
    "make out <X> and raise it",
    "clasp <X> and move it straight up",
    "lift up <X> with {arm}",
    "aim for <X>, grip it, and hold it in the air",
    "look for <X> and lift it from {table}",
    "target <X> and pick it up",
    "approach <X> with {arm} and lift it",
    "firmly grip <X> and raise it",
    "pull <X> up from {table}",
    "catch <X> between the fingers of {arm} and lift it",
    "lift <X> and keep it up",
)


def wrapped(wrappers: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Fifty templates: clause i inside wrapper ("<C>") and around noun phrase ("<X>") by turns.

    Steps of 3 and 1 through lists of co-prime lengths spread the combinations evenly.
    """
    made = []
    for i, clause in enumerate(CLAUSES):
        sentence = wrappers[3 * i % len(wrappers)].replace("<C>", clause)
        made.append(sentence.replace("<X>", names[(i + i // len(names)) % len(names)]))
    return tuple(made)


def named(templates: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """`templates` with "<X>" replaced by the noun phrases by turns."""
    return tuple(t.replace("<X>", names[i % len(names)]) for i, t in enumerate(templates))
