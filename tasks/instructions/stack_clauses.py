"""Templates of the towers by size and by length: how many blocks, in which {order}, and {middle}.

A single block has no order: it is moved to {middle}, in the words of the colour task.
"""

from __future__ import annotations

from robospa.tasks.instructions import stack_blocks_color_order
from robospa.tasks.instructions.grammar import Templates, templates_of

_SEVERAL = (
    "stack the {number} blocks {middle}, {order}.",
    "build a tower {middle}, {order}.",
    "pile the blocks up {middle} with {order}.",
    "make one stack {middle}; put {order}.",
    "arrange the {number} blocks as a tower {middle}, {order}.",
    "set the blocks on top of each other {middle}: {order}.",
    "assemble one {number}-block tower {middle}, {order}.",
    "erect a tower of {number} blocks {middle} with {order}.",
    "compare the blocks and stack them {middle}, {order}.",
    "pick the blocks one by one and stack them {middle}, {order}.",
    "create one column of blocks {middle}, with {order}.",
    "sort the {number} blocks into a tower {middle}: {order}.",
    "construct a stack {middle} that has {order}.",
    "pile {number} blocks {middle} so that they end with {order}.",
    "form a tower {middle}; keep {order}.",
    "stack everything {middle} in order, {order}.",
    "please stack the blocks {middle}, {order}.",
    "with one arm at work at a time, build a tower {middle}, {order}.",
    "order the blocks and pile them up {middle}: {order}.",
    "gather the {number} blocks {middle} in one stack, {order}.",
    "raise a tower {middle} from the {number} blocks, with {order}.",
    "use the {number} blocks on {table} to build upward {middle}: {order}.",
    "take the blocks in turn and place them on each other {middle}, {order}.",
    "turn the {number} loose blocks into a tower {middle} with {order}.",
    "collect the blocks from {table} and stack them {middle}, {order}.",
    "bring all blocks together {middle} and stack them with {order}.",
    "look at the {number} blocks, then stack them {middle}: {order}.",
    "grasp block after block and build a tower {middle}, {order}.",
    "combine the {number} blocks into one tower {middle}, {order}.",
    "put one block on another {middle} until the tower has {order}.",
    "start a tower {middle} and finish it with {order}.",
    "judge the blocks, then pile them {middle} with {order}.",
    "work from the base upward {middle}, {order}.",
    "produce a tidy tower {middle}: {order}.",
    "lay the base {middle} and add the rest on top, {order}.",
    "let the {number} blocks form a single tower {middle}, {order}.",
    "rank the {number} blocks and pile them up {middle} accordingly, {order}.",
    "build up a stack of {number} {middle}, having {order}.",
    "make the blocks meet {middle} and stack them: {order}.",
    "choose the base, set it {middle}, and build on it, {order}.",
    "place every block into one tower {middle} with {order}.",
    "carry the {number} blocks over and stack them {middle}, {order}.",
    "lift and stack block by block {middle}: {order}.",
    "layer the {number} blocks {middle}, {order}.",
    "leave one neat tower {middle} with {order}.",
    "heap the blocks in a straight tower {middle}, {order}.",
    "transform the scattered blocks into a tower {middle}, {order}.",
    "position the blocks on one another {middle}, {order}.",
    "transfer the {number} blocks to a stack {middle}: {order}.",
    "clear {table} by stacking the blocks {middle}, {order}.",
)

_SEVERAL_HELDOUT = (
    "what I need is a tower {middle} with {order}.",
    "could {number} blocks be stacked {middle}, with {order}?",
    "the goal is one stack {middle} with {order}.",
    "{number} blocks should form a tower {middle}, with {order}.",
    "I would like to see a tower {middle} that has {order}.",
    "when the task is done, a tower stands {middle} with {order}.",
    "if a tower {middle} has {order}, the task is complete.",
    "how must the tower {middle} be built? The answer is {order}.",
    "{order}: that is how {number} blocks should be stacked {middle}.",
    "success means that the blocks are piled {middle}, {order}.",
)


def templates(level: int) -> Templates:
    """One block to move at level 1, a tower from level 2 on."""
    if level == 1:
        return stack_blocks_color_order.templates(1)
    return templates_of(_SEVERAL, _SEVERAL_HELDOUT)
