"""Templates of Remember_Color_Cover: stay still, then move the covers by colour, each to its place.

Every sentence says that nothing may move before the covers are on, which cover comes when
({order}, or {block} at level 1) and where a cover goes ({where}). The official texts say neither
of the first and the last, although both are conditions of success.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.waiting import paired

_WAITS_ONE = (
    "keep still until the cover appears, then <D>.",
    "wait for the cover, then <D>.",
    "after the cover has appeared, and not before, <D>.",
    "rest while the block shows; once it is covered, <D>.",
    "do nothing before the block is hidden. Then <D>.",
    "hold both arms still until the block is covered. Then <D>.",
    "watch without moving; when the cover is on, <D>.",
    "stay put until the block is covered, and then <D>.",
    "let the cover come while the arms rest, and <D>.",
    "do not move while the block is visible; afterwards <D>.",
    "leave the arms where they are until hiding ends; next, <D>.",
    "be patient and motionless at first. As soon as the cover is there, <D>.",
    "freeze, see the cover arrive, and only then <D>.",
    "begin with a still phase; with the cover in place, <D>.",
    "pause until nothing of the block can be seen, then <D>.",
    "remain at the start pose until a cover hides the block, then <D>.",
    "first wait, arms unmoved, for the cover. Second, <D>.",
    "look on while the block gets its cover; after that <D>.",
    "avoid any motion before covering; later <D>.",
    "idle until the block disappears from view, then <D>.",
    "start moving only once the cover is on: <D>.",
    "with the cover on and not sooner, <D>.",
    "give the cover time to appear, arms at rest, then <D>.",
    "stand by without moving until the cover shows up. Now <D>.",
    "postpone every motion until the block is under its cover, then <D>.",
)
_DEEDS_ONE = (
    "move the cover of {block} {where}",
    "uncover {block} by moving the cover {where}",
    "take the cover off {block} and bring it {where}",
    "push the cover over {block} {where}",
    "slide the cover hiding {block} {where}",
    "reveal {block}: bring the cover {where}",
    "carry the cover from {block} {where}",
    "grasp the cover of {block} and transfer it {where}",
    "shift the cover that sits on {block} {where}",
    "use {arm} to take the cover of {block} {where}",
    "grip what hides {block} and bring it {where}",
    "make {block} visible again, taking the cover {where}",
    "lift the cover over {block} and transport it {where}",
    "free {block} by transporting the cover {where}",
    "show {block} by sliding the cover {where}",
    "let {arm} shift the cover on {block} {where}",
    "open up {block}; the cover goes {where}",
    "relocate the cover above {block} {where}",
    "expose {block} and guide the cover {where}",
    "get the cover off {block} and send it {where}",
    "pull the cover off {block} and move it {where}",
    "steer the cover of {block} {where}",
    "unveil {block}, pushing the cover {where}",
    "have {arm} carry the cover on {block} {where}",
    "find the cover that hides {block} and take it {where}",
)
_HELDOUT_ONE = (
    "what I need, once the cover is on, is the cover of {block} moved {where}.",
    "could the cover of {block} be moved {where}, but only after it has come?",
    "the cover of {block} should go {where}, once it has come, with no motion before.",
    "the arms must rest until hiding is over; the cover of {block} has to go {where}.",
    "I would like to see {block} revealed, its cover gone {where}, after a motionless wait.",
    "as soon as {block} is hidden, and not earlier, its cover may go {where}.",
    "the goal, with everything at rest until hiding, is the cover of {block} moved {where}.",
    "nothing may move until the cover comes. Next is {block} revealed, its cover moved {where}.",
    "when may the cover of {block} go {where}? As soon as it has appeared.",
    "success requires a motionless start and, later, the cover of {block} moved {where}.",
)

_WAITS = (
    "keep still until the covers appear, then <D>.",
    "wait for the covers, then <D>.",
    "after the covers have appeared, and not before, <D>.",
    "rest and remember the colors; once they are covered, <D>.",
    "memorize the colors, arms still, before they are hidden. Then <D>.",
    "hold both arms still until all blocks are covered. Then <D>.",
    "watch the colors without moving; when the covers are on, <D>.",
    "stay put until every block is covered, and then <D>.",
    "learn where each color is, wait for the covers, and <D>.",
    "do not move while colors are visible; afterwards <D>.",
    "leave the arms alone and note the colors; once all are hidden, <D>.",
    "be motionless at first. As soon as all covers are there, <D>.",
    "freeze, see the covers arrive, and only then <D>.",
    "begin with a still phase; with the covers in place, <D>.",
    "pause until no color can be seen, then <D>.",
    "remain at the start pose until covers hide the blocks, then <D>.",
    "first wait, arms unmoved, for the covers. Second, <D>.",
    "look on while the blocks get their covers; after that <D>.",
    "avoid any motion before covering; later <D>.",
    "idle until all colors disappear from view, then <D>.",
    "start moving only once the covers are on: <D>.",
    "with all covers on and not sooner, <D>.",
    "give the covers time to appear, arms at rest, then <D>.",
    "stand by, colors in mind, until the covers show up. Now <D>.",
    "postpone every motion until the blocks are hidden, then <D>.",
)
_DEEDS = (
    "move each cover {where}, in this color order: {order}",
    "uncover the blocks in the order {order}, moving each cover {where}",
    "take the covers off in the order {order} and bring each {where}",
    "push each cover {where}; the order is {order}",
    "shift each cover {where}, going by color: {order}",
    "reveal the colors in the order {order} by moving each cover {where}",
    "carry each cover {where}, the colors being in turn {order}",
    "work through {order} and bring each cover {where}",
    "open the blocks by color, {order}, sliding each cover {where}",
    "have {arm} transfer each cover {where}, the colors going {order}",
    "make the blocks visible again, {order}, taking each cover {where}",
    "lift the covers by color, {order}, and transport each {where}",
    "free the blocks one by one, {order}, with each cover going {where}",
    "show the colors again in sequence, {order}: slide each cover {where}",
    "follow the color sequence {order} and shift each cover {where}",
    "relocate each cover {where}, keeping to {order}",
    "expose the blocks in turn, {order}, and guide each cover {where}",
    "pull off the covers hiding {order}, in that order, each {where}",
    "steer each cover {where}, by hidden color {order}",
    "unveil the blocks, {order}, pushing each cover {where}",
    "employ {arm} to take each cover {where}: {order}",
    "uncover, from memory, {order}, each cover moving {where}",
    "find the hidden colors, {order}, and take each cover {where}",
    "recall the places and open {order}, each cover going {where}",
    "deal with the colors in the order {order}: every cover travels {where}",
)
_HELDOUT = (
    "what I need, once the covers are on, is each cover moved {where}: {order}.",
    "could each cover be moved {where}, by color {order}, but not before all blocks are hidden?",
    "each cover should go {where}, once all have come, no motion before; by color {order}.",
    "the arms must rest until hiding is over; then the covers go by color, {order}, each {where}.",
    "I would like the blocks revealed, {order}, each cover going {where}, no motion before hiding.",
    "as soon as all colors are hidden, and not earlier, each cover may go {where}: {order}.",
    "the goal, with everything at rest until hiding, is every cover moved {where}, going {order}.",
    "nothing may move until the covers come. Then each cover has to go {where}, by color {order}.",
    "which color comes when? It is {order}; each cover goes {where}, once all have appeared.",
    "success requires a motionless start and, later, each cover moved {where}, by color {order}.",
)


def templates(level: int) -> Templates:
    """One cover at level 1, an order of colours from level 2 on."""
    if level == 1:
        return templates_of(paired(_DEEDS_ONE, _WAITS_ONE), _HELDOUT_ONE)
    return templates_of(paired(_DEEDS, _WAITS), _HELDOUT)
