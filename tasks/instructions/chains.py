"""Instructions of several steps: ways to chain their clauses, in orders and otherwise.

A task gives each step as imperative clauses, in five wordings for training and in two held-out
ones. So the steps of a level always come complete and in order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robospa.text import listed

Chain = Callable[[Sequence[str]], str]
"""From the clauses of two or more steps to a sentence, or several."""


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


CHAINS: tuple[Chain, ...] = (
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
"""Ten ways to give the steps as orders."""


def _when_done(steps: Sequence[str]) -> str:
    words = ("when done", "next up", "from there", "lastly")
    rest = [f"; {word}, {step}" for word, step in zip(words, steps[1:], strict=False)]
    return "first of all " + steps[0] + "".join(rest) + "."


def _as_soon(steps: Sequence[str]) -> str:
    words = ("when finished,", "following that,", "thereafter", "to end with,")
    rest = [f" {word} {step}." for word, step in zip(words, steps[1:], strict=False)]
    return "to begin, " + steps[0] + "." + "".join(rest)


HELDOUT_CHAINS: tuple[Chain, ...] = (
    _when_done,
    lambda steps: "carry out these jobs one by one: " + listed(steps) + ".",
    lambda steps: "work in this sequence: " + "; ".join(steps) + ".",
    _as_soon,
    lambda steps: "get this done without changing the order: " + listed(steps) + ".",
)
"""Five other ways."""


def _asked(steps: Sequence[str], last: str) -> str:
    joint = last if len(steps) > 2 else " and then "
    return f"{', then '.join(steps[:-1])}{joint}{steps[-1]}"


INDIRECT_CHAINS: tuple[Chain, ...] = (
    lambda steps: f"could you {_asked(steps, ', and finally ')}?",
    lambda steps: f"I would like you to {_asked(steps, ' and afterwards ')}.",
    lambda steps: f"your jobs are, in order: {listed(steps)}.",
    lambda steps: f"can I ask you to {listed(steps)}, one after the other?",
    lambda steps: f"it would help if you could {_asked(steps, ', and lastly ')}.",
)
"""Five ways to ask for the steps without an order."""
