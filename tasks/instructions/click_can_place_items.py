"""Templates of Click_Can_Place_Items: a fixed sequence whose first `level` steps are asked for.

Press the can, bread into the basket, press the can again, pill bottle onto the blue pad, press the
can a third time. A sentence is a way to chain steps around a way to word them, so the steps of a
level always come complete and in order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.tasks.instructions.press_clauses import sentences_about
from robospa.tasks.instructions.words import listed

_STEPS = (
    (
        "press {can}",
        "put {bread} into {basket}",
        "press {can} again",
        "place {bottle} on {pad}",
        "press {can} a third time",
    ),
    (
        "tap the top of {can}",
        "place {bread} in {basket}",
        "tap {can} once more",
        "put {bottle} onto {pad}",
        "give {can} a last tap",
    ),
    (
        "push down on {can}",
        "drop {bread} into {basket}",
        "push down on {can} again",
        "set {bottle} on {pad}",
        "push {can} a third time",
    ),
    (
        "click {can}",
        "move {bread} to {basket}",
        "click {can} a second time",
        "move {bottle} onto {pad}",
        "click {can} once again",
    ),
    (
        "touch the top of {can}",
        "lay {bread} inside {basket}",
        "touch {can} a second time",
        "stand {bottle} on {pad}",
        "touch {can} one last time",
    ),
)
"""Five ways to word the five steps, as imperative clauses."""

_RESULTS = (
    "{can} pressed",
    "{bread} put into {basket}",
    "{can} pressed again",
    "{bottle} set on {pad}",
    "{can} pressed a third time",
)
"""The steps as things that have happened."""

_EVENTS = (
    "a press of {can}",
    "{bread} going into {basket}",
    "another press of {can}",
    "{bottle} going onto {pad}",
    "a final press of {can}",
)
"""The steps as names of events."""


def _numbered(steps: Sequence[str]) -> str:
    return " ".join(f"step {i}: {step}." for i, step in enumerate(steps, 1))


def _announced(steps: Sequence[str]) -> str:
    words = ("first", "next", "after that", "then")[: len(steps) - 1]
    last = "and then" if len(steps) == 2 else "and finally"
    return ", ".join(f"{w} {s}" for w, s in zip((*words, last), steps, strict=True)) + "."


def _sentences(steps: Sequence[str]) -> str:
    words = ("", "afterwards ", "next ", "then ", "finally ")
    return " ".join(f"{word}{step}." for word, step in zip(words, steps, strict=False))


def _paired(steps: Sequence[str]) -> str:
    pairs = [" and then ".join(steps[i : i + 2]) for i in range(0, len(steps), 2)]
    return "; after this, ".join(pairs) + "."


_CHAINS: tuple[Callable[[Sequence[str]], str], ...] = (
    lambda steps: ", then ".join(steps) + ".",
    _announced,
    lambda steps: "in this order: " + "; ".join(steps) + ".",
    _numbered,
    lambda steps: listed(steps) + ", in that order.",
    lambda steps: "do the following one after another: " + ", ".join(steps) + ".",
    _sentences,
    lambda steps: "finish each step before the next: " + listed(steps) + ".",
    _paired,
    lambda steps: "start: " + steps[0] + ". Continue: " + listed(steps[1:], ", then ") + ".",
)
"""Ten ways to chain imperative steps."""


def _heldout(results: Sequence[str], events: Sequence[str]) -> tuple[str, ...]:
    should = _passive(results[0], "should be")
    present = [_passive(result, "is") for result in results]
    infinitive = [_passive(result, "to be") for result in results]
    return (
        f"what I need is {listed(results, ', and then ')}.",
        f"could I have {listed(results, ' and afterwards ')}?",
        f"{should}, then {listed(results[1:], ' and eventually ')}.",
        f"the task consists of {', followed by '.join(events)}.",
        f"I would like to see {', and later '.join(results)}.",
        f"if all goes well, {listed(present, ', and at last ')}.",
        f"the order of events ought to be {', then '.join(events)}.",
        f"what comes when? It is {' before '.join(events)}.",
        f"success requires {listed(infinitive, ' and thereafter ')}.",
        f"it all ends with {events[-1]}; what precedes is {', and later '.join(events[:-1])}.",
    )


def _passive(result: str, verb: str) -> str:
    noun, rest = result.split("} ", 1)
    return f"{noun}}} {verb} {rest}"


def templates(level: int) -> Templates:
    """The first `level` steps of the sequence."""
    if level == 1:
        return templates_of(*sentences_about("{can}"))
    train = [chain(steps[:level]) for steps in _STEPS for chain in _CHAINS]
    return templates_of(train, _heldout(_RESULTS[:level], _EVENTS[:level]))
