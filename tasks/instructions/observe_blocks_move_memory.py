"""Templates of Observe_Blocks_Move_Memory: stay still, then bring the blocks shown to the strip.

Every sentence says that nothing may move before the wall is there, which blocks are meant (not by
colour: that is what has to be remembered) and where they go.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.waiting import paired

_DEEDS = (
    "move {blocks} to {strip}",
    "bring {blocks} to {strip}",
    "carry only {blocks} to {strip}",
    "pick up {blocks}, to be set down in {strip}",
    "transfer {blocks}, and no others, to {strip}",
    "place {blocks} in {strip}",
    "fetch {blocks} into {strip}",
    "put {blocks} down in {strip}",
    "take {blocks} over to {strip}",
    "shift {blocks} into {strip}",
    "stow {blocks} in {strip}",
    "leave all others alone and collect {blocks} in {strip}",
    "move {blocks} from memory to {strip}",
    "transport {blocks} into {strip}",
    "relocate {blocks} to {strip}",
    "use the arms as needed to deliver {blocks} to {strip}",
    "pick out and carry {blocks} to {strip}",
    "take {blocks} and nothing else to {strip}",
    "drop off {blocks} in {strip}",
    "lay {blocks} in {strip}",
    "get {blocks} into {strip}",
    "employ the closer arm and bring {blocks} to {strip}",
    "recall the display and move {blocks} to {strip}",
    "lift {blocks} over to {strip}",
    "touch no others and leave {blocks} in {strip}",
)
_HELDOUT = (
    "what I need, once {wall}, is {blocks} in {strip}.",
    "could {blocks} be brought to {strip}, but only after {wall}?",
    "{blocks} should lie in {strip}, but may not be moved before {wall}.",
    "the arms must rest until {wall}; what follows is {blocks} going to {strip}.",
    "I would like to see {blocks} in {strip}, with no motion until {wall}.",
    "as soon as {wall}, and not earlier, {blocks} may be moved to {strip}.",
    "the goal is {blocks} and nothing else in {strip}, everything at rest until {wall}.",
    "nothing may move until {wall}. The aim is then {blocks} in {strip}.",
    "what belongs, after {wall}, in {strip}? The answer is {blocks}.",
    "success requires a motionless start until {wall} and, later, {blocks} in {strip}.",
)


def templates(level: int) -> Templates:
    """The same for all levels."""
    return _TEMPLATES


_TEMPLATES = templates_of(paired(_DEEDS), _HELDOUT)
