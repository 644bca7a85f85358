"""The model card: who made what was evaluated, from which data, and where its weights are.

Written as TOML (`robospa submit template`), which Python reads without a further dependency; kept
in the bundle as JSON. Every field is required, of one type, of bounded length, and plain text:
markup, scripts and invisible characters are refused, since names end up on a page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from robospa.leaderboard.bundle import MEGA, BundleError
from robospa.leaderboard.strict_json import is_hash, look

LINK = re.compile(r"https://[A-Za-z0-9.-]+(:[0-9]+)?(/[A-Za-z0-9._~/%+=@:,-]*)?")
LEVELS = 5
ALL = "all"
"""The checkpoint of a model that does every task."""
Check = Callable[[Any], bool]


def _text(most: int) -> Check:
    return lambda v: isinstance(v, str) and len(v.strip()) > 0 and len(v) <= most and _plain(v)


def _plain(value: str) -> bool:
    return value.isprintable() and not set(value) & set('<>"`\\{}')


def _whole(low: int, high: int) -> Check:
    return lambda v: type(v) is int and low <= v <= high


def _one_of(*words: str) -> Check:
    return lambda v: isinstance(v, str) and v in words


def _number(v: Any) -> bool:
    return type(v) in (int, float) and 0 < v <= 10_000


def _link(v: Any) -> bool:
    return isinstance(v, str) and len(v) <= 300 and LINK.fullmatch(v) is not None


def _demonstrations(v: Any) -> bool:
    return isinstance(v, list) and len(v) == LEVELS and all(_whole(0, 10**7)(n) for n in v)


FIELDS: Mapping[str, Mapping[str, tuple[Check, str]]] = {
    "": {
        "name": (_text(80), "text of at most 80 plain characters"),
        "team": (_text(200), "text of at most 200 plain characters"),
        "licence": (_text(80), "text of at most 80 plain characters, best an SPDX name"),
        "parameters": (_whole(0, 10**14), "a whole number of parameters"),
        "link": (_link, "a https address"),
    },
    "training": {
        "tasks": (_one_of("single", "multi"), '"single" or "multi"'),
        "scenes": (_one_of("clean", "randomised", "both"), '"clean", "randomised" or "both"'),
        "demonstrations": (_demonstrations, "five whole numbers, one a level, per base task"),
    },
    "actions": {
        "space": (_one_of("joint", "ee", "delta_ee"), '"joint", "ee" or "delta_ee"'),
        "chunk": (_whole(1, 10_000), "the number of actions of a chunk"),
        "rate": (_number, "the rate [Hz] of the demonstrations' actions"),
    },
}
CHECKPOINT = {
    "reference": (_link, "a https address"),
    "sha256": (is_hash, "64 hexadecimal digits"),
}


def template() -> str:
    """The card to fill in, as TOML with comments."""
    return files("robospa.leaderboard").joinpath("model.toml").read_text(encoding="utf-8")


def read_card(path: Path) -> dict[str, Any]:
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
    except ValueError as error:
        raise BundleError(f"the model card {path} is not TOML: {error}") from None
    return data


def check_card(
    card: Mapping[str, Any], tasks: Collection[str], what: str = "the model card"
) -> None:
    """BundleError for the first field of `card` that is missing, unknown or not what it has to be.

    `tasks` are the base tasks of the run: a model trained for one task at a time has a checkpoint
    for each of them.
    """
    look(dict(card), what)
    groups = [name for name in FIELDS if name]
    _only(card, {*FIELDS[""], *groups, "checkpoints"}, what)
    for group, fields in FIELDS.items():
        part = card.get(group) if group else card
        if not isinstance(part, Mapping):
            raise BundleError(f"{what} has no table [{group}]")
        if group:
            _only(part, fields, f"{what}, [{group}]")
        _check(part, fields, f"{what}, [{group}]" if group else what)
    _check_points(card, tasks, what)


def _check_points(card: Mapping[str, Any], tasks: Collection[str], what: str) -> None:
    points = card.get("checkpoints")
    if not isinstance(points, Mapping) or not points:
        raise BundleError(f"{what} has no table [checkpoints]")
    for name, point in points.items():
        where = f"{what}, [checkpoints.{name}]"
        if not isinstance(point, Mapping):
            raise BundleError(f"{where} is no table of reference and sha256")
        _only(point, CHECKPOINT, where)
        _check(point, CHECKPOINT, where)
    wanted = set(tasks) if card["training"]["tasks"] == "single" else {ALL}
    if set(points) == {ALL} and len(tasks) == 1:
        return
    if missing := sorted(wanted - set(points)):
        raise BundleError(
            f"{what} has no checkpoint for {', '.join(missing[:3])}: [checkpoints] has a table for "
            'every base task if training.tasks is "single", and the table "all" if it is "multi"'
        )
    if strange := sorted(set(points) - wanted):
        raise BundleError(
            f"{what} has a checkpoint for {strange[0]}, which the run has no trials of"
        )


def _check(part: Mapping[str, Any], fields: Mapping[str, tuple[Check, str]], where: str) -> None:
    for name, (right, words) in fields.items():
        if name not in part:
            raise BundleError(f"{where} does not say {name}: {words}")
        if not right(part[name]):
            raise BundleError(f"{where}: {name} is not {words}")


def _only(part: Mapping[str, Any], known: Collection[str], where: str) -> None:
    if strange := sorted(str(name) for name in set(part) - set(known)):
        raise BundleError(f"{where} has a field that no card has: {strange[0][:40]!a}")
