"""Templates of Stack_Blocks_Color_Order: a tower whose colours are given from bottom to top.

From level 2 on a sentence gives the order either as a list ({order}, said to run upward) or as
neighbours ({pairs}, "green on red"). Level 1 has a single block, to be moved to {middle}.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_ONE = (
    "move {block} to {middle}.",
    "put {block} down at {middle}.",
    "bring {block} to {middle} with {arm}.",
    "pick up {block} and place it at {middle}.",
    "use {arm} to carry {block} to {middle}.",
    "shift {block} over to {middle}.",
    "take {block} and set it down at {middle}.",
    "relocate {block} to {middle}.",
    "grasp {block}, then release it at {middle}.",
    "transfer {block} to {middle} using {arm}.",
    "lift {block} and lower it at {middle}.",
    "find {block} and move it to {middle}.",
    "with {arm}, place {block} at {middle}.",
    "transport {block} to {middle}.",
    "grab {block} and drop it off at {middle}.",
    "deliver {block} to {middle}.",
    "reposition {block} so that it lies at {middle}.",
    "close a gripper on {block} and take it to {middle}.",
    "have {arm} move {block} to {middle}.",
    "please place {block} at {middle}.",
    "leave {block} at {middle}.",
    "get {block} over to {middle}.",
    "locate {block}, grip it, and carry it to {middle}.",
    "fetch {block} and lay it down at {middle}.",
    "let {arm} pick {block} and bring it to {middle}.",
    "make {middle} the new place of {block}.",
    "collect {block} and deposit it at {middle}.",
    "guide {block} to {middle} with {arm}.",
    "position {block} at {middle}.",
    "reach for {block} and put it at {middle}.",
    "haul {block} to {middle}.",
    "clear a path and move {block} to {middle}.",
    "seize {block} and transfer it to {middle}.",
    "hold {block} tight while moving it to {middle}, then let go.",
    "steer {block} from its place to {middle}.",
    "pick {block} up, go to {middle}, and open the gripper.",
    "center {block} by moving it to {middle}.",
    "look for {block} on {table} and bring it to {middle}.",
    "raise {block}, travel to {middle}, and put it down.",
    "change the place of {block} to {middle}.",
    "convey {block} to {middle} using {arm}.",
    "rest {block} at {middle}.",
    "pull or carry {block} to {middle}.",
    "clasp {block} and set it at {middle}.",
    "choose {middle} as the target and move {block} there.",
    "go to {block}, grasp it, and place it at {middle}.",
    "slide or lift {block} until it is at {middle}.",
    "aim for {middle} and set {block} down there.",
    "gently place {block} at {middle}.",
    "carry {block} across {table} to {middle}.",
)

_ONE_HELDOUT = (
    "what I need is {block} at {middle}.",
    "could {block} be moved to {middle}?",
    "{block} should end up at {middle}.",
    "the goal is to have {block} resting at {middle}.",
    "I would like to see {block} at {middle}.",
    "if {block} lies at {middle}, the task is complete.",
    "for success, {block} must be at {middle} in the end.",
    "where does {block} belong? The place is {middle}.",
    "it is at {middle} that {block} has to be in the end.",
    "my wish is that {block} gets moved to {middle}.",
)

_SEVERAL = (
    "stack the {number} blocks {middle}, from bottom to top: {order}.",
    "build a tower {middle} with these colors from bottom to top: {order}.",
    "pile the blocks up {middle} in this order, bottom to top: {order}.",
    "make one stack {middle}; going upward, use {order}.",
    "start with {bottom} {middle} and end with {top}; going upward, place {order}.",
    "put {bottom} down {middle} and add the rest on top, going upward: {order}.",
    "arrange the {number} blocks as a tower {middle}. From the bottom up, go {order}.",
    "set the blocks on top of each other {middle}, lowest to highest: {order}.",
    "assemble one {number}-block tower {middle}: {order}, counted from the bottom.",
    "erect a tower of {number} blocks {middle} with colors, from bottom to top, {order}.",
    "stack by color {middle}, bottom to top {order}, with {top} at the top.",
    "keep to this color order from the bottom up and stack the blocks {middle}: {order}.",
    "place {bottom} {middle} first, then stack upward in the order {order}.",
    "pick the blocks one by one and stack them {middle} from bottom to top: {order}.",
    "let the tower {middle} read {order} from bottom to top.",
    "create one column of blocks {middle}, upward {order}.",
    "go from {bottom} to {top} and stack all blocks {middle}; upward that is {order}.",
    "follow the colors {order} and stack in that order, lowest first, {middle}.",
    "lay {bottom} {middle} as the base and build up: {order}.",
    "construct a stack {middle} whose colors from the base up are {order}.",
    "pile {number} blocks {middle} so that the colors upward are {order}.",
    "form a tower {middle}, base to tip: {order}.",
    "take the blocks in the order {order}, the base first, and stack them {middle}.",
    "stack everything {middle}, with {bottom} lowest and {top} highest: {order}.",
    "please stack the blocks {middle} in the color order {order}, from the bottom.",
    "stack the blocks {middle}: {pairs}.",
    "build a tower {middle}, placing {pairs}.",
    "put {bottom} {middle}, then place {pairs}.",
    "set {bottom} {middle} and stack {pairs}.",
    "make a tower {middle} by putting {pairs}.",
    "starting from {bottom} {middle}, put {pairs}.",
    "use {bottom} as the base {middle}; then put {pairs}.",
    "with {bottom} as the base {middle}, stack {pairs}.",
    "pick up and stack the blocks {middle}, {pairs}.",
    "pile the {number} blocks up {middle} by setting {pairs}.",
    "move {bottom} to a place {middle}, then stack {pairs}.",
    "assemble the blocks into one stack {middle}, {pairs}.",
    "work upward {middle}: {pairs}.",
    "keep {bottom} lowest and stack {pairs} {middle}.",
    "lay down {bottom} {middle} and add {pairs}.",
    "erect a stack {middle} from {number} blocks, {pairs}.",
    "build upward from {bottom} {middle}: {pairs}.",
    "leave {bottom} at the base {middle} and put {pairs}.",
    "create a color tower {middle} with {pairs}.",
    "position {bottom} {middle}; next, stack {pairs}.",
    "stack block by block {middle}, {pairs}.",
    "bring {bottom} to a spot {middle}; after that, put {pairs}.",
    "combine the {number} blocks into a tower {middle}: {pairs}.",
    "finish with {top} on top of the tower {middle}: {pairs}.",
    "in one tower {middle}, put {pairs}.",
)

_SEVERAL_HELDOUT = (
    "what I need is a tower {middle} with {pairs}.",
    "could {number} blocks be stacked {middle}, with {pairs}?",
    "the goal is one stack {middle}, from its base up {order}.",
    "{number} blocks should form a tower {middle}, from below {order}.",
    "I would like to see a tower {middle}, its colors from below {order}.",
    "when the task is done, {bottom} is lowest in a tower {middle}, with {pairs}.",
    "if the tower {middle} has {pairs}, the task is complete.",
    "which order must the tower {middle} have? From bottom to top it goes {order}.",
    "{pairs}: that is how {number} blocks should be stacked {middle}.",
    "success means that {top} tops a tower {middle} having {pairs}.",
)


def required(level: int) -> tuple[str, ...]:
    """The slots that every template of a level has ("a|b": one of them)."""
    return ("block", "middle") if level == 1 else ("middle", "order|pairs")


def templates(level: int) -> Templates:
    """One block to move at level 1, a tower from level 2 on."""
    if level == 1:
        return templates_of(_ONE, _ONE_HELDOUT)
    return templates_of(_SEVERAL, _SEVERAL_HELDOUT)
