"""Templates of Observe_Objects_Click_Memory: stay still, then click what was shown, in its order.

Every sentence says that nothing may move before the wall is there, and that the order is that of
the stand; no object is named, because that is what has to be remembered.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.waiting import paired

_DEEDS = (
    "click {objects}",
    "press {objects}",
    "tap {objects}",
    "push down on {objects}",
    "use a closed gripper to click {objects}",
    "press, from above, {objects}",
    "touch from above {objects}",
    "keep the grippers closed and press {objects}",
    "give a click to {objects}",
    "poke {objects}",
    "recall the stand and click {objects}",
    "reproduce what was shown by pressing {objects}",
    "lower a gripper onto {objects}",
    "go and press {objects}",
    "find and click {objects}",
    "bring closed fingers down on {objects}",
    "apply one press to {objects}",
    "use the nearer arm and press {objects}",
    "gently hit {objects}",
    "visit and tap {objects}",
    "remember the stand and press {objects}",
    "give a gentle push to {objects}",
    "click once on {objects}",
    "reach for and tap {objects}",
    "let a closed gripper press {objects}",
)
_HELDOUT = (
    "what I need, once {wall}, is a click on {objects}.",
    "could {objects} be pressed, but only after {wall}?",
    "{objects} should be clicked, and no arm moved before {wall}.",
    "the arms must rest until {wall}; what follows is a press of {objects}.",
    "I would like to see a click on {objects}, with no motion until {wall}.",
    "as soon as {wall}, and not earlier, the arms may press {objects}.",
    "the goal is a click on {objects}, everything being at rest until {wall}.",
    "nothing may move until {wall}. The aim is then a click on {objects}.",
    "what has to be pressed after {wall}? The answer is {objects}.",
    "success requires a motionless start until {wall} and, later, a press of {objects}.",
)


def templates(level: int) -> Templates:
    """The same for all levels."""
    return _TEMPLATES


_TEMPLATES = templates_of(paired(_DEEDS), _HELDOUT)
