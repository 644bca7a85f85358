"""The model card: who made what was evaluated, from which data, and where its weights are.

Written as TOML (`robospa submit template`), kept in the bundle as JSON. Weights are at a https
address, or remade by a script of this repository ("recipe:scripts/x.sh"). Markup, scripts and
invisible characters are refused, since names end up on a page.

Names of the paper's models and team are taken, however they are spelt: they are compared by their
skeleton, without case, accents, spaces and punctuation, with characters that look alike as one. A
name that says more, such as "pi0.5 (our lab)", is free.
"""

import re
import unicodedata
from collections.abc import Collection
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, get_args, get_origin

from msgspec import Meta, Struct
from msgspec.structs import fields

from robospa.leaderboard.bundle import MEGA, BundleError, check_text
from robospa.results.paper.published import TITLES, load
from robospa.schema import Sha256, one_of, pattern, read

LOOK_ALIKE = str.maketrans(
    {
        **{"π": "pi", "ρ": "p", "ο": "o", "α": "a", "ν": "v", "χ": "x", "ι": "i", "κ": "k"},
        **{"τ": "t", "β": "b", "λ": "a"},
        **{"а": "a", "в": "b", "е": "e", "к": "k", "м": "m", "н": "h", "о": "o", "р": "p"},
        **{"с": "c", "т": "t", "у": "y", "х": "x", "і": "i", "ј": "j", "ѕ": "s", "г": "r"},
        **{"ԁ": "d", "ԍ": "g", "ѵ": "v", "ӏ": "l", "п": "n", "ɡ": "g", "ɑ": "a", "ı": "i"},
        **{"0": "o", "1": "l", "i": "l", "5": "s"},
    }
)
"""Greek and Cyrillic letters, and digits, as the Latin letters that they are taken for."""
LATIN = re.compile("LATIN .*LETTER (?:SMALL CAPITAL )?([A-Z])(?: WITH .*)?")
"""Unicode's name of a Latin letter, with or without strokes and hooks."""
SCRIPTS = frozenset(("LATIN", "GREEK", "CYRILLIC", "CJK", "HANGUL", "HIRAGANA", "KATAKANA"))
"""Scripts of names. Others, such as Lisu and Cherokee, have letters that nobody tells from Latin
ones."""


def skeleton(text: str) -> str:
    """`text` as a hurried reader sees it: letters alone, look-alikes as one."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    plain = "".join(m[1].lower() if (m := LATIN.fullmatch(_name(c))) else c for c in plain)
    return "".join(c for c in plain.translate(LOOK_ALIKE).translate(LOOK_ALIKE) if c.isalnum())


def _name(character: str) -> str:
    return unicodedata.name(character, "")


OWNER = skeleton("RoboSPA")
"""Nobody's team or model has the benchmark in its name: it would pass for the authors'."""
CLAIMS = frozenset(map(skeleton, ("paper", "official", "published", "original", "authors", "the")))
"""Words that make a model's name no other name."""


@cache
def published_names() -> dict[str, str]:
    """The paper's models by the skeletons of their names."""
    titles = {model: TITLES.get(model, model) for model in load().models}
    return {skeleton(name): title for model, title in titles.items() for name in (model, title)}


def check_folder(name: str) -> None:
    """BundleError if a submission's folder is called like a model of the paper."""
    if taken := published_names().get(skeleton(name)):
        raise BundleError(
            f"the folder's name {name[:80]!a} is that of the paper's {taken}: add what is yours, "
            f"such as {name[:40]}-our-lab"
        )


def check_names(name: str, team: str) -> None:
    """BundleError if a model card's `name` or `team` would pass for the paper's."""
    if taken := published_names().get("".join(_said(name))):
        raise BundleError(
            f"the model card's name {name[:80]!a} is that of the paper's {taken}: add what is "
            f"yours, such as {name[:40]!a} and your team's name"
        )
    for what, text in (("name", name), ("team", team)):
        for c in unicodedata.normalize("NFKD", text):
            if c.isalnum() and not c.isascii() and _name(c).partition(" ")[0] not in SCRIPTS:
                raise BundleError(
                    f"the model card's {what} {text[:80]!a} has the character {c!a} ({_name(c)}), "
                    "which may be taken for another: use Latin letters"
                )
        said = _said(text)
        if OWNER in said or "".join(said) == OWNER:
            raise BundleError(
                f"the model card's {what} {text[:80]!a} has the benchmark's name in it, as if it "
                "came from the paper: choose another"
            )


def _said(text: str) -> list[str]:
    """The skeletons of the words of `text`, without those that say nothing."""
    words = (skeleton(word) for word in re.split(r"[\W_]+", text))
    return [word for word in words if word and word not in CLAIMS]


LINK = re.compile(r"https://[A-Za-z0-9.-]+(:[0-9]+)?(/[A-Za-z0-9._~/%+=@:,-]*)?")
RECIPE = re.compile(r"recipe:(scripts/[a-z0-9_]{1,60}\.sh)")
"""The script of this repository that remakes weights."""
ALL = "all"
"""The checkpoint of a model that does every task."""

Source = Annotated[
    str,
    pattern(
        rf"(?=.{{1,300}}\Z)(?:{LINK.pattern}|{RECIPE.pattern})",
        "a https address of at most 300 characters, or recipe:scripts/NAME.sh of this repository",
    ),
]
Demonstrations = Annotated[int, Meta(ge=0, le=10**7)]


