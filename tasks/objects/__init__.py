"""The object library: an asset name and its parameters give shapes, grasps, frames and words.

Assets are made by small functions from primitives and low-polygon meshes: nothing is downloaded
and nothing here knows a simulator. Body frames stand on z = 0 with the origin at the centre of
the underside (asset `block`: at its centre); the front looks towards -y. Other packages add
assets by an entry point (`robospa.registry.ASSETS`).
"""

import difflib
import json
from collections.abc import Mapping
from functools import cache, lru_cache
from types import MappingProxyType

from robospa.registry import ASSETS, find, names
from robospa.tasks import packs
from robospa.tasks.objects import (
    appliances,
    boxes,
    cans,
    containers,
    desk,
    food,
    gadgets,
    groceries,
    stands,
    tableware,
    tools,
)
from robospa.tasks.objects.build import Asset
from robospa.tasks.objects.tint import TINTS, tinted
from robospa.tasks.scene import SceneObject
from robospa.tasks.shapes import ObjectModel, Params

__all__ = ["assets", "model_of", "object_model", "variant_count"]

FAMILIES = (
    *(boxes, cans, containers, food, desk, gadgets),
    *(groceries, stands, tableware, tools, appliances),
)


@cache
def _library() -> Mapping[str, Asset]:
    return {name: asset for family in FAMILIES for name, asset in family.ASSETS.items()}


@cache
def _packs() -> Mapping[str, Asset]:
    """The assets of other installed packages. ValueError for a pack that cannot be used."""
    found: dict[str, Asset] = {}
    for pack in names(ASSETS):
        offered = find(ASSETS, pack, "asset pack")
        if not isinstance(offered, Mapping):
            raise ValueError(f"asset pack {pack!r} is no map from names to assets; see its package")
        for name, asset in offered.items():
            if not isinstance(asset, Asset) or name in _library() or name in found:
                raise ValueError(
                    f"asset pack {pack!r} offers {name!r}, which is no Asset or has a name that is "
                    "taken: give it a name of its own"
                )
            found[name] = asset
    return found


def assets() -> tuple[str, ...]:
    """Names of all assets of this package, sorted; those of other packages are found by name."""
    return tuple(sorted(_library()))


def variant_count(asset: str) -> int:
    """Number of variants of `asset`: params {"look": k} takes k = 0 .. count - 1."""
    return _asset(asset).look_count


def object_model(asset: str, params: Params = MappingProxyType({})) -> ObjectModel:
    """The model of `asset`. `params` are JSON values: "look" (default 0); for `block` also "half"
    (three half sizes in metres) and "color" (linear RGB); for the assets of `tint` also "tint" (a
    word of the palette), which makes the object that colour. "pack" names an asset pack
    (`robospa.tasks.packs`) that gives its own model of the asset.

    Equal arguments give the same object. KeyError, naming near matches, for an unknown asset;
    ValueError for an unknown parameter, a look out of range or a malformed value. A pack may have
    assets of its own.
    """
    if "pack" in params:
        rest = {key: value for key, value in params.items() if key != "pack"}
        return packs.pack(params["pack"]).model(asset, rest)
    _asset(asset)
    look = params.get("look")
    if len(params) == 1 and type(look) is int:  # by far the most frequent: what dumps would say
        return _build(asset, f'{{"look":{look}}}')
    return _build(asset, json.dumps(dict(params), sort_keys=True, separators=(",", ":")))


def model_of(item: SceneObject) -> ObjectModel:
    """The model of an object of a scene."""
    return object_model(item.asset, item.params)


def _asset(name: str) -> Asset:
    found = _library().get(name) or _packs().get(name)
    if found is None:
        known = (*assets(), *sorted(_packs()))
        near = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
        hint = f"did you mean {', '.join(near)}?" if near else f"there are {', '.join(known)}"
        raise KeyError(f"no asset {name!r}; {hint}")
    return found


@lru_cache(maxsize=4096)
def _build(name: str, text: str) -> ObjectModel:
    asset = _asset(name)
    params: Params = json.loads(text)
    known = asset.params | {"look"} | ({"tint"} if name in TINTS else set())
    unknown = sorted(set(params) - known)
    if unknown:
        allowed = ", ".join(sorted(known))
        raise ValueError(f"asset {name!r} has no parameter {unknown[0]!r}; it takes {allowed}")
    look = params.get("look", 0)
    if isinstance(look, bool) or not isinstance(look, int) or not 0 <= look < asset.look_count:
        raise ValueError(f"asset {name!r} has looks 0 to {asset.look_count - 1}, not {look!r}")
    made = asset.build(look, params)
    return tinted(made, str(params["tint"])) if "tint" in params else made
