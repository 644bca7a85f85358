"""Templates of Hit_Blocks_Hammer_Order: one {block}, or several in the {order} of their colours."""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_DEEDS = (
    "hit <X> with {hammer}",
    "use {hammer} to hit <X>",
    "take {hammer} and knock on <X>",
    "pick up {hammer} and strike <X>",
    "grasp {hammer}, then tap <X> with it",
    "with {hammer}, hit <X> on top",
    "bring the head of {hammer} down on <X>",
    "lift {hammer} and let its head touch <X>",
    "hammer on <X> using {hammer}",
    "grab {hammer} by its handle and hit <X>",
    "strike <X> from above with {hammer}",
    "knock with {hammer} on <X>",
    "tap <X> in the middle with {hammer}",
    "hold {hammer} and beat <X>",
    "fetch {hammer} from {table} and hit <X>",
    "make {hammer} hit <X>",
    "lower {hammer} onto <X>",
    "give <X> a knock with {hammer}",
    "seize {hammer} and pound <X>",
    "reach for {hammer} and hit <X>",
    "let {hammer} fall gently on <X>",
    "carry {hammer} over and knock on <X>",
    "get hold of {hammer} to strike <X>",
    "swing {hammer} down onto <X>",
    "work with {hammer} and hit <X>",
)
_ONE_FRAMES = ("<D>.", "please <D>, using {arm}.")
_ORDER_FRAMES = ("<D>, by color {order}.", "in the color order {order}, <D>.")
_ONE_HELDOUT = (
    "what I need is {block} hit with {hammer}.",
    "could {block} be struck with {hammer}?",
    "{block} should be hit from above by {hammer}.",
    "the goal is for {hammer} to have touched the top of {block}.",
    "I would like to see {hammer} come down on {block}.",
    "if {hammer} has hit {block}, the task is complete.",
    "to finish this task, one has to knock on {block} with {hammer}.",
    "what must {hammer} strike? It is {block}.",
    "success requires a blow on {block}, given by {hammer}.",
    "my request is that {hammer} hits {block} on its top, which is enough.",
)
_ORDER_HELDOUT = (
    "what I need is each block hit with {hammer}, its color deciding when: {order}.",
    "could the blocks be struck with {hammer}, going {order}?",
    "the blocks should be hit by {hammer} in this color order: {order}.",
    "the goal is for {hammer} to have touched every block, {order}.",
    "I would like to see {hammer} come down on the blocks, {order}.",
    "if {hammer} has hit the blocks in turn, {order}, the task is complete.",
    "to finish this task, one has to knock with {hammer} on the blocks, {order}.",
    "which color must {hammer} strike when? The sequence is {order}.",
    "success requires blows of {hammer} on the blocks, {order}.",
    "my request is that {hammer} hits block after block, {order}.",
)


def templates(level: int) -> Templates:
    """One block at level 1, an order of colours from level 2 on."""
    if level == 1:
        return templates_of(_framed(_ONE_FRAMES, "{block}"), _ONE_HELDOUT)
    return templates_of(_framed(_ORDER_FRAMES, "the blocks"), _ORDER_HELDOUT)


def _framed(frames: tuple[str, ...], what: str) -> tuple[str, ...]:
    deeds = [deed.replace("<X>", what) for deed in _DEEDS]
    return tuple(frame.replace("<D>", deed) for frame in frames for deed in deeds)
