"""Templates of Stamp_Seals_Order: one {pad}, or {pads} in a row from right to left."""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_DEEDS = (
    "stamp <X> with {seal}",
    "use {seal} to stamp <X>",
    "take {seal} and put it down on <X>",
    "pick up {seal} and press it onto <X>",
    "grasp {seal}, then set it on <X>",
    "with {seal}, mark <X> in the middle",
    "bring {seal} down on <X>",
    "lift {seal} and stamp <X>",
    "apply {seal} to <X>",
    "grab {seal} and place it on <X>",
    "press {seal} from above onto <X>",
    "put a stamp on <X> with {seal}",
    "carry {seal} over and set it down on <X>",
    "hold {seal} and stamp <X> in the center",
    "fetch {seal} from {table} and stamp <X>",
    "make {seal} touch <X> in the middle",
    "lower {seal} onto <X>",
    "leave a mark on <X> using {seal}",
    "seize {seal} and stamp <X>",
    "reach for {seal} and put it on <X>",
    "place {seal} squarely on <X>",
    "let {seal} come down on <X>",
    "get hold of {seal} to stamp <X>",
    "move {seal} onto <X>",
    "work with {seal} and stamp <X>",
)
_ONE_FRAMES = ("<D>.", "please <D>, using {arm}.")
_ROW_FRAMES = ("<D>, {order}.", "mind the order and <D>, {order}.")
_ONE_HELDOUT = (
    "what I need is {seal} brought down on {pad}.",
    "could {pad} be stamped with {seal}?",
    "{pad} should get a stamp from {seal}.",
    "the goal is for {seal} to have stood in the middle of {pad}.",
    "I would like to see {seal} come down on {pad}.",
    "if {seal} has touched the center of {pad}, the task is complete.",
    "to finish this task, one has to set {seal} down on {pad}.",
    "where must {seal} go? Its place is on {pad}, right in the middle.",
    "success requires a stamp on {pad}, made by {seal}.",
    "my request is that {seal} is put on {pad}, well centered.",
)
_ROW_HELDOUT = (
    "what I need is {seal} brought down on {pads}: {order}.",
    "could {pads} be stamped with {seal}, {order}?",
    "{pads} should get a stamp from {seal}, one by one: {order}.",
    "the goal is for {seal} to have been on {pads}, {order}.",
    "I would like to see {seal} come down on {pads}, {order}.",
    "if {seal} has come down on {pads}, centered each time, {order}, the task is complete.",
    "to finish this task, one has to set {seal} down on {pads}, {order}.",
    "in which order must {seal} visit {pads}? The sequence is {order}.",
    "success requires a stamp on {pads}, made by {seal}, {order}.",
    "my request is that {seal} is put on {pads}, well centered, {order}.",
)


def templates(level: int) -> Templates:
    """One pad at level 1, a row of them from level 2 on."""
    if level == 1:
        return templates_of(_framed(_ONE_FRAMES, "{pad}"), _ONE_HELDOUT)
    return templates_of(_framed(_ROW_FRAMES, "{pads}"), _ROW_HELDOUT)


def _framed(frames: tuple[str, ...], what: str) -> tuple[str, ...]:
    deeds = [deed.replace("<X>", what) for deed in _DEEDS]
    return tuple(frame.replace("<D>", deed) for frame in frames for deed in deeds)
