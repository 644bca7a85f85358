"""How instructions are written: templates and phrasings, in a TOML file beside a task's module.

    [[templates]]                       # of some levels
    levels = [1, 2]
    train = ["pick up {block}.", ...]   # 50 sentences with slots in braces
    heldout = ["using {arm}, hold up {block}.", ...]                   # 10 other orders
    indirect = ["could {block} be raised off {table}?", ...]           # 10 that are no orders

    [phrasings.block]                   # what may fill the slot {block}
    train = ["the {color} block", "the {color} cube"]
    heldout = ["the block colored {color}", ...]

A template is one or two English sentences, in lower case where a slot or a clause may come first;
`fill` raises the first letter of every sentence. A phrasing may have values of the scene in braces
({color}); the task's `slots` gives them. What several phrasings of one slot have to be chosen from
has names of two parts, such as `[phrasings.blocks.two]`. What a group of templates leaves out is
taken from the top of the file.

Instead of fifty templates a group may have one of these sets of keys for its training sentences:

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

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from robospa.text import listed

SENTENCES = 100
"""Sentences per scene and split (official count)."""

SPLITS = ("train", "heldout", "indirect")
"""Instruction splits: orders to train on, orders of other structures, and the same
asked for in other ways than by an order."""

Phrasings = tuple[tuple[str, ...], tuple[str, ...]]
"""What may fill a slot: in training sentences, and in those of the two other splits.

Every phrasing of a slot fits every template that uses the slot; templates never put "a" or "an" in
front of a slot, so no article can go wrong.
"""

Slots = dict[str, Phrasings]
"""{slot: (train phrasings, held-out phrasings)}"""

_SLOT = re.compile(r"\{(\w+)\}")


class Templates(NamedTuple):
    """The templates of one variant by split: in the benchmark 50 for training and 10 held out
    (official counts), and 10 indirect ones."""

    train: tuple[str, ...]
    heldout: tuple[str, ...]
    indirect: tuple[str, ...]


def templates_of(
    train: Iterable[str], heldout: Iterable[str], indirect: Iterable[str]
) -> Templates:
    """The lists; ValueError if templates are repeated or cannot share 100 sentences evenly."""
    made = Templates(tuple(train), tuple(heldout), tuple(indirect))
    if len({text for split in made for text in split}) != sum(map(len, made)):
        raise ValueError("a template is there twice; those of all splits have to be different")
    for split in made:
        if not split or SENTENCES % len(split):
            raise ValueError(
                f"{len(split)} templates cannot share {SENTENCES} sentences evenly; give 50, 20, 10"
            )
    return made


def slot_names(template: str) -> tuple[str, ...]:
    """The slots of a template, each once, in order of appearance."""
    return tuple(dict.fromkeys(_SLOT.findall(template)))


def fill(template: str, values: Mapping[str, str]) -> str:
    """The template with its slots replaced and the first letter of every sentence raised.

    KeyError, naming the slot, if a value is missing.
    """
    missing = [name for name in slot_names(template) if name not in values]
    if missing:
        raise KeyError(f"no value for slot {missing[0]!r} of {template!r}; there is {list(values)}")
    return sentence_case(_SLOT.sub(lambda found: values[found.group(1)], template))


def sentence_case(text: str) -> str:
    """`text` with a capital at the start of every sentence (not after a colon)."""
    return re.sub(r"(^|[.?!] )([a-z])", lambda m: m.group(1) + m.group(2).upper(), text)


def masked_words(template: str) -> tuple[str, ...]:
    """Lower-case words of a template, every slot replaced by "_"."""
    return tuple(re.findall(r"[a-z0-9'_-]+", _SLOT.sub("_", template).lower()))


def similarity(one: str, other: str) -> float:
    """How alike two templates are, 0 to 1: the larger of two measures on their masked words.

    Jaccard overlap of the sets of words and the matching ratio of the sequences.
    """
    a, b = masked_words(one), masked_words(other)
    jaccard = len(set(a) & set(b)) / len(set(a) | set(b))
    return max(jaccard, SequenceMatcher(None, a, b, autojunk=False).ratio())


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
    made = tuple(sentences)
    for marker, text in markers.items():
        made = tuple(sentence.replace(f"<{marker}>", text) for sentence in made)
    return made


Chain = Callable[[Sequence[str]], str]
"""From the clauses of two or more steps to a sentence, or several."""


def _announced(steps: Sequence[str]) -> str:
    words = ("first", "next", "after that", "then")[: len(steps) - 1]
    last = "and then" if len(steps) == 2 else "and finally"
    return ", ".join(f"{w} {s}" for w, s in zip((*words, last), steps, strict=True)) + "."


def _paired(steps: Sequence[str]) -> str:
    pairs = [" and then ".join(steps[i : i + 2]) for i in range(0, len(steps), 2)]
    return "; after this, ".join(pairs) + "."


CHAINS: tuple[Chain, ...] = (
    lambda steps: ", then ".join(steps) + ".",
    _announced,
    lambda steps: "in this order: " + "; ".join(steps) + ".",
    lambda steps: " ".join(f"step {i}: {step}." for i, step in enumerate(steps, 1)),
    lambda steps: listed(steps) + ", in that order.",
    lambda steps: "do the following one after another: " + ", ".join(steps) + ".",
    lambda steps: _each_told(steps, ("", "afterwards ", "next ", "then ", "finally ")),
    lambda steps: "finish each step before the next: " + listed(steps) + ".",
    _paired,
    lambda steps: "start: " + steps[0] + ". Continue: " + listed(steps[1:], ", then ") + ".",
)
"""Ten ways to give the steps as orders."""


def _each_told(steps: Sequence[str], words: Sequence[str]) -> str:
    return " ".join(f"{word}{step}." for word, step in zip(words, steps, strict=False))


DONE = ("first of all, ", "once done, ", "next, ", "after that, ", "lastly, ")
SOON = ("to start with, ", "after that, ", "now ", "following that, ", "to finish, ")
HELDOUT_CHAINS: tuple[Chain, ...] = (
    lambda steps: _each_told(steps, DONE),
    lambda steps: "carry out these steps in order: " + listed(steps) + ".",
    lambda steps: "here is what to do, step by step: " + "; ".join(steps) + ".",
    lambda steps: _each_told(steps, SOON),
    lambda steps: "go ahead and " + listed(steps) + ", one after the other.",
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


SHARED = Path(__file__).with_name("shared.toml")
"""Clauses and phrasings that many tasks use."""


@dataclass(frozen=True)
class TaskText:
    """A file of templates and phrasings, read when something of it is first asked for."""

    path: Path

    @staticmethod
    def beside(module: str, name: str) -> TaskText:
        """The file called `name` in the folder of a module, given as its `__file__`."""
        return TaskText(Path(module).with_name(name))

    def templates(self, level: int, name: str = "") -> Templates:
        """The templates of a level; of several sets in the file those called `name`.

        KeyError if the file has none.
        """
        return _templates(self.path, level, name)

    def phrasings(self, entry: str, **values: object) -> Phrasings:
        """The phrasings called `entry` ("block", "blocks.two"), with the values filled in.

        KeyError for an unknown entry or a missing value.
        """
        return _phrasings(self.path, entry, tuple(values.items()))

    def slots(self, *entries: str, **values: object) -> Slots:
        """The phrasings of several entries by slot, and those that every task may use.

        The slot of an entry is the first part of its name: "blocks.two" fills {blocks}.
        """
        return {**COMMON.shared("arm", "table"), **self.shared(*entries, **values)}

    def shared(self, *entries: str, **values: object) -> Slots:
        """The phrasings of several entries by slot, without further ones."""
        return {entry.split(".")[0]: self.phrasings(entry, **values) for entry in entries}


COMMON = TaskText(SHARED)
"""Phrasings of slots that any task may use."""


@cache
def _read(path: Path) -> Mapping[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no TOML file: {error}") from error


@cache
def _templates(path: Path, level: int, name: str) -> Templates:
    data = _read(path)
    try:
        for group in data.get("templates", ()):
            if level in group["levels"] and group.get("name", "") == name:
                own = {**data, **group}
                shared = _read(SHARED)["groups"][own["shared"]] if "shared" in own else {}
                return composed({**shared, **own})
    except KeyError as error:
        raise KeyError(f"{path}: templates lack {error}") from error
    except ValueError as error:
        raise ValueError(f"{path}, level {level}: {error}") from error
    raise KeyError(f"{path} has no templates {name!r} for level {level}")


@lru_cache(maxsize=4096)
def _phrasings(path: Path, entry: str, values: tuple[tuple[str, object], ...]) -> Phrasings:
    found: Any = _read(path).get("phrasings", {})
    try:
        for part in entry.split("."):
            found = found[part]
        train, heldout = (
            tuple(text.format_map(dict(values)) for text in found[split])
            for split in ("train", "heldout")
        )
    except KeyError as error:
        raise KeyError(f"{path} has no {error} of the phrasings {entry!r}") from error
    return train, heldout


NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_ORDINALS = (
    *("first", "second", "third", "fourth", "fifth", "sixth"),
    *("seventh", "eighth", "ninth", "tenth", "eleventh", "twelfth"),
)


def by_count(count: int) -> str:
    """Which of the entries "one", "two" and "many" of a slot's phrasings is for `count`."""
    return {1: "one", 2: "two"}.get(count, "many")


