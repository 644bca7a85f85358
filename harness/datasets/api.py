"""`robospa.collect`: a data set of demonstrations as one call, with every setting as a keyword."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TypeVar

from robospa.harness.datasets.collect import CollectionResult, Order
from robospa.harness.datasets.collect import collect as make
from robospa.harness.datasets.jobs import MAKER
from robospa.harness.datasets.open_pool import pool_opener
from robospa.harness.datasets.settings import Collection, command_of, versions
from robospa.harness.settings import LISTS, Compute, SettingsError
from robospa.protocol.options import read_options
from robospa.registry import did_you_mean

T = TypeVar("T")

TEXTS = (*LISTS, "cameras")
"""Settings that may be given as lists: ["GAC", "RPF"] is "GAC,RPF"."""


def collect(
    out: str | Path,
    *,
    tasks: str | Sequence[str] = "all",
    levels: str | int | Sequence[int] = "1-5",
    episodes: int = 50,
    workers: int = 0,
    format: str = "lerobot-v3",
    resume: bool = False,
    **settings: object,
) -> CollectionResult | None:
    """Collect demonstrations of the expert into `out`, and return what was made.

        made = robospa.collect("data/mine", tasks="GAC", levels=1, episodes=10)

    Args:
        out: Folder of the data set.
        tasks: Names of tasks, categories or dimensions.
        levels: From 1 to 5.
        episodes: Per variant.
        workers: Worker processes; 0 for one a core.
        format: "lerobot-v3", "lerobot-v2.1" or "robotwin-hdf5".
        resume: Go on with the data set in `out`.
        settings: Any other setting of `robospa collect`, such as cameras="head" or noise=0.2.

    Returns:
        The folders, the number of episodes and what is missing; None if the data set was finished.

    Raises:
        SettingsError: A setting is unknown or impossible; nothing was written.
        RunError: Another process is at it, or `out` holds something else.
        MakerError: An episode cannot be made on this machine; StorageError if `out` cannot be
            written. What is done is kept, and `resume` goes on.
    """
    return _collect(
        out,
        {"tasks": tasks, "levels": levels, "episodes": episodes, "workers": workers, **settings},
        format,
        resume,
    )


def _collect(
    out: str | Path,
    given: dict[str, object],
    layout: str,
    resume: bool = False,
    maker: str = MAKER,
) -> CollectionResult | None:
    """`collect` with all settings by name; `maker` makes the episodes."""
    kinds = (Collection, Compute)
    known = [field.name for kind in kinds for field in fields(kind)]
    if unknown := next((name for name in given if name not in known), None):
        near = did_you_mean(unknown, known)
        listed = ", ".join(known)
        raise SettingsError(f"there is no setting {unknown!r}; {near}known are {listed}")
    collection, compute = _settings(Collection, given), _settings(Compute, given)
    order = Order(collection, layout, Path(out), command_of(collection, layout), versions())
    with pool_opener(compute, maker) as open_pool:
        return make(order, open_pool, resume=resume)


def _settings(kind: type[T], given: Mapping[str, object]) -> T:
    """One group of settings, of those that are `given`."""
    names = [field.name for field in fields(kind) if field.name in given]  # type: ignore[arg-type]
    try:
        return read_options(kind, {name: _text(name, given[name]) for name in names})
    except SettingsError:
        raise
    except ValueError as error:
        raise SettingsError(str(error)) from error


def _text(name: str, value: object) -> object:
    """`value`, but one text for a list, where TEXTS allow that."""
    if name not in TEXTS or isinstance(value, str):
        return value
    return ",".join(map(str, value)) if isinstance(value, Sequence) else str(value)
