"""Templates of the three Rank_Blocks tasks: {blocks} in a row from left to right, {order}.

Level 1 has a single block, to be moved to {middle}, as in the stacking tasks.
"""

from __future__ import annotations

from robospa.tasks.instructions import stack_blocks_color_order
from robospa.tasks.instructions.grammar import Templates, templates_of

_TRAIN = (
    "line up {blocks} from left to right {order}.",
    "arrange {blocks} in a straight row, left to right {order}.",
    "put {blocks} side by side from left to right, {order}.",
    "place {blocks} in one line on {table}, left to right {order}.",
    "sort {blocks} into a row that runs from left to right {order}.",
    "make a row of {blocks}, {order} when read from left to right.",
    "order {blocks} from the left to the right {order}.",
    "from left to right, set {blocks} in a line {order}.",
    "rearrange {blocks} so that they stand in a row, left to right {order}.",
    "move {blocks} until they form a straight line, {order}, starting at the left.",
    "build a row with {blocks}, going from left to right {order}.",
    "rank {blocks} from left to right {order}.",
    "pick up {blocks} one at a time and line them up left to right, {order}.",
    "form a horizontal line of {blocks}, {order}, beginning on the left.",
    "lay {blocks} out in a row, {order}, with the left end as the start.",
    "take {blocks} and arrange them from left to right {order}.",
    "get {blocks} into a straight line, {order}, left to right.",
    "organize {blocks} in a left-to-right row {order}.",
    "starting on the left, line {blocks} up {order}.",
    "using the arms, put {blocks} into one row from left to right {order}.",
    "shift {blocks} around until they are lined up {order}, left to right.",
    "set up {blocks} next to each other, {order}, as seen from left to right.",
    "create a neat row on {table} from {blocks}, left to right {order}.",
    "bring {blocks} into line, {order}, the left end first.",
    "reposition {blocks} in a row so that from left to right they stand {order}.",
    "align {blocks} in a single row {order}, counted from the left.",
    "grasp {blocks} in turn and set them in a line, left to right {order}.",
    "put {blocks} on {table} in one straight row, {order}, going rightward.",
    "distribute {blocks} along a line from left to right {order}.",
    "work from left to right and place {blocks} in a row {order}.",
    "have {blocks} stand in a row, {order}, moving from left to right.",
    "sequence {blocks} along a straight line, left to right {order}.",
    "go through {blocks} and line them up on {table}, left to right {order}.",
    "place {blocks} beside one another {order}, with the line starting at the left.",
    "leave {blocks} in one tidy row, {order}, from the left side to the right side.",
    "fit {blocks} into a line, left to right {order}.",
    "turn {blocks} from a mess into a row {order}, from left to right.",
    "compose a straight line of {blocks} running rightward {order}.",
    "handle {blocks} one after another to get a row, left to right {order}.",
    "carry {blocks} to their places in a row that goes left to right {order}.",
    "let {blocks} form a line {order}, its start on the left.",
    "have the arms queue {blocks} up on {table}, left to right {order}.",
    "assemble a single file of {blocks} from the left to the right, {order}.",
    "position {blocks} in a row across {table}, {order}, left to right.",
    "look at {blocks} and arrange them in a line, {order}, from left to right.",
    "collect {blocks} into a straight row and keep them {order}, left to right.",
    "give {blocks} a new order on {table}: one row, left to right, {order}.",
    "transfer {blocks} into a row; from left to right, put them {order}.",
    "please line {blocks} up on {table} from left to right {order}.",
    "fill a row from left to right with {blocks} {order}.",
)

_HELDOUT = (
    "what I need is a row made of {blocks}, left to right {order}.",
    "could {blocks} be lined up from left to right, {order}?",
    "{blocks} should end up in a row, from left to right {order}.",
    "the goal is one straight line with {blocks} in it, {order} from the left.",
    "I would like to see {blocks} in a left-to-right row, {order}.",
    "if {blocks} stand in line from left to right, {order}, the task is complete.",
    "how must {blocks} stand at the end? In one row, left to right {order}.",
    "success means that {blocks} make up a row, {order} as one looks from left to right.",
    "my wish is for {blocks} to stand next to each other, {order} from the left.",
    "by the end, there has to be a line of {blocks} from left to right, {order}.",
)


def templates(level: int) -> Templates:
    """One block to move at level 1, a row from level 2 on."""
    return stack_blocks_color_order.templates(1) if level == 1 else _SEVERAL


_SEVERAL = templates_of(_TRAIN, _HELDOUT)
