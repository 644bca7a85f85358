"""Fifty ways to ask for one press from above, as imperative clauses; "<X>" is what is pressed."""

from __future__ import annotations

PRESS_ONCE = (
    "press <X>",
    "push <X> down",
    "press <X> once",
    "press <X> with {arm}",
    "give <X> one press",
    "give <X> a single push with {arm}",
    "apply one press to <X>",
    "press down on <X> with {arm}",
    "move a gripper onto <X> and press",
    "tap <X> from above with {arm}",
    "lower {arm} until it presses <X>",
    "hover over <X>, then push it down",
    "touch the top of <X> with a closed gripper",
    "aim at <X> and press it",
    "locate <X> on {table} and push it",
    "close a gripper, then use it to push <X>",
    "make one press on <X>",
    "let {arm} come down on <X>",
    "approach <X> from above and press",
    "put a gripper on top of <X> and push",
    "bring {arm} to <X> and press it down",
    "use a closed gripper to press <X>",
    "push once on <X>, using {arm}",
    "look for <X> and press it down",
    "descend onto <X> with {arm} and press",
    "use {arm} to press <X>",
    "push down on <X> one time",
    "tap the top of <X>",
    "with {arm}, push <X> downward",
    "reach over to <X> and press it once",
    "find <X> on {table} and give it a press",
    "bring a gripper down onto <X> once",
    "press the top of <X> down",
    "move {arm} above <X>, then straight down to press it",
    "please press <X> and then stop",
    "click <X> one time",
    "touch <X> from above with a gripper",
    "make {arm} press <X>",
    "locate <X>, then press it from above",
    "have {arm} push <X> down",
    "hit the top of <X> gently",
    "press down once on <X>",
    "click the top of <X> with {arm}",
    "lower a gripper onto <X>",
    "depress <X> with {arm}",
    "go to <X> and press it a single time",
    "poke the top of <X> with {arm}",
    "reach out and push <X> with the fingertips",
    "position {arm} over <X> and press down",
    "treat <X> like a button and push it",
)

ONCE_HELDOUT = (
    "what I need is <X> pressed by {arm}.",
    "could <X> be pressed by {arm}?",
    "<X> should be pressed from above by {arm}.",
    "the goal is for <X> to have been pushed down by {arm}.",
    "I would like to see <X> pressed, {arm} doing the work.",
    "if {arm} has pressed <X>, the task is complete.",
    "to finish this task, <X> has to be pushed down by {arm}.",
    "what has to go down? It is <X>, pushed by {arm}.",
    "one press of <X> by {arm} is all that is wanted.",
    "my request is for <X> to receive a push by {arm}.",
)


def sentences_about(name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(train, held-out) templates of a single press of `name`, a slot such as "{can}"."""
    train = tuple(clause.replace("<X>", name) + "." for clause in PRESS_ONCE)
    return train, tuple(sentence.replace("<X>", name) for sentence in ONCE_HELDOUT)