def ordinal(rank: int) -> tuple[str, str]:
    """The two spellings of an ordinal from 1 to 12: ("3rd", "third")."""
    if not 1 <= rank <= len(_ORDINALS):
        raise ValueError(f"no ordinal for {rank}; instructions count from 1 to {len(_ORDINALS)}")
    suffix = {1: "st", 2: "nd", 3: "rd"}.get(rank, "th")
    return f"{rank}{suffix}", _ORDINALS[rank - 1]


def times(count: int) -> Phrasings:
    """How often, as an adverb, for 1 to 3 times."""
    return COMMON.phrasings(f"times.{('once', 'twice', 'thrice')[count - 1]}")


def acting_arm(side: str) -> Slots:
    """{arm} where the rule wants the gripper on one `side` ("left" or "right") to be closed."""
    return {"arm": COMMON.phrasings("acting_arm", side=side)}


def color_orders(colors: Sequence[str]) -> Phrasings:
    """Phrasings for the order of two or more colours, from the first to the last."""
    steps = (", then " if len(colors) > 2 else " and then ").join(colors)
    return (listed(colors, ", then "), steps), _in_turn(colors)


def _in_turn(names: Sequence[str]) -> tuple[str, ...]:
    """Three held-out ways to give the order of two or more things."""
    places = (*("first", "second", "third", "fourth")[: len(names) - 1], "last")
    placed = ", ".join(f"{name} {place}" for name, place in zip(names, places, strict=True))
    start = f"first {', next '.join(names[:-1])} and last {names[-1]}"
    return placed, f"{names[0]} first, followed by {listed(names[1:])}", start


_TRAIN_LINKS = (", then ", ", and then ")


def one_after_another(nouns: Sequence[Phrasings]) -> Phrasings:
    """Phrasings for things in their order; each noun has two train and four held-out phrasings."""
    train = tuple(
        link.join(noun[0][k] for noun in nouns) for k in range(2) for link in _TRAIN_LINKS
    )
    held = [_in_turn([noun[1][k] for noun in nouns]) for k in range(4)]
    return train, tuple(text for ways in held for text in ways)
