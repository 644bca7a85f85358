"""Asset packs: worlds of objects besides the built-in one, and scenes made of them.

A scene says of each object which pack gives its model, in the object's parameters:
`{"look": 2, "pack": "official"}`. Without that the object is built in. What an asset is called,
where it lies and which frames it has stays the same, so that tasks, goals and plans know of no
pack; shapes, size, weight, grasps and where the frames are come from the pack.

Other packages add packs by an entry point (`robospa.registry.PACKS`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from robospa.registry import PACKS, find

if TYPE_CHECKING:
    import numpy as np

    from robospa.tasks.modes.clutter import ClutterKind
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

        PackError if it cannot be made.
        """

    def digest(self) -> str:
        """Hash of the files that models are made of, for manifests; empty without files."""


class Builtin:
    """The pack that needs no files: the assets of `robospa.tasks.objects`."""

    name = "builtin"

    def has(self, asset: str, params: Params) -> bool:
        """Whether there is such an asset."""
        from robospa.tasks.objects import assets

        return asset in assets()

    def model(self, asset: str, params: Params) -> ObjectModel:
        """As `robospa.tasks.objects.object_model` without a pack."""
        from robospa.tasks.objects import object_model

        return object_model(asset, params)

    def digest(self) -> str:
        """Empty: there are no files."""
        return ""


@runtime_checkable
class PackWithClutter(Pack, Protocol):
    """A pack that has things of its own to lie about in randomised scenes."""

    def clutter(self, scene: Scene) -> Sequence[ClutterKind]:
        """Kinds of things, the library's and its own, that may lie about in `scene`; none if the
        library's are all. Nothing that the scene's sentences may mean."""


@runtime_checkable
class PackWithFaults(Pack, Protocol):
    """A pack that can say, before anything is made, what of its files cannot be used."""

    def faults(self, tasks: Collection[str]) -> Mapping[str, str]:
        """For each of `tasks` that cannot run with the files a sentence that says why."""


@cache
def pack(name: str) -> Pack:
    """The pack called `name`, opened once in a process.

    Raises:
        UnknownName: There is none; the message says which there are.
        ValueError: It cannot be opened.
    """
    opened: Pack = find(PACKS, name, "asset pack")()
    return opened


def without_pack(params: Params) -> Params:
    """`params` of the built-in model."""
    return {key: value for key, value in params.items() if key != "pack"}


def with_pack(scene: Scene, name: str) -> Scene:
    """`scene` with the objects and the clutter of the pack called `name`, where it has them."""
    chosen = pack(name)

    def packed(item: SceneObject) -> SceneObject:
        params = without_pack(item.params)
        if name != Builtin.name and chosen.has(item.asset, params):
            params = {**params, "pack": name}
        return replace(item, params=params)

    return replace(
        scene, objects=tuple(map(packed, scene.objects)), clutter=tuple(map(packed, scene.clutter))
    )


def with_clutter(scene: Scene, name: str, rng: Callable[[], np.random.Generator]) -> Scene:
    """`scene` with other clutter, drawn by `rng` from the kinds of the pack called `name`; as it is
    if its mode draws none, or the pack has none."""
    from robospa.tasks.modes.clutter import clutter

    most, chosen = int(scene.strengths.get("clutter", 0)), pack(name)
    kinds = chosen.clutter(scene) if most and isinstance(chosen, PackWithClutter) else ()
    return replace(scene, clutter=clutter(scene, rng(), most, kinds)) if kinds else scene
