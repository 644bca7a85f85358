"""Templates of Put_Bottles_Dustbin: {bottles} into {bin}, which stands {side}.

The number of bottles is inside {bottles}. Sentences with "it" are for level 1, sentences with
"them" or "one by one" for the others; the rest serve all levels and avoid verbs whose form would
depend on the number.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_ANY = (
    "put {bottles} into {bin} {side}.",
    "throw {bottles} away in {bin} {side}.",
    "drop {bottles} into {bin} {side}.",
    "place {bottles} in {bin} {side}.",
    "clear {table} by moving {bottles} into {bin} {side}.",
    "move {bottles} from {table} to {bin} {side}.",
    "dispose of {bottles} in {bin} {side}.",
    "carry {bottles} over to {bin} {side} and let go.",
    "toss {bottles} into {bin} {side}.",
    "get {bottles} off {table} and into {bin} {side}.",
    "bring {bottles} to {bin} {side} and open the gripper above it.",
    "find {bin} {side} and put {bottles} inside.",
    "discard {bottles} using {bin} {side}.",
    "tidy up: put {bottles} in {bin} {side}.",
    "transfer {bottles} to {bin} {side}.",
    "use the arms to move {bottles} into {bin} {side}.",
    "hand over between the arms where needed and put {bottles} into {bin} {side}.",
    "treat {bottles} as waste that belongs in {bin} {side}.",
    "clean up {table} by dropping {bottles} into {bin} {side}.",
    "please throw {bottles} out into {bin} {side}.",
    "relocate {bottles} from {table} into {bin} {side}.",
    "let {bottles} fall into {bin} {side}.",
    "release {bottles} over {bin} {side}.",
    "deposit {bottles} inside {bin} {side}.",
    "convey {bottles} from {table} into {bin} {side}.",
    "stow {bottles} in {bin} {side}.",
    "load {bottles} into {bin} {side}.",
    "remove {bottles} from {table} and choose {bin} {side} as the place to let go.",
    "rid {table} of {bottles} by means of {bin} {side}.",
    "let the left arm take over if needed and drop {bottles} into {bin} {side}.",
    "make {table} bottle-free by putting {bottles} in {bin} {side}.",
    "lower {bottles} into {bin} {side}.",
    "get rid of {bottles} with the help of {bin} {side}.",
    "chuck {bottles} into {bin} {side}.",
)

_ONE = (
    "take {bottles} and drop it into {bin} {side}.",
    "pick {bottles} up and throw it into {bin} {side}.",
    "grasp {bottles}, carry it over {bin} {side}, and let go.",
    "lift {bottles} from {table} and put it in {bin} {side}.",
    "find {bottles} and throw it away in {bin} {side}.",
    "grip {bottles}, move to {bin} {side}, and open the gripper.",
    "seize {bottles} and discard it in {bin} {side}.",
    "raise {bottles}, bring it to {bin} {side}, and drop it.",
    "hold {bottles} over {bin} {side} and release it.",
    "fetch {bottles} and place it inside {bin} {side}.",
    "grab {bottles} by its side and drop it into {bin} {side}.",
    "locate {bottles}, pick it up, and choose {bin} {side} as its target.",
    "collect {bottles} from {table} and toss it into {bin} {side}.",
    "reach for {bottles} and carry it into {bin} {side}.",
    "close a gripper on {bottles} and take it to {bin} {side}.",
    "pinch {bottles}, lift it, and release it inside {bin} {side}.",
)

_SEVERAL = (
    "put {bottles} into {bin} {side} one after another.",
    "throw {bottles} into {bin} {side} in any order.",
    "take {bottles} one at a time and drop them into {bin} {side}.",
    "pick up {bottles} in turn and place them in {bin} {side}.",
    "one by one, move {bottles} into {bin} {side}.",
    "work through {bottles} in whatever order suits and drop them into {bin} {side}.",
    "keep going until {bin} {side} holds {bottles}.",
    "carry {bottles} singly to {bin} {side} and let go.",
    "leave no bottle on {table}: drop {bottles} into {bin} {side}.",
    "start with any bottle and finish when {bin} {side} contains {bottles}.",
    "grasp, carry, and release {bottles} until they lie in {bin} {side}.",
    "dump {bottles} into {bin} {side} without minding the order.",
    "clear {bottles} away, dropping each into {bin} {side}.",
    "take {bottles} off {table} and throw them out in {bin} {side}.",
    "collect {bottles} one by one in {bin} {side}.",
    "handle {bottles} separately and let each fall into {bin} {side}.",
)

_HELDOUT = (
    "what I need is {bottles} in {bin} {side}.",
    "could {bottles} be moved into {bin} {side}?",
    "{bottles} should end up inside {bin} {side}.",
    "the goal is an empty tabletop, with {bottles} in {bin} {side}.",
    "I would like to see {bottles} inside {bin} {side}.",
    "if {bin} {side} contains {bottles}, the task is complete.",
    "nothing may remain on {table}; {bottles} must go into {bin} {side}.",
    "where must {bottles} go? The place is {bin} {side}.",
    "for {table} to be clear, {bottles} must lie in {bin} {side}.",
    "{bin} {side} is where {bottles} must end up.",
)


def templates(level: int) -> Templates:
    """One bottle at level 1, several from level 2 on."""
    return templates_of((*_ANY, *(_ONE if level == 1 else _SEVERAL)), _HELDOUT)
