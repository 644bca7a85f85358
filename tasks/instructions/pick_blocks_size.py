"""Templates of the tasks of Geometric Attribute Cognition: {block} says which one.

"the 3rd largest block" or "the tallest block"; {measure}, {how}, {most} and {least} are words about
what is compared ("size", "big each block is", "largest", "smallest").
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_TRAIN = (
    "pick up {block}.",
    "lift {block} off {table}.",
    "grab {block} and raise it above {table}.",
    "take {block} from {table} with {arm}.",
    "use {arm} to pick up {block}.",
    "compare the {measure}s of the blocks, then pick up {block}.",
    "find {block} and lift it.",
    "look at how {how} and lift {block}.",
    "with {arm}, raise {block} clear of {table}.",
    "reach for {block}, grip it, and bring it up.",
    "close a gripper around {block} and lift.",
    "sort the blocks by {measure} in your head and grab {block}.",
    "locate {block} on {table}, then pick it up.",
    "rank the blocks from {most} to {least} and take {block}.",
    "hoist {block} into the air using {arm}.",
    "grasp {block} firmly and move it upward.",
    "please pick {block} up from {table}.",
    "judge the blocks by {measure} alone and remove {block} from {table}.",
    "have {arm} grasp {block} and lift it.",
    "move a gripper to {block}, close it, and go up.",
    "get {block} off {table}.",
    "leave the rest where it lies and pick up {block}.",
    "use {measure} to identify {block} and raise it with {arm}.",
    "ignore where the blocks lie; lift {block}.",
    "measure the blocks by eye, choose {block}, and lift it up.",
    "go to {block} and pick it up with {arm}.",
    "collect {block} from {table} and hold it up.",
    "hold {block} above {table} after picking it up.",
    "single out {block} and take it off {table}.",
    "guide {arm} to {block}, grasp it, and raise it.",
    "order the blocks by {measure}, {most} first, and pick {block}.",
    "choose {block} and nothing else; lift it from {table}.",
    "check each block's {measure} before you lift {block}.",
    "bring {block} up into the air.",
    "pinch {block} between the fingers of {arm} and lift it.",
    "seize {block}, then raise it well above {table}.",
    "{measure} is what counts: pick up {block}.",
    "among the blocks on {table}, grab {block}.",
    "from the blocks in front of you, take {block} with {arm}.",
    "with {measure} in mind, select {block} and lift it away from {table}.",
    "without touching the rest, pick up {block}.",
    "lower {arm} onto {block}, close the gripper, and lift.",
    "spot {block}, grip it, and carry it upward.",
    "scan the blocks on {table} and fetch {block}.",
    "elevate {block} using {arm}.",
    "target {block}: grasp it and raise it.",
    "do a {measure} comparison first and then seize {block}.",
    "work out which one is {block} and lift it up.",
    "pull {block} up from {table} with {arm}.",
    "now pick {block} and keep it in the air.",
)

_HELDOUT = (
    "what I need is for {block} to be raised off {table}.",
    "could {block} be lifted from {table}, please?",
    "the one to end up in a gripper, high above {table}, is {block}.",
    "for this trial to succeed, {block} has to be lifted by {arm}.",
    "I would like {block} to be held in the air by {arm}.",
    "if only one may leave {table}, it must be {block}.",
    "my wish is that {block} rises from {table} while the rest stays put.",
    "going by {measure}, it is {block} that should come up from {table}.",
    "which one leaves {table}? That would be {block}.",
    "the goal is reached once {block} hangs in the gripper of {arm}.",
)


def templates(level: int) -> Templates:
    """The same at every level: the wording holds for any number of blocks."""
    return templates_of(_TRAIN, _HELDOUT)
