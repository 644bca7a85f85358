"""Templates of Press_Stapler_Memory: how often each stapler of a row is to be pressed.

{counts} goes through the row, {row} says from which end. With one stapler there is {times}.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of

_ONE = (
    "press {stapler} {times}",
    "push {stapler} down {times}",
    "tap the top of {stapler} {times}",
    "use {arm} to press {stapler} {times}",
    "with {arm}, push down on {stapler} {times}",
    "reach for {stapler} and press it {times}",
    "find {stapler} on {table} and press it {times}",
    "click {stapler} {times}",
    "bring a gripper down onto {stapler} {times}",
    "operate {stapler} {times}",
    "touch the top of {stapler} {times} with a gripper",
    "have {arm} push {stapler} down {times}",
    "hit {stapler} gently from above {times}",
    "depress {stapler} {times}",
    "work {stapler} {times} with {arm}",
    "treat {stapler} as a button and push it {times}",
    "come down on {stapler} {times}",
    "lower {arm} onto {stapler} {times}",
    "poke {stapler} from above {times}",
    "make {arm} press {stapler} {times}",
    "press the head of {stapler} {times}",
    "let a gripper push {stapler} {times}",
    "go to {stapler} and push it {times}",
    "squeeze {stapler} from above {times}",
    "close a gripper and press {stapler} with it {times}",
)
_ONE_FRAMES = ("<D>, no more and no less.", "keep count: <D>.")
_ONE_HELDOUT = (
    "what I need is {stapler} pressed {times} by {arm}.",
    "could {stapler} be pressed {times} by {arm}?",
    "{stapler} should be pushed down {times}, with {arm} at work.",
    "the goal is for {stapler} to have been pressed {times} by {arm}.",
    "I would like to see {arm} push {stapler} down {times}.",
    "if {arm} has pushed {stapler} down {times}, the task is complete.",
    "to finish this task, {arm} has to push {stapler} down {times}.",
    "how often must {arm} press {stapler}? The answer is {times}.",
    "my request is that {stapler} is pressed {times} by {arm}.",
    "success requires {stapler} to go down {times}, pushed by {arm}.",
)

_ROW = (
    "press the staplers, {row}: {counts}",
    "push the staplers down, {row}, {counts}",
    "tap the staplers from above, {row}: {counts}",
    "work along the row of staplers, {row}, and press {counts}",
    "use the nearer arm and press the staplers, {row}: {counts}",
    "press every stapler its own number of times, {row}: {counts}",
    "go along the staplers on {table}, {row}, pressing {counts}",
    "click the staplers, {row}: {counts}",
    "bring a gripper down on the staplers, {row}: {counts}",
    "operate the staplers, {row}, {counts}",
    "take the staplers one by one, {row}, and press {counts}",
    "give the staplers their presses, {row}: {counts}",
    "hit the staplers gently, {row}: {counts}",
    "depress the staplers, {row}, {counts}",
    "treat the staplers as buttons, {row}, and push {counts}",
    "touch down on the staplers, {row}: {counts}",
    "poke the staplers from above, {row}: {counts}",
    "count your presses on the staplers, {row}: {counts}",
    "serve the staplers in turn, {row}, pressing {counts}",
    "let the grippers push the staplers, {row}: {counts}",
    "press down on the heads of the staplers, {row}: {counts}",
    "handle the row of staplers, {row}: press {counts}",
    "remember these counts and press the staplers, {row}: {counts}",
    "close a gripper and push the staplers with it, {row}: {counts}",
    "walk down the line of staplers, {row}, and push {counts}",
)
_ROW_FRAMES = ("<D>.", "exactly as often as told, <D>.")
_ROW_HELDOUT = (
    "what I need is the staplers pressed like this, {row}: {counts}.",
    "could the staplers be pressed, {row}, {counts}?",
    "the staplers should be pushed down, {row}, {counts}.",
    "the goal is for the staplers to have been pressed, {row}, {counts}.",
    "I would like each stapler to get its presses: {row}, {counts}.",
    "if the staplers have gone down, {row}, {counts}, the task is complete.",
    "to finish this task, one has to press the staplers, {row}, {counts}.",
    "how often must each stapler be pressed? The answer, {row}, is {counts}.",
    "success requires presses of the staplers, {row}, {counts}, and none beyond that.",
    "my request is that the staplers are pressed, {row}, {counts}.",
)


def templates(level: int) -> Templates:
    """One stapler at level 1, a row from level 2 on."""
    if level == 1:
        return templates_of(_framed(_ONE_FRAMES, _ONE), _ONE_HELDOUT)
    return templates_of(_framed(_ROW_FRAMES, _ROW), _ROW_HELDOUT)


def _framed(frames: tuple[str, ...], deeds: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(frame.replace("<D>", deed) for frame in frames for deed in deeds)
