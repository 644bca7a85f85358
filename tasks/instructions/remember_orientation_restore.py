"""Templates of Remember_Orientation_Restore: stay still, then turn {near} as {far} lay.

Every sentence says that nothing may move before the wall is there, which blocks are to be turned,
and that each stays at its place; no direction is named, because that is what has to be remembered.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.waiting import paired

_DEEDS = (
    "turn {near} until it points like {far}",
    "rotate {near} on its spot to match {far}",
    "give {near} the direction of {far}",
    "pick up {near} and put it back in place, pointing like {far}",
    "reorient {near} in place so that it points as {far} did",
    "make {near} point the same way as {far}",
    "set {near} down at its own place, aligned with {far}",
    "copy the direction of {far} to {near}, without shifting it",
    "twist {near} to the orientation of {far}",
    "bring {near} into the direction that {far} has",
    "align {near} with {far} and keep it at its place",
    "lift {near}, turn it like {far}, and lower it at the same place",
    "change the direction of {near} to that of {far}",
    "correct {near}, so that it points like {far}",
    "recall how {far} lay and turn {near} that way on the spot",
    "turn {near} in place, with {far} as the model",
    "put {near} in the direction remembered from {far}, at its old place",
    "use the closer arm to turn {near} like {far}",
    "swivel {near} in place into the direction of {far}",
    "spin {near} where it lies until it matches {far}",
    "adjust {near} to point the way {far} does",
    "grasp {near} and rotate it to the direction of {far}",
    "let {near} end up at its place, pointing the way {far} did",
    "lay {near} down again on its spot, pointing as {far} did",
    "repeat in place with {near} the direction shown by {far}",
)
_HELDOUT = (
    "what I need, once {wall}, is {near} pointing like {far}, its place unchanged.",
    "could {near} be turned on the spot to match {far}, but only after {wall}?",
    "{near} should get the direction of {far}, staying in place, with no motion before {wall}.",
    "the arms must rest until {wall}; what follows is {near} turned in place to match {far}.",
    "I would like to see {near} pointing as {far} does, in the old place, no motion until {wall}.",
    "as soon as {wall}, and not earlier, {near} may be turned in place to match {far}.",
    "the goal is {near} at its old place, pointing like {far}, everything at rest until {wall}.",
    "nothing may move until {wall}. The aim is then {near} turned like {far}, its place unchanged.",
    "which way must {near} point on its old spot after {wall}? The same way as {far}.",
    "success requires a motionless start until {wall} and, later, {near} turned in place like "
    "{far}.",
)


def templates(level: int) -> Templates:
    """The same for all levels."""
    return _TEMPLATES


_TEMPLATES = templates_of(paired(_DEEDS), _HELDOUT)
