"""Templates of the tasks of Spatial Distance Estimation: the {object} {rank} from the {reference}.

Among mixed objects the category of the target is never named; the reference is not counted.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_TRAIN = (
    "pick up the {object} {rank} from the {reference}.",
    "lift the {object} that is {rank} from the {reference}.",
    "use {arm} to grab the {object} {rank} from the {reference}.",
    "measure each distance to the {reference} and take the {object} {rank} from it.",
    "find the {reference}, then lift the {object} {rank} from it.",
    "starting at the {reference}, look outward and pick up the item {rank} from it.",
    "with {arm}, raise the item {rank} from the {reference}.",
    "grab whichever {object} lies {rank} from the {reference}.",
    "take the thing {rank} from the {reference} off {table}.",
    "look where the {reference} is and pick up the {object} {rank} from there.",
    "compare how far things are from the {reference}; lift the one {rank} from it.",
    "leave the {reference} alone and lift the {object} {rank} from it.",
    "grasp the {object} {rank} from the {reference} and bring it up.",
    "locate the item {rank} from the {reference} and pick it up with {arm}.",
    "rank the {object}s by distance, farthest first, and grab the one {rank} from the {reference}.",
    "remove from {table} the {object} that lies {rank} from the {reference}.",
    "go to the {object} {rank} from the {reference}, close the gripper on it, and lift.",
    "hoist the {object} {rank} from the {reference} into the air.",
    "please pick up the item that stands {rank} from the {reference}.",
    "treat the {reference} as the origin and lift the {object} {rank} from it.",
    "choose the {object} {rank} from the {reference} and raise it above {table}.",
    "keep the {reference} in place; pick up the {object} {rank} from it.",
    "have {arm} fetch the item {rank} from the {reference}.",
    "judge distances from the {reference}, then seize the {object} {rank} from it.",
    "reach out and pick the {object} {rank} from the {reference}.",
    "measuring from the {reference}, find the {object} that is {rank} and lift it up.",
    "move {arm} to the {object} {rank} from the {reference} and pick it up.",
    "select the {object} positioned {rank} from the {reference}, then raise it.",
    "get hold of the item {rank} from the {reference} and hold it up.",
    "seize the {object} {rank} from the {reference} and carry it upward.",
    "check which {object} is {rank} from the {reference} and pick up that one.",
    "collect the {object} that sits {rank} from the {reference}, using {arm}.",
    "point {arm} at the {object} {rank} from the {reference}, grasp it, and lift it.",
    "skip the {reference} itself and grab the {object} {rank} from it.",
    "lift one {object} only: the one {rank} from the {reference}.",
    "order everything by distance from the {reference} and pick up the {object} {rank} from it.",
    "with the {reference} as the starting point, pick up the {object} {rank} from it.",
    "use distance from the {reference} as your guide and lift the {object} {rank} from it.",
    "bring up the {object} lying {rank} from the {reference}.",
    "single out the item {rank} from the {reference} and lift it with {arm}.",
    "gauge by eye which {object} is {rank} from the {reference}, and raise it.",
    "pull the {object} {rank} from the {reference} up off {table}.",
    "identify the {reference} first; after that pick up the {object} {rank} from it.",
    "scan {table} for the {object} {rank} from the {reference} and pick it up.",
    "close a gripper on the item {rank} from the {reference} and take it up.",
    "without moving the {reference}, lift the {object} {rank} from it.",
    "take note of the {reference}, then grab the {object} {rank} from it with {arm}.",
    "elevate the {object} that is {rank} from the {reference}.",
    "pinch the {object} {rank} from the {reference} and raise it clear of {table}.",
    "distance decides: lift the {object} {rank} from the {reference}.",
)

_HELDOUT = (
    "what I need is the {object} {rank} from the {reference}, lifted clear of {table}.",
    "could I have the {object} {rank} from the {reference} held up in the air, please?",
    "the {object} that lies {rank} from the {reference} should be in a gripper, above {table}.",
    "the {reference} serves as the reference; what has to rise is the {object} {rank} from it.",
    "I would like the {object} {rank} from the {reference} to be held in the air.",
    "if you measured from the {reference}, the {object} found {rank} would be the one to lift.",
    "being {rank} from the {reference} is what marks the {object} that must go up.",
    "which {object} should leave {table}? The one {rank} from the {reference}.",
    "the goal is a gripper holding the {object} {rank} from the {reference}.",
    "in the end, the {object} {rank} from the {reference} must be off {table}.",
)


def templates(level: int) -> Templates:
    """The same at every level: the wording holds for any number of things."""
    return templates_of(_TRAIN, _HELDOUT)
