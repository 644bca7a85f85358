"""Templates of Press_Stapler_Repeat: {stapler} and how often, {times} or {presses}.

Level 1 is a single press and gets sentences of its own, without any talk of repetition.
"""

from __future__ import annotations

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.press_clauses import sentences_about

_TRAIN = (
    "press {stapler} {times}.",
    "push down on {stapler} {times}.",
    "tap the top of {stapler} {times}.",
    "use {arm} to press {stapler} {times}.",
    "with {arm}, push {stapler} down {times}.",
    "reach over to {stapler} and press it {times}.",
    "find {stapler} on {table} and press it {times}.",
    "close the gripper and press {stapler} with it {times}.",
    "bring a gripper down onto {stapler} {times}.",
    "press the top of {stapler} down {times}.",
    "move {arm} above {stapler} and push it down {times}.",
    "please press {stapler} {times} and then stop.",
    "operate {stapler} {times} using {arm}.",
    "touch the top of {stapler} with a gripper {times}.",
    "make {arm} press {stapler} {times}.",
    "locate {stapler}, then press it {times} from above.",
    "have {arm} push {stapler} down {times}.",
    "hit the top of {stapler} gently {times}.",
    "press down {times} on {stapler}.",
    "click {stapler} {times} with {arm}.",
    "lower a gripper onto {stapler} {times}.",
    "depress {stapler} {times}.",
    "go to {stapler} and press it {times}, no more and no less.",
    "work {stapler} {times} with a closed gripper.",
    "treat {stapler} like a button and push it {times}.",
    "press {stapler} {times}, lifting the gripper between presses.",
    "give {stapler} {presses}.",
    "apply {presses} to {stapler} with {arm}.",
    "push {stapler} down {times} and let go after each push.",
    "press {stapler} {times} in a row with {arm}.",
    "make {presses} on {stapler}, rising after each.",
    "repeat pressing {stapler} until it has been pressed {times}.",
    "press, release, and repeat on {stapler}: {times} in total.",
    "count along while you press {stapler} {times}.",
    "do {presses} on {stapler}, one after another.",
    "tap {stapler} {times}, leaving its surface between taps.",
    "push {stapler} {times} with short pauses.",
    "carry out {presses} on {stapler} using {arm}.",
    "press {stapler} repeatedly, {times} altogether.",
    "keep pressing {stapler} until the count reaches {presses}.",
    "perform {presses} with {arm} on {stapler}.",
    "go up and down on {stapler} {times}.",
    "press and release {stapler} {times}.",
    "press {stapler}, back off, and do it again, {times} overall.",
    "use {arm} for {presses} on {stapler}.",
    "work through {presses} on {stapler}, then stop.",
    "touch down on {stapler} {times}, moving clear each time.",
    "push {stapler} {times} in succession.",
    "press {stapler} {times} and then stay away from it.",
    "have {arm} deliver {presses} to {stapler}.",
)

_HELDOUT = (
    "what I need is {stapler} pressed {times}.",
    "could {stapler} be pressed {times}, please?",
    "{stapler} should be pushed down {times} before the task ends.",
    "the goal is for {stapler} to have been pressed {times}.",
    "I would like {arm} to push {stapler} down {times}.",
    "if {stapler} has gone down {times}, the task is complete.",
    "to finish this task, one has to push {stapler} down {times}.",
    "how often does {stapler} have to be pressed? The answer is {times}.",
    "{presses} on {stapler} are all that is wanted, each followed by a release.",
    "my request is for {presses} on {stapler}, with the gripper rising in between.",
)


def templates(level: int) -> Templates:
    """One press at level 1, a counted number of presses from level 2 on."""
    return templates_of(*sentences_about("{stapler}")) if level == 1 else _REPEATED


_REPEATED = templates_of(_TRAIN, _HELDOUT)