def _plain(most: int) -> Meta:
    """The rule that a text is of 1 to `most` characters, not all of them spaces."""
    return pattern(
        rf"(?=.*\S)[^<>\"`\\{{}}\n\r\t]{{1,{most}}}",
        f"text of 1 to {most} plain characters (no line breaks, quotes, braces or < >)",
    )


class CardTraining(Struct, frozen=True, forbid_unknown_fields=True):
    """What the model was trained on; demonstrations are per base task, one number a level."""

    tasks: Annotated[str, one_of(("single", "multi"))]
    scenes: Annotated[str, one_of(("clean", "randomised", "both"))]
    demonstrations: tuple[
        Demonstrations, Demonstrations, Demonstrations, Demonstrations, Demonstrations
    ]


class CardActions(Struct, frozen=True, forbid_unknown_fields=True):
    """The space of the model's actions, how many make a chunk, and their rate [Hz] in the data."""

    space: Annotated[str, one_of(("joint", "ee", "delta_ee", "skill"))]
    chunk: Annotated[int, Meta(ge=1, le=10_000)]
    rate: Annotated[int, Meta(gt=0, le=10_000)] | Annotated[float, Meta(gt=0, le=10_000)]


class Checkpoint(Struct, frozen=True, forbid_unknown_fields=True):
    """Where weights are, or the recipe that remakes them, and their hash."""

    reference: Source
    sha256: Sha256


class Card(Struct, frozen=True, forbid_unknown_fields=True):
    """A model card. `checkpoints` are by base task, or under ALL."""

    name: Annotated[str, _plain(80)]
    team: Annotated[str, _plain(200)]
    licence: Annotated[str, _plain(80)]
    parameters: Annotated[int, Meta(ge=0, le=10**14)]
    link: Source
    training: CardTraining
    actions: CardActions
    checkpoints: dict[str, Checkpoint]

    def __post_init__(self) -> None:
        if not (self.name + self.team + self.licence).isprintable():
            raise ValueError("name, team and licence may hold printable characters only")


def recipe_of(source: str) -> str | None:
    """The path of the script that a `source` names, None for a https address."""
    found = RECIPE.fullmatch(source)
    return found[1] if found else None


def template() -> str:
    """The card to fill in, as TOML with comments."""
    return files("robospa.leaderboard").joinpath("model.toml").read_text(encoding="utf-8")


def read_card(path: Path) -> Card:
    """The card in the TOML file `path`, not yet held against a run; BundleError if it is none."""
    import tomllib

    if path.suffix in (".yaml", ".yml"):
        raise BundleError(
            f"{path} is YAML; the model card is TOML: `robospa submit template > model.toml` "
            "writes one to fill in"
        )
    try:
        if path.stat().st_size > MEGA:
            raise BundleError(f"{path} is larger than a model card can be")
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BundleError(f"the model card {path} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BundleError(f"the model card {path} is not TOML: {error}") from None
    if len(found := _faults(Card, data)) > 1:
        listed = "".join(f"\n  {fault}" for fault in found)
        raise BundleError(f"the model card {path} has {len(found)} faults:{listed}")
    return to_card(data)


def _faults(schema: type[Struct], data: object, place: str = "") -> list[str]:
    """Everything in `data` that the fields of `schema` do not allow, a line each."""
    if not isinstance(data, dict):
        return [f"{place.rstrip('.')!r} is not a table"]
    names = {field.name for field in fields(schema)}
    found = [f"{place + name!r} is no field of a model card" for name in data if name not in names]
    for field in fields(schema):
        path = f"{place}{field.name}"
        if field.name not in data:
            found.append(f"{path!r} is missing")
        elif isinstance(inner := data[field.name], dict) and isinstance(field.type, type):
            found += _faults(field.type, inner, f"{path}.")
        elif isinstance(inner, dict) and get_origin(field.type) is dict:
            for name, value in inner.items():
                found += _faults(get_args(field.type)[1], value, f"{path}.{name}.")
        else:
            try:
                read(field.type, inner, repr(path))
            except ValueError as error:
                found.append(str(error))
    return found


def to_card(data: object, what: str = "the model card") -> Card:
    """`data`, decoded JSON or TOML, as a card; BundleError naming the first field that is missing,
    unknown or not what it has to be."""
    check_text(data, what)
    card = read(Card, data, what, BundleError)
    check_names(card.name, card.team)
    return card


def check_checkpoints(card: Card, tasks: Collection[str], what: str = "the model card") -> None:
    """BundleError unless `card` has a checkpoint for each of `tasks`, the base tasks of the run, if
    it is of a model trained for one task at a time, and else one for all."""
    points = set(card.checkpoints)
    if points == {ALL} and len(tasks) == 1:
        return
    needed = set(tasks) if card.training.tasks == "single" else {ALL}
    if missing := sorted(needed - points):
        raise BundleError(
            f"{what} has no checkpoint for {', '.join(missing[:3])}: [checkpoints] has a table for "
            'every base task if training.tasks is "single", and the table "all" if it is "multi"'
        )
    if extra := sorted(points - needed):
        raise BundleError(
            f"{what} has a checkpoint for {extra[0][:80]}, which the run has no trials of"
        )
