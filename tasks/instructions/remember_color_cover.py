"""Templates of Remember_Color_Cover: stay still, then move the covers by colour, each to its place.

Every sentence says that nothing may move before the covers are on, which cover comes when
({order}, or {block} at level 1) and where a cover goes ({where}). The official texts say neither
of the first and the last, although both are conditions of success.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_WAITS_ONE = (
    "keep still until the cover appears, then <D>.",
    "wait for the cover, then <D>.",
    "after the cover has appeared, and not before, <D>.",
    "rest while the block shows; once covered, <D>.",
    "do nothing before the block is hidden. Then <D>.",
    "hold both arms still until the block is covered. Then <D>.",
    "watch without moving; when the cover is on, <D>.",
    "stay put until the block is covered, and then <D>.",
    "let the cover come while the arms rest, and <D>.",
    "do not move while the block is visible; afterwards <D>.",
)
_DEEDS_ONE = (
    "move the cover of {block} {where}",
    "uncover {block} by moving the cover {where}",
    "take the cover off {block} and put it {where}",
    "push the cover over {block} {where}",
    "slide the cover hiding {block} {where}",
    "reveal {block}: bring the cover {where}",
    "carry the cover from {block} {where}",
    "grasp the cover of {block} and transfer it {where}",
    "shift the cover that sits on {block} {where}",
    "use {arm} to take the cover of {block} {where}",
)
_HELDOUT_ONE = (
    "what I need, once the cover is on, is the cover of {block} moved {where}.",
    "could the cover of {block} be moved {where}, but only after it has come?",
    "the cover of {block} should go {where}, as soon as it is in place, with no motion before.",
    "the arms must rest until hiding is over; the cover of {block} has to go {where}.",
    "I would like to see {block} revealed, its cover gone {where}, after a motionless wait.",
    "if {block} has been hidden, its cover may go {where}, not earlier.",
    "the goal, with everything at rest until hiding, is the cover of {block} moved {where}.",
    "nothing may move until the cover comes. What follows is {block} revealed, the cover {where}.",
    "when may the cover of {block} go {where}? As soon as it has appeared.",
    "success requires a motionless start and, later, the cover of {block} moved {where}.",
)

_WAITS = (
    "keep still until the covers appear, then <D>.",
    "wait for the covers, then <D>.",
    "after the covers have appeared, and not before, <D>.",
    "rest and remember the colors; once covered, <D>.",
    "memorize the colors, arms still, before they are hidden. Then <D>.",
    "hold both arms still until all blocks are covered. Then <D>.",
    "watch the colors without moving; when the covers are on, <D>.",
    "stay put until every block is covered, and then <D>.",
    "learn where each color is, wait for the covers, and <D>.",
    "do not move while colors are visible; afterwards <D>.",
)
_DEEDS = (
    "move each cover {where}, in this color order: {order}",
    "uncover the blocks in the order {order}, moving each cover {where}",
    "take the covers off in the order {order} and put each {where}",
    "push each cover {where}; the order is {order}",
    "going {order}, shift each cover {where}",
    "reveal the colors in the order {order} by moving each cover {where}",
    "carry each cover {where}, the colors being in turn {order}",
    "work through {order} and bring each cover {where}",
    "open the blocks by color, {order}, sliding each cover {where}",
    "transfer each cover {where} with {arm}, the colors going {order}",
)
_HELDOUT = (
    "what I need, once the covers are on, is each cover moved {where}: {order}.",
    "could each cover be moved {where}, going {order}, but not before all blocks are hidden?",
    "each cover should go {where}, once all are in place, no motion before; by color {order}.",
    "the arms must rest until hiding is over; the covers have to go {order}, each {where}.",
    "I would like the hidden blocks revealed {order}, each cover going {where}, no motion earlier.",
    "if the colors have been hidden, not earlier, each cover may go {where}, by color {order}.",
    "the goal, with everything at rest until hiding, is every cover moved {where}, going {order}.",
    "nothing may move until the covers come. What follows is {order}, each cover going {where}.",
    "which color comes when? It is {order}; each cover goes {where} after all have appeared.",
    "success requires a motionless start and, later, each cover moved {where}, by color {order}.",
)


def required(level: int) -> tuple[str, ...]:
    """The slots that every template of a level has."""
    return ("block", "where") if level == 1 else ("order", "where")


def templates(level: int) -> Templates:
    """One cover at level 1, an order of colours from level 2 on."""
    if level == 1:
        return templates_of(_paired(_WAITS_ONE, _DEEDS_ONE), _HELDOUT_ONE)
    return templates_of(_paired(_WAITS, _DEEDS), _HELDOUT)


def _paired(waits: tuple[str, ...], deeds: tuple[str, ...]) -> tuple[str, ...]:
    """Fifty of the hundred combinations, every opening and every deed five times."""
    return tuple(
        wait.replace("<D>", deeds[(i + 2 * turn) % len(deeds)])
        for turn in range(5)
        for i, wait in enumerate(waits)
    )
