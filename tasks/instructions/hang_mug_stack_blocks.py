"""Templates of Hang_Mug_Stack_Blocks: {mug} onto {rack}, {red} {area}, then a tower on it."""

from __future__ import annotations

from robospa.tasks.instructions.chains import chained
from robospa.tasks.instructions.grammar import Templates, templates_of

_ONE = (
    "hang {mug} on {rack}.",
    "hang {mug} up on {rack} by its handle.",
    "put {mug} on the peg of {rack}.",
    "pick up {mug} and hang it on {rack}.",
    "hook {mug} onto {rack}.",
    "suspend {mug} from {rack}.",
    "slip the handle of {mug} over the peg of {rack}.",
    "use {arm} to hang {mug} on {rack}.",
    "with {arm}, hook {mug} onto {rack}.",
    "take {mug} from {table} and hang it on {rack}.",
    "lift {mug} and slide its handle onto the peg of {rack}.",
    "grasp {mug}, carry it over, and hang it on {rack}.",
    "find {mug} and hang it on the peg of {rack}.",
    "let {mug} dangle by its handle from {rack}.",
    "bring {mug} to {rack} and hang it up there.",
    "have {arm} hang {mug} on the peg of {rack}.",
    "move {mug} to {rack} and leave it hanging there.",
    "thread the peg of {rack} through the handle of {mug}.",
    "grab {mug} and hook its handle over the peg of {rack}.",
    "place {mug} on {rack} so that it hangs by its handle.",
    "fetch {mug} with {arm} and hang it on {rack}.",
    "get {mug} onto the peg of {rack}.",
    "transfer {mug} from {table} to the peg of {rack}.",
    "raise {mug} and hang it by its handle on {rack}.",
    "make {mug} hang from the peg of {rack}.",
    "reach for {mug}, then hook it onto {rack}.",
    "leave {mug} hanging on {rack}.",
    "locate {rack} and hang {mug} on it.",
    "close the gripper on {mug}, then open it once {mug} hangs on {rack}.",
    "guide the handle of {mug} onto {rack} using {arm}.",
    "please hang {mug} on {rack}.",
    "seize {mug} and put its handle over the peg of {rack}.",
    "store {mug} on {rack}, hanging by its handle.",
    "hold {mug} with {arm} and hang it on {rack}.",
    "see that {mug} hangs on {rack} and let go.",
    "push the handle of {mug} onto the peg of {rack} and release it.",
    "take hold of {mug} and suspend it from the peg of {rack}.",
    "arrange for {mug} to hang on the peg of {rack}.",
    "go to {mug}, grip it, and hang it on {rack}.",
    "deliver {mug} to {rack}, hanging it by the handle.",
    "look for {mug} and hook it on the peg of {rack}.",
    "do one thing: hang {mug} on {rack}.",
    "using {arm}, slip {mug} onto the peg of {rack}.",
    "carry {mug} to {rack}, hook it on, and let go.",
    "collect {mug} from {table} and suspend it from {rack}.",
    "grip {mug} and lower its handle over the peg of {rack}.",
    "position {mug} on {rack} with the peg inside its handle.",
    "clear {table} of {mug} by hanging it on {rack}.",
    "keep hold of {mug} until its handle hangs on {rack}.",
    "tidy up: hang {mug} on the peg of {rack}.",
)

_ONE_HELDOUT = (
    "what I need is {mug} hanging on {rack}.",
    "could {mug} be hung on {rack} by {arm}?",
    "{mug} should be hanging by its handle from {rack}.",
    "the goal is for {mug} to have been hung on {rack}.",
    "I would like to see {mug} on the peg of {rack}, {arm} doing the work.",
    "if {mug} hangs freely on {rack}, the task is complete.",
    "to finish this task, {mug} has to be hooked onto {rack}.",
    "where must {mug} go? It belongs on the peg of {rack}.",
    "{mug}, once {arm} has moved it, is to be found hanging on {rack}.",
    "my request is for {mug} to be suspended from {rack}.",
)

_TOWER = (("red", "green"), ("green", "blue"), ("blue", "yellow"))

_HANG = (
    "hang {mug} on {rack}",
    "put {mug} on {rack} by its handle",
    "suspend {mug} from {rack}",
    "pick up {mug} and hang it on {rack}",
    "hook {mug} onto {rack}",
)
_LAY = (
    "put {red} {area}",
    "place {red} {area}",
    "set {red} down {area}",
    "leave {red} {area}",
    "lay {red} {area}",
)
_STACK = (
    "put <A> on <B>",
    "place <A> on top of <B>",
    "stack <A> on <B>",
    "set <A> onto <B>",
    "lay <A> on <B>",
)


def _pair(text: str, upper: str, lower: str) -> str:
    return text.replace("<A>", f"{{{upper}}}").replace("<B>", f"{{{lower}}}")


def _all(hang: str, lay: str, stack: str) -> tuple[str, ...]:
    """The five steps in one wording."""
    return (hang, lay, *(_pair(stack, upper, lower) for lower, upper in _TOWER))


_RESULTS = _all("{mug} hung on {rack}", "{red} put {area}", "<A> stacked on <B>")
_EVENTS = _all("{mug} being hung on {rack}", "{red} coming to rest {area}", "<A> going onto <B>")


def templates(level: int) -> Templates:
    """The first `level` steps: the mug, the red block, and what goes on top of it."""
    if level == 1:
        return templates_of(_ONE, _ONE_HELDOUT)
    steps = [_all(*wording)[:level] for wording in zip(_HANG, _LAY, _STACK, strict=True)]
    return chained(steps, _RESULTS[:level], _EVENTS[:level])
