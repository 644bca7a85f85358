"""Asset packs: worlds of objects besides the built-in one, and scenes made of them.

A scene says of each object which pack gives its model, in the object's parameters:
`{"look": 2, "pack": "official"}`. Without that the object is built in. What an asset is called,
where it lies and which frames it has stays the same, so that tasks, goals and plans know of no
pack; shapes, size, weight, grasps and where the frames are come from the pack.

Other packages add packs by an entry point (`robospa.registry.PACKS`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Protocol

from robospa.registry import PACKS, find

if TYPE_CHECKING:
    from robospa.tasks.scene import Scene, SceneObject
    from robospa.tasks.shapes import ObjectModel, Params


class PackError(ValueError):
    """A model that cannot be made, however often one tries; one sentence for the files' owner."""


class Pack(Protocol):
    """Gives models for assets. Equal arguments give equal models, in every process that sees the
    same files."""

    name: str

    def has(self, asset: str, params: Params) -> bool:
        """Whether the pack is meant to have a model for it; others stay built in."""

    def model(self, asset: str, params: Params) -> ObjectModel:
        """The model of `asset`, its frame as that of the built-in one: z up, standing on z = 0.
        PackError if it cannot be made."""

    def digest(self) -> str:
        """Hash of the files that models are made of, for manifests; empty without files."""


@cache
def pack(name: str) -> Pack:
    """The pack called `name`, opened once in a process. UnknownName, saying which there are, or
    ValueError if it cannot be opened."""
    opened: Pack = find(PACKS, name, "asset pack")()
    return opened


def with_pack(scene: Scene, name: str) -> Scene:
    """`scene` with the objects and the clutter of the pack called `name`, where it has them."""
    chosen = pack(name)

    def packed(item: SceneObject) -> SceneObject:
        if not chosen.has(item.asset, item.params):
            return item
        return replace(item, params={**item.params, "pack": name})

    return replace(
        scene, objects=tuple(map(packed, scene.objects)), clutter=tuple(map(packed, scene.clutter))
    )
