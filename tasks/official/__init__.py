"""Which model of the official archive each look of our assets stands for.

Assets that are not listed here (blocks, pads, covers, T-shaped blocks, the garbage ball) are boxes
and balls officially too, or are not published: they are always built in.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from robospa.geometry import Vec3, vec3

POINTS = frozenset({"press", "touched", "support", "left", "right", "tip", "handle"})
"""Our frames that may lie at a point of the archive."""


@dataclass(frozen=True)
class OfficialModel:
    """A model of the archive, and how its frame becomes ours (see models.toml). A `jointed` one is
    a URDF file in a sub-folder called `model`, one with a `hinge` has a door; a `hollow` one is
    open at its top. `points` gives for some of our frames the archive's point where they lie, such
    as "contact 2"."""

    folder: str
    model: str
    turns: int = 0
    lies: bool = False
    faces: str = ""
    hinge: bool = False
    hollow: bool = False
    jointed: bool = False
    points: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """As the official scene files and object descriptions write it: "071_can/base3"."""
        return f"{self.folder}/base{self.model}"

    def __str__(self) -> str:
        return f"the official model {self.name}"


@dataclass(frozen=True)
class OfficialSize:
    """`size` [m] across, up and deep, the widths upper bounds (boxes of turned models); `centre`
    [m] of that box from the model's origin; how many points of each kind the archive gives."""

    size: Vec3
    centre: Vec3
    contacts: int
    functional: int


def official_model(asset: str, look: int) -> OfficialModel | None:
    """The archive's model of that look; None if `asset` is none of the archive's. ValueError if
    the asset has no such look."""
    models = official_models(asset)
    if models and not 0 <= look < len(models):
        raise ValueError(f"asset {asset!r} has official models of looks 0 to {len(models) - 1}")
    return models[look] if models else None


def official_models(asset: str) -> tuple[OfficialModel, ...]:
    """The archive's model of each look of `asset`; none for one that is always built in."""
    return _models().get(asset, ())


def official_assets() -> tuple[str, ...]:
    """Our assets that have models in the archive, sorted."""
    return tuple(sorted(_models()))


@cache
def _models() -> Mapping[str, tuple[OfficialModel, ...]]:
    return {
        asset: tuple(
            OfficialModel(
                row["folder"],
                str(model),
                turns,
                jointed=isinstance(model, str),
                points={frame: point for frame, point in row.items() if frame in POINTS},
                **{name: row[name] for name in ("lies", "faces", "hinge", "hollow") if name in row},
            )
            for model, turns in zip(
                row["models"], row.get("turns", [0] * len(row["models"])), strict=True
            )
        )
        for asset, row in _rows("models").items()
    }


def _rows(name: str) -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / f"{name}.toml").read_text("utf-8"))


@cache
def needs() -> Mapping[str, tuple[str, ...]]:
    """For each of the benchmark's tasks, the assets of `official_assets` that its scenes hold."""
    return {task: tuple(assets) for task, assets in _rows("needs").items()}


@cache
def _sizes() -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
    return _rows("sizes")


def official_size(model: OfficialModel) -> OfficialSize | None:
    """How large the archive says that `model` is; None for jointed ones: it does not say."""
    row = _sizes().get(model.folder, {}).get(model.model)
    if row is None:
        return None
    size, centre = vec3(row["size"]), vec3(row["centre"])
    return OfficialSize(size, centre, row["contacts"], row["functional"])


@cache
def clutter_alike() -> Mapping[str, frozenset[str]]:
    """For each category of things that only lie about, our assets that it may be taken for."""
    return {category: frozenset(assets) for category, assets in _rows("clutter").items()}
