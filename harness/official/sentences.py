"""The sentences of a RoboSPA checkout, filled as officially: read once, then plain data.

    description/task_instruction/<Task>_<level>.json     "seen" and "unseen" templates
    description/objects_description/071_can/base3.json   "raw_description", "seen", "unseen"

A template is usable when its placeholders are exactly those of the scene, or those without any arm.
An arm `left` becomes "the left arm", an object "the " and one of its descriptions, every other
value stands as it is. Test templates get test descriptions.

Ours: which template and descriptions a trial gets follows from its key; officially it depends on an
unseeded list. And a thing that is not drawn with the official model is named by the model's
`raw_description`, because the other descriptions say how that model looks.

Of a checkout's test sentences some stand in training, or are like one of it (`overlap`); our own
held-out sentences pass that test with none (`docs/instructions.md`).
"""

import hashlib
import json
import re
import stat
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from robospa.harness.official.slots import NoOfficialSentence, arms, official_values
from robospa.harness.trial import TrialSetup, task_parts
from robospa.schema import parse_json, read
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.instructions import similarity
from robospa.tasks.official import official_assets, official_model, official_models
from robospa.tasks.scene import Scene, SceneObject
from robospa.trial import TrialKey

SEEN, UNSEEN = "official_seen", "official_unseen"
"""Instruction splits of official sentences: those to train with, and those to test with."""
SPLITS = {"train": SEEN, "heldout": UNSEEN}
"""The official split in the place of each of ours; there is none in that of `indirect`."""
TEMPLATES = Path("description", "task_instruction")
DESCRIPTIONS = Path("description", "objects_description")
MOST_BYTES = 2**20
_PLACEHOLDER = re.compile(r"\{([^{}]+)\}")


class CheckoutError(ValueError):
    """A checkout of RoboSPA lacks something or is broken; the message says what and where."""


@dataclass(frozen=True)
class Texts:
    """The `seen` and `unseen` texts of a variant or a model, and what a model is called plainly."""

    seen: tuple[str, ...]
    unseen: tuple[str, ...]
    plain: str = ""

    def of(self, split: str) -> tuple[str, ...]:
        """The texts of an official split; those to train with where there are none to test with."""
        return (self.unseen or self.seen) if split == UNSEEN else self.seen


@dataclass(frozen=True)
class OfficialSentences:
    """What a checkout says of some variants; `digest` is a hash over all of it."""

    templates: Mapping[tuple[str, int], Texts]
    descriptions: Mapping[str, Texts]
    """By model, such as "071_can/base3"."""
    digest: str

    def usable(self, scene: Scene, split: str) -> tuple[str, ...]:
        """The templates of `split` whose placeholders fit `scene`."""
        texts = self.templates.get((scene.task, scene.level))
        if texts is None:
            raise NoOfficialSentence(f"no sentences of {scene.task} level {scene.level} were read")
        lists = texts.unseen if split == UNSEEN else texts.seen
        values = official_values(scene)
        return tuple(template for template in lists if fits(template, values))

    def instruction(self, scene: Scene, split: str, salt: str = "") -> str:
        """The sentence of this trial, of SEEN or UNSEEN; raises NoOfficialSentence, CheckoutError.
        It depends on suite, task, level, seed, split and `salt` alone."""
        if split not in (SEEN, UNSEEN):
            raise NoOfficialSentence(f"no official split {split!r}; there are {SEEN} and {UNSEEN}")
        values = official_values(scene)
        found = self.usable(scene, split)
        if not found:
            keys = ", ".join(f"{{{key}}}" for key in sorted(values)) or "none"
            raise NoOfficialSentence(
                f"no {split} template of {scene.task} level {scene.level} fits its placeholders "
                f"({keys}): is the checkout of another version?"
            )
        rng = _generator(scene, split, salt)
        template, hands = _one(found, rng), arms(values)

        def text(name: str) -> str:
            value = values[name]
            if isinstance(value, SceneObject):
                return f"the {self._thing(value, split, rng)}"
            return f"the {value} arm" if name in hands else value

        # Values are drawn in the order of the placeholders' names, whatever the template's order.
        filled = {name: text(name) for name in sorted(placeholders(template))}
        return _PLACEHOLDER.sub(lambda found: filled[found[1]], template)

    def _thing(self, item: SceneObject, split: str, rng: np.random.Generator) -> str:
        model = official_model(item.asset, item.params.get("look", 0))
        if model is None:
            raise NoOfficialSentence(f"asset {item.asset} has no official model to be described")
        texts = self.descriptions.get(model.name)
        if texts is None:
            raise CheckoutError(
                f"the checkout does not describe {model.name}: copy {DESCRIPTIONS} of RoboTwin 2.0 "
                "into it, which RoboSPA is built on"
            )
        official = item.params.get("pack") == "official"
        return _one(texts.of(split), rng) if official else texts.plain


