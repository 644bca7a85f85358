"""Shorter ways to write fifty templates: clauses in frames, deeds after a wait, steps in a chain.

A group of templates in a task's file has one of these sets of keys for its training sentences:

| keys | sentences |
|---|---|
| `train`, perhaps `all_levels` | as they stand |
| `deeds`, `frames` | every frame ("please <D>.") around every deed |
| `deeds`, `waits` | every wait ("wait until {wall}, then <D>.") twice, around all deeds by turns |
| `clauses`, `wrappers`, `names` | clauses around names ("<X>") in wrappers ("<C>."), by turns |
| `first_steps` | ten ways to chain that many of the file's steps, in five wordings (`clauses`) |

`heldout` and `indirect` are ten others each, in which "<X>" stands for `heldout_names` by turns; a
chain has five other ways for each, around two wordings (`heldout_clauses`). `replace` gives further
markers, such as X, in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from robospa.tasks.instructions.grammar import Templates, templates_of
from robospa.text import listed


def composed(group: Mapping[str, Any]) -> Templates:
    """The templates that a group of a task's file stands for; ValueError for wrong counts."""
    markers = group.get("replace", {})
    heldout, indirect = (
        named(group.get(split, ()), group.get("heldout_names", ("<X>",)))
        for split in ("heldout", "indirect")
    )
    if "first_steps" in group:
        steps = group["steps"][: group["first_steps"]]
        train = chained([step["clauses"] for step in steps], CHAINS)
        held_back = [step["heldout_clauses"] for step in steps]
        heldout, indirect = (chained(held_back, c) for c in (HELDOUT_CHAINS, INDIRECT_CHAINS))
    elif "waits" in group:
        train = after_waits(group["deeds"], group["waits"])
    elif "frames" in group:
        train = tuple(f.replace("<D>", deed) for f in group["frames"] for deed in group["deeds"])
    elif "clauses" in group:
        train = wrapped(group["clauses"], group["wrappers"], group.get("names", ("<X>",)))
    else:
        train = (*group.get("all_levels", ()), *group["train"])
    return templates_of(*(_replaced(split, markers) for split in (train, heldout, indirect)))


def chained(clauses: Sequence[Sequence[str]], chains: Sequence[Chain]) -> tuple[str, ...]:
    """Steps, each in so many wordings, in all `chains`: in their first wordings, the second, ..."""
    wordings = zip(*clauses, strict=True)
    return tuple(chain(wording) for wording in wordings for chain in chains)


def wrapped(
    clauses: Sequence[str], wrappers: Sequence[str], names: Sequence[str]
) -> tuple[str, ...]:
    """Clause i inside a wrapper ("<C>") and around a noun phrase ("<X>"), each by turns.

    Steps of 3 and 1 through lists of co-prime lengths spread the combinations evenly.
    """
    made = []
    for i, clause in enumerate(clauses):
        sentence = wrappers[3 * i % len(wrappers)].replace("<C>", clause)
        made.append(sentence.replace("<X>", names[(i + i // len(names)) % len(names)]))
    return tuple(made)


def named(templates: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """`templates` with "<X>" replaced by the noun phrases by turns."""
    return tuple(t.replace("<X>", names[i % len(names)]) for i, t in enumerate(templates))


def after_waits(deeds: Sequence[str], waits: Sequence[str]) -> tuple[str, ...]:
    """Fifty of the combinations: every wait and every deed twice (25 of each)."""
    return tuple(
        wait.replace("<D>", deeds[(i + 12 * turn) % len(deeds)])
        for turn in range(2)
        for i, wait in enumerate(waits)
    )


def _replaced(sentences: Sequence[str], markers: Mapping[str, str]) -> tuple[str, ...]:
    """Sentences with every marker ("<X>") replaced by its text."""
    made = tuple(sentences)
    for marker, text in markers.items():
        made = tuple(sentence.replace(f"<{marker}>", text) for sentence in made)
    return made


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
