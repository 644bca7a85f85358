"""The model card: who made what was evaluated, from which data, and where its weights are.

Weights are at a https address, or remade by a script of this repository ("recipe:scripts/x.sh").
Written as TOML (`robospa submit template`), which Python reads without a further dependency; kept
in the bundle as JSON. Every field is required, of one type, of bounded length, and plain text:
markup, scripts and invisible characters are refused, since names end up on a page.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from importlib.resources import files
from pathlib import Path
from typing import Annotated, get_args, get_origin

from msgspec import Meta, Struct
from msgspec.structs import fields

from robospa.leaderboard.bundle import MEGA, BundleError
from robospa.leaderboard.reserved import check_names
from robospa.leaderboard.strict_json import check_text
from robospa.schema import Sha256, one_of, pattern, read

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


class Training(Struct, frozen=True, forbid_unknown_fields=True):
    """What the model was trained on; demonstrations are per base task, one number a level."""

    tasks: Annotated[str, one_of(("single", "multi"))]
    scenes: Annotated[str, one_of(("clean", "randomised", "both"))]
    demonstrations: tuple[
        Demonstrations, Demonstrations, Demonstrations, Demonstrations, Demonstrations
    ]


class Actions(Struct, frozen=True, forbid_unknown_fields=True):
    """The space of the model's actions, how many make a chunk, and their rate [Hz] in the data."""

    space: Annotated[str, one_of(("joint", "ee", "delta_ee"))]
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
    training: Training
    actions: Actions
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