def _one(texts: Sequence[str], rng: np.random.Generator) -> str:
    return texts[int(rng.integers(len(texts)))]


def placeholders(template: str) -> set[str]:
    """The names in braces in `template`."""
    return set(_PLACEHOLDER.findall(template))


def fits(template: str, keys: Collection[str]) -> bool:
    """Whether `template` is usable where there are values for `keys` (the official rule)."""
    found, hands = placeholders(template), arms(keys)
    return found == set(keys) or found == set(keys) - hands


def read_checkout(folder: Path, variants: Iterable[tuple[str, int]]) -> OfficialSentences:
    """The sentences of `variants`, (task, level), in the checkout at `folder`. Raises
    CheckoutError, naming the file, if one is missing or broken."""
    if not (folder / TEMPLATES).is_dir():
        raise CheckoutError(
            f"{folder} is no checkout of RoboSPA: it has no folder {TEMPLATES}; name the folder "
            "that holds description/ and envs/"
        )
    wanted = sorted(set(variants))
    templates = {at: _read(folder / TEMPLATES / f"{at[0]}_{at[1]}.json") for at in wanted}
    descriptions: dict[str, Texts] = {}
    folders = {model.folder for asset in official_assets() for model in official_models(asset)}
    for name in sorted(folders):
        for path in sorted((folder / DESCRIPTIONS / name).glob("base*.json")):
            descriptions[f"{name}/{path.stem}"] = _read(path, described=True)
    rows = [[f"{task}_{level}", t.seen, t.unseen] for (task, level), t in templates.items()]
    rows += [[name, t.seen, t.unseen, t.plain] for name, t in descriptions.items()]
    digest = hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:16]
    return OfficialSentences(templates, descriptions, digest)


def spoken_parts(key: TrialKey, sentences: OfficialSentences, salt: str = "") -> TrialSetup:
    """Scene and goal of `key` from the catalog, with a sentence of the checkout. Raises KeyError or
    ValueError if something of `key` is unknown, or has no official sentence."""
    task = find_task(key.task)
    scene = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode, salt)
    said = sentences.instruction(scene, key.split, salt)
    return TrialSetup(scene, task, task.goal(scene), said)


def unspoken_parts(key: TrialKey, salt: str = "") -> TrialSetup:
    """The same without the checkout, for what only shows a trial that has been run: its sentence
    is one of ours, and tells nothing."""
    return task_parts(replace(key, split="heldout"), salt)


Line = Annotated[str, Meta(min_length=1, max_length=500)]
Lines = Annotated[tuple[Line, ...], Meta(max_length=2000)]


class _File(msgspec.Struct):
    seen: Lines = ()
    unseen: Lines = ()
    raw_description: Line | None = None


def _read(path: Path, described: bool = False) -> Texts:
    try:
        if not stat.S_ISREG((state := path.stat()).st_mode):
            raise ValueError("it is no file")
        if state.st_size > MOST_BYTES:
            raise ValueError(f"it has more than {MOST_BYTES} bytes, and no official file has")
        data = parse_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise CheckoutError(
            f"{path} does not exist: update the checkout, or leave this variant out"
        ) from error
    except (OSError, ValueError) as error:
        raise CheckoutError(f"{path} cannot be read: {str(error)[:200]}") from error
    said = read(_File, data, str(path), CheckoutError)
    if not all(text.isprintable() for text in (*said.seen, *said.unseen)):
        raise CheckoutError(f"{path} has an entry that is no line of text")
    if described and not (said.raw_description and said.seen):
        raise CheckoutError(f"{path} describes no object: raw_description or seen is missing")
    if not described and not (said.seen and said.unseen):
        raise CheckoutError(f"{path} has no sentences: seen or unseen is empty")
    return Texts(said.seen, said.unseen, said.raw_description or "")


