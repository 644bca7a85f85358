"""Templates of Move_Playing_Cards_Away: {boxes} go {out}, where they then are {at}.

Level 1 has one {box}. Any side will do; that it has to be far out is said in every sentence.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_BOTH = (
    "move <X> {out}.",
    "take <X> {out}.",
    "carry <X> {out}.",
    "clear the middle of {table}: move <X> {out}.",
    "bring <X> {out}.",
    "shift <X> {out}.",
    "transfer <X> {out}.",
    "relocate <X> {out}.",
    "get <X> {out}.",
    "put <X> down {at}.",
    "place <X> {at}.",
    "free the middle of {table} by taking <X> {out}.",
    "haul <X> {out}.",
    "leave <X> {at}.",
    "set <X> down {at}.",
    "remove <X> from the middle, moving {out}.",
    "transport <X> {out}.",
    "pick up and carry <X> {out}.",
    "lift and move <X> {out}.",
    "grasp <X> and move {out}.",
    "please move <X> {out}.",
    "deposit <X> {at}.",
    "drop off <X> {at}.",
    "tidy up: put <X> {at}.",
    "make room in the middle by moving <X> {out}.",
    "deliver <X> {out}.",
    "send <X> {out}.",
    "store <X> {at}.",
    "keep the middle of {table} empty; take <X> {out}.",
    "push or carry <X> {out}.",
    "reposition <X> {at}.",
    "fetch <X> from the middle and let go {at}.",
    "locate <X>, take hold, and move {out}.",
    "collect <X> and unload {at}.",
    "displace <X> {out}.",
    "convey <X> {out}.",
    "guide <X> {out}.",
)

_ONE = (
    "use {arm} to move <X> {out}.",
    "with {arm}, carry <X> {out}.",
    "grip <X>, raise it, and lower it {at}.",
    "have {arm} take <X> {out}.",
    "pinch <X> and bring it {out}.",
    "find <X> on {table} and put it {at}.",
    "grab <X> by its sides and set it {at}.",
    "reach for <X> and shift it {out}.",
    "seize <X> and lay it down {at}.",
    "let {arm} put <X> {at}.",
    "hold <X> tight and take it {out}.",
    "make {arm} deliver <X> {out}.",
    "close a gripper on <X> and haul it {out}.",
)

_SEVERAL = (
    "move <X> {out}, one after another.",
    "using the arms in turn, carry <X> {out}.",
    "go through <X> and take each of them {out}.",
    "in any order, bring <X> {out}.",
    "pick up <X> one by one and lay them {at}.",
    "work until <X> are {at}.",
    "find <X> on {table} and put them {at}.",
    "grip <X> in turn and set them down {at}.",
    "use both arms to move <X> {out}.",
    "spread <X> {out}.",
    "one at a time, haul <X> {out}.",
    "let the left and right arms take <X> {out}.",
    "empty the central area: put <X> {at}.",
)

_HELDOUT = (
    "what I need is <X> {at}.",
    "could <X> be moved {out}?",
    "<X> should end up {at}.",
    "the goal is an empty middle of {table}, with <X> {at}.",
    "I would like to see <X> {at}.",
    "if the middle is free and <X> came to lie {at}, the task is complete.",
    "where must <X> go? The place is {at}.",
    "success means having <X> {at}.",
    "my wish is for <X> to go {out}.",
    "for this task <X> must be taken {out}.",
)


def templates(level: int) -> Templates:
    """One box at level 1, several from level 2 on."""
    train = (*_BOTH, *(_ONE if level == 1 else _SEVERAL))
    slot = "{box}" if level == 1 else "{boxes}"
    return templates_of(
        (t.replace("<X>", slot) for t in train), (t.replace("<X>", slot) for t in _HELDOUT)
    )
