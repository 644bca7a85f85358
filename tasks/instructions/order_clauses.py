"""Templates of clicking several different things: {order} lists them from the first to the last."""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.press_clauses import sentences_about

_TRAIN = (
    "click {order}.",
    "press {order}.",
    "click these in order: {order}.",
    "tap {order}, in this order.",
    "press the objects one after another: {order}.",
    "use a closed gripper to click {order}.",
    "with the gripper closed, press {order}.",
    "go through the objects on {table} and click {order}.",
    "touch the tops of these in sequence: {order}.",
    "keep to this sequence and press {order}.",
    "follow this order and click each once: {order}.",
    "push down on {order}.",
    "press each object once, in this order: {order}.",
    "click once on each: {order}.",
    "find and press {order}.",
    "move from one object to the next and click {order}.",
    "start pressing and take the objects in this order: {order}.",
    "please click {order}, and then stop.",
    "poke these from above in order: {order}.",
    "visit the objects in sequence and press each: {order}.",
    "close the grippers, then click {order}.",
    "work through this list and click everything on it: {order}.",
    "give one press each to {order}, in order.",
    "lower a closed gripper onto {order}.",
    "treat the objects as buttons and push {order}.",
    "click all objects on {table} in the following order: {order}.",
    "hit gently from above, in this order, {order}.",
    "press on top of {order}.",
    "carry out one click after another: {order}.",
    "perform a press on each of these in turn: {order}.",
    "reach out and tap {order}.",
    "mind the order and press {order}.",
    "let a closed gripper touch {order}.",
    "bring the fingertips down on {order}, one at a time.",
    "deal with {order}, in this sequence, clicking each.",
    "apply one press to {order}, taking them in turn.",
    "complete these clicks in order: {order}.",
    "choose the nearer arm each time and click {order}.",
    "execute this click sequence: {order}.",
    "never change the order while you press {order}.",
    "make a clicking tour: {order}.",
    "locate the objects and press them in this order: {order}.",
    "with closed fingers, descend on {order}.",
    "click in sequence, each object once: {order}.",
    "one by one, press {order}.",
    "step through {order}, tapping each of them.",
    "respect this order when you click the objects: {order}.",
    "take your time and press {order}.",
    "push each thing down once, in the sequence given here: {order}.",
    "trigger each in turn by pressing from above: {order}.",
)

_HELDOUT = (
    "what I need is this sequence of clicks: {order}.",
    "could the objects be clicked in this order: {order}?",
    "the order in which things should be pressed is {order}.",
    "the goal is for every object to have been clicked, in turn: {order}.",
    "I would like to see the following pressed in turn: {order}.",
    "if the clicks came in this order, {order}, the task is complete.",
    "to finish this task, the clicks have to come like this: {order}.",
    "which object is pressed when? The order is {order}.",
    "success requires a click on each object, namely {order}.",
    "{order}: it is in this order that the objects must be touched from above.",
)


def templates(level: int) -> Templates:
    """One press at level 1, a sequence from level 2 on."""
    return templates_of(*sentences_about("{thing}")) if level == 1 else _SEVERAL


_SEVERAL = templates_of(_TRAIN, _HELDOUT)