def _generator(scene: Scene, split: str, salt: str) -> np.random.Generator:
    place: Sequence[str] = (scene.task, str(scene.level), str(scene.seed), split)
    text = "/".join([scene.suite, *([salt] if salt else []), *place])
    entropy = int.from_bytes(hashlib.sha256(text.encode()).digest()[:16], "big")
    return np.random.Generator(np.random.PCG64(entropy))


NEAR = 0.75
"""From this similarity on two templates count as alike, in our own test too."""


@dataclass(frozen=True)
class Overlap:
    """Of the `tests` different test templates of a variant: how many stand in training `equal`ly,
    and how many are `near` one of training (those that are equal, too)."""

    tests: int
    equal: int
    near: int
    examples: tuple[str, ...] = ()
    """Those that stand in training word for word."""


def overlap(texts: Texts) -> Overlap:
    """The overlap of one variant's templates; case and spaces do not matter."""
    seen = {_plain(text) for text in texts.seen}
    tests = list(dict.fromkeys(texts.unseen))
    equal = tuple(text for text in tests if _plain(text) in seen)
    near = sum(
        text in equal or any(similarity(text, other) >= NEAR for other in texts.seen)
        for text in tests
    )
    return Overlap(len(tests), len(equal), near, equal)


def report(sentences: OfficialSentences) -> dict[str, Any]:
    """For a run's manifest: the sums over all variants, and each variant, as JSON values."""
    found = {f"{task} {level}": overlap(of) for (task, level), of in sentences.templates.items()}
    sums = {n: sum(getattr(o, n) for o in found.values()) for n in ("tests", "equal", "near")}
    rows = {name: asdict(one) for name, one in found.items()}
    return {"hash": sentences.digest, **sums, "variants": rows}


def sentence_of(sentences: OfficialSentences) -> str:
    """The sums in words."""
    found = report(sentences)
    return (
        f"official sentences: of {found['tests']} test templates of {len(found['variants'])} "
        f"variants, {found['equal']} stand in training word for word and {found['near']} are alike "
        "or equal to one of training"
    )


def _plain(text: str) -> str:
    return " ".join(text.casefold().split())


@dataclass(frozen=True)
class VariantSurvey:
    """Of a variant: how many of its templates fit a scene (to train with, to test with), what of
    the test is trained on, and a test sentence, or the `trouble` why there is none."""

    task: str
    level: int
    seen: tuple[int, int]
    unseen: tuple[int, int]
    overlap: Overlap
    example: str = ""
    trouble: str = ""

    def __str__(self) -> str:
        fit = ", ".join(f"{a} of {b}" for a, b in (self.seen, self.unseen))
        same = f"{self.overlap.equal} equal, {self.overlap.near} alike of {self.overlap.tests}"
        return f"{self.task} {self.level}: fit {fit}; {same}; {self.trouble or self.example}"


def survey(
    sentences: OfficialSentences, variants: Iterable[tuple[str, int]], seed: int
) -> list[VariantSurvey]:
    """A row for each of `variants`, with the sentence of the scene of `seed`."""
    rows = []
    for task, level in variants:
        scene, texts = build_scene(task, level, seed), sentences.templates[(task, level)]
        example = trouble = ""
        try:
            example = sentences.instruction(scene, UNSEEN)
        except ValueError as error:
            trouble = str(error)
        seen = len(sentences.usable(scene, SEEN)), len(texts.seen)
        unseen = len(sentences.usable(scene, UNSEEN)), len(texts.unseen)
        rows.append(VariantSurvey(task, level, seen, unseen, overlap(texts), example, trouble))
    return rows
