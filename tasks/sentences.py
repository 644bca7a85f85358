"""The instructions: 50 + 10 + 10 templates a variant, 100 sentences a scene and split, one a trial.

`templates` are those of the task. `sentences` fills them with the phrasings that the task's
`slots(scene)` offers for a split. `instruction` picks the one sentence of a trial. All three are
pure functions; the pick depends on suite, task, level, seed, split and the secret salt of a hidden
scene only, so that every robot gets the same sentence.

Sentences of the splits `train` and `heldout` are orders; held-out ones have other clauses and word
orders. Those of `indirect` ask, wish, state a goal or a condition. The phrasings that fill
them are split too: those of training are in no other split. A scene has the same sentences in
every mode; with clutter, some of them end in a clause that names the kinds of the objects
(`robospa.tasks.sentences`).
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np

from robospa.tasks import catalog
from robospa.tasks.instructions import SENTENCES, SPLITS, Templates, fill, slot_names
from robospa.tasks.modes.wording import REWORDED, about_nothing_here, reworded
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.seeds import FIRST_TRAINING_SEED, LAST_TRAINING_SEED


def templates(task: str, level: int) -> Templates:
    """The templates of one variant; KeyError for an unknown task, ValueError for a level."""
    if level not in catalog.LEVELS:
        raise ValueError(f"no level {level}; there are {list(catalog.LEVELS)}")
    return catalog.task(task).templates(level)


def sentences(scene: Scene, split: str, salt: str = "") -> tuple[str, ...]:
    """The 100 distinct sentences of a scene and split ("train", "heldout" or "indirect").

    Every template of the split is used equally often, with different phrasings in its slots.
    ValueError if the split is unknown or the slots have too few phrasings.
    """
    made = [fill(*chosen) for chosen in _drawn(scene, split, salt)]
    if len(set(made)) != SENTENCES:
        raise ValueError(
            f"{scene.task} level {scene.level} seed {scene.seed} has {len(set(made))} distinct "
            f"{split} sentences instead of {SENTENCES}; add phrasings to its slots"
        )
    return tuple(_in_clutter(made, scene))


def instruction(scene: Scene, split: str = "heldout", salt: str = "") -> str:
    """The sentence of this trial: one of `sentences(scene, split, salt)`, each equally likely, or
    what the scene's mode makes of it."""
    if "no-sentence" in scene.strengths:
        return ""
    if "other-scene" in scene.strengths:  # of seeds that no evaluation has
        seeds = LAST_TRAINING_SEED - FIRST_TRAINING_SEED
        drawn = int(_generator(scene, split, "other scene", salt).integers(seeds))
        other = catalog.build_scene(scene.task, scene.level, FIRST_TRAINING_SEED + drawn, salt=salt)
        return instruction(other, split, salt)
    split = "indirect" if "indirect" in scene.strengths else split
    index = int(_generator(scene, split, "instruction", salt).integers(SENTENCES))
    if "nothing-here" in scene.strengths:
        return about_nothing_here(scene, _generator(scene, split, "nothing here", salt))
    if axis := next((name for name in REWORDED if name in scene.strengths), ""):
        share = SENTENCES // len(templates(scene.task, scene.level)[_split_index(split)])
        rng, made = _generator(scene, split, axis, salt), sentences(scene, split, salt)
        return reworded(made, index, share, axis, scene.strengths[axis], rng)
    return _in_clutter([fill(*_drawn(scene, split, salt)[index])], scene)[0]


def _drawn(scene: Scene, split: str, salt: str) -> list[tuple[str, dict[str, str]]]:
    """The template and the phrasings of each of the scene's sentences."""
    which = _split_index(split)
    slots = catalog.task(scene.task).slots(scene)
    phrasings = {name: both[min(which, 1)] for name, both in slots.items()}
    chosen = templates(scene.task, scene.level)[which]
    share = SENTENCES // len(chosen)
    rng = _generator(scene, split, "sentences", salt)
    return [(one, found) for one in chosen for found in _fillings(one, phrasings, share, rng)]


def _fillings(
    template: str, phrasings: Mapping[str, tuple[str, ...]], count: int, rng: np.random.Generator
) -> list[dict[str, str]]:
    names = slot_names(template)
    missing = [name for name in names if name not in phrasings]
    if missing:
        raise ValueError(f"template {template!r} needs slot {missing[0]!r}; got {list(phrasings)}")
    choices = list(product(*(dict.fromkeys(phrasings[name]) for name in names)))
    if len(choices) < count:
        raise ValueError(f"only {len(choices)} of {count} fillings of {template!r}; add phrasings")
    picked = rng.permutation(len(choices))[:count]
    return [dict(zip(names, choices[int(i)], strict=True)) for i in picked]


def _in_clutter(sentences: list[str], scene: Scene) -> list[str]:
    """The sentences as they are said where other things lie about, too."""
    apart = scene.clutter and catalog.task(scene.task).dimension != "procedural"
    return told_apart(sentences, scene) if apart else sentences


def _split_index(split: str) -> int:
    if split not in SPLITS:
        raise ValueError(f"no instruction split {split!r}; use one of {list(SPLITS)}")
    return SPLITS.index(split)


def _generator(scene: Scene, split: str, purpose: str, salt: str) -> np.random.Generator:
    _split_index(split)
    place = [scene.task, str(scene.level), str(scene.seed), split, purpose]
    return catalog.generator("/".join([scene.suite, *([salt] if salt else []), *place]))


ANY_KIND = re.compile(r"\b(objects?|items?|things?|pieces?)\b", re.IGNORECASE)
"""Words that fit clutter too."""
PLURALS = {
    "bread": "loaves of bread",
    "soap": "bars of soap",
    "box of french fries": "boxes of french fries",
    "pack of playing cards": "packs of playing cards",
    "computer mouse": "computer mice",
}


def kinds_clause(scene: Scene) -> str:
    """The sentence that names the kinds of the objects, such as "Only the mugs count."."""
    nouns = Counter(object_model(item.asset, item.params).noun for item in scene.objects)
    named = [f"the {noun if count == 1 else plural(noun)}" for noun, count in sorted(nouns.items())]
    last = named.pop()
    return f"Only {', '.join(named)} and {last} count." if named else f"Only {last} count."


def plural(noun: str) -> str:
    """The noun for several: "tea boxes"."""
    return PLURALS.get(noun, f"{noun}es" if noun.endswith("x") else f"{noun}s")


def told_apart(sentences: Iterable[str], scene: Scene) -> list[str]:
    """The sentences, with the clause after those that may be read as speaking of other things."""
    clause = kinds_clause(scene)
    heads = {object_model(o.asset, o.params).noun.split()[-1] for o in scene.objects}
    return [
        f"{sentence} {clause}"
        if ANY_KIND.search(sentence) or not any(head in sentence.lower() for head in heads)
        else sentence
        for sentence in sentences
    ]
