"""Textures of randomised scenes: images as pure functions of a split and a number.

10,000 seen and 1,000 unseen ones, made when they are asked for: nothing is downloaded or stored.
With $ROBOSPA_TEXTURES they are the files of a folder (`robospa.harness.textures.folder`).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robospa.harness.textures import plain_prints, stone_tiles, wood_cloth
from robospa.harness.textures.field import SIZE, Draw, Picture
from robospa.harness.textures.folder import TextureFolder
from robospa.tasks.scene import SEEN, UNSEEN, Texture

VARIABLE = "ROBOSPA_TEXTURES"
"""Environment variable that names a folder of the user's own textures."""
VERSION = 1
"""Another number means other images for the same textures."""

Colors = tuple[str, ...]
Maker = Callable[[Draw, Colors, int], Picture]


@dataclass(frozen=True)
class Material:
    """A kind of material: what makes it, from which colours (`rrggbb`), in how many styles."""

    make: Maker
    colors: tuple[Colors, ...]
    styles: int
    share: int = 2
    """How often it comes, in relation to the others."""


KINDS = (
    Material(wood_cloth.veneer, wood_cloth.WOODS, 4, 4),
    Material(wood_cloth.boards, wood_cloth.WOODS, 4, 4),
    Material(wood_cloth.parquet, wood_cloth.WOODS, 2),
    Material(wood_cloth.slats, wood_cloth.WOODS, 2, 1),
    Material(stone_tiles.marble, stone_tiles.MARBLES, 2, 3),
    Material(stone_tiles.granite, stone_tiles.GRANITES, 2),
    Material(stone_tiles.terrazzo, stone_tiles.CHIPS, 2, 3),
    Material(stone_tiles.concrete, stone_tiles.EARTHS, 2),
    Material(stone_tiles.layered, stone_tiles.EARTHS, 2),
    Material(stone_tiles.gravel, stone_tiles.EARTHS, 2),
    Material(wood_cloth.weave, wood_cloth.CLOTHS, 2, 3),
    Material(wood_cloth.twill, wood_cloth.CLOTHS, 2),
    Material(wood_cloth.tartan, wood_cloth.TARTANS, 2),
    Material(wood_cloth.gingham, wood_cloth.CLOTHS, 2),
    Material(wood_cloth.knit, wood_cloth.CLOTHS, 2, 1),
    Material(wood_cloth.felt, wood_cloth.CLOTHS, 2, 1),
    Material(stone_tiles.square, stone_tiles.GLAZES, 4),
    Material(stone_tiles.chequer, stone_tiles.GLAZES, 2),
    Material(stone_tiles.brick, stone_tiles.BRICKS, 2, 3),
    Material(stone_tiles.hexagons, stone_tiles.GLAZES, 2),
    Material(stone_tiles.mosaic, stone_tiles.GLAZES, 2),
    Material(plain_prints.stripes, plain_prints.INKS, 3),
    Material(plain_prints.dots, plain_prints.INKS, 4),
    Material(plain_prints.zigzag, plain_prints.INKS, 4),
    Material(plain_prints.lozenges, plain_prints.INKS, 2, 1),
    Material(plain_prints.flowers, plain_prints.INKS, 2),
    Material(plain_prints.leaves, plain_prints.INKS, 2),
    Material(plain_prints.shapes, plain_prints.INKS, 3),
    Material(plain_prints.scales, plain_prints.INKS, 2, 1),
    Material(plain_prints.paper, plain_prints.PAPERS, 3),
    Material(plain_prints.plaster, plain_prints.PAINTS, 2, 3),
    Material(plain_prints.worn, plain_prints.PAINTS, 2),
    Material(plain_prints.leather, plain_prints.HIDES, 2),
    Material(plain_prints.cork, plain_prints.HIDES, 2, 1),
    Material(plain_prints.brushed, plain_prints.METALS, 2, 1),
    Material(plain_prints.ground, plain_prints.GREENS, 2, 1),
)

_LOTS = tuple(kind for kind in KINDS for _ in range(kind.share))
UNSEEN_EVERY, UNSEEN_AT = 7, 4
"""One in seven combinations of a material's colours and styles belongs to the unseen textures, the
others to the seen ones: the same materials in both, no combination in two."""


@cache
def combinations(kind: Material, split: str) -> tuple[tuple[Colors, int], ...]:
    """The colours and styles of `kind` that belong to `split`."""
    every = [(colors, style) for style in range(kind.styles) for colors in kind.colors]
    return tuple(
        pair
        for number, pair in enumerate(every)
        if (number % UNSEEN_EVERY == UNSEEN_AT) == (split == UNSEEN)
    )


def chosen(draw: Draw, split: str) -> tuple[Material, Colors, int]:
    """A kind, its colours and its style."""
    kind = draw.pick(_LOTS)
    return (kind, *draw.pick(combinations(kind, split)))


class Source(Protocol):
    """Where images of textures come from."""

    def image(self, texture: Texture, /) -> NDArray[np.uint8]:
        """SRGB, uint8 (SIZE, SIZE, 3), not to be written to; ValueError if it cannot be had."""
        ...

    def about(self) -> dict[str, object]:
        """What a manifest says of it."""
        ...


class MadeTextures:
    """The textures of this package: the same images on every machine."""

    @staticmethod
    @lru_cache(maxsize=64)
    def image(texture: Texture, /) -> NDArray[np.uint8]:
        """SRGB, uint8 (SIZE, SIZE, 3), not to be written to."""
        draw = Draw(VERSION, 0 if texture.split == SEEN else 1, texture.index)
        kind, colors, style = chosen(draw, texture.split)
        picture = _tinged(draw, kind.make(draw, colors, style))
        levels = (np.clip(picture, 0, 1) * np.float32(255) + np.float32(0.5)).astype(np.uint8)
        assert levels.shape == (SIZE, SIZE, 3)
        levels.flags.writeable = False
        return levels

    def about(self) -> dict[str, object]:
        """Their version."""
        return {"made": VERSION}


def _tinged(draw: Draw, picture: Picture) -> Picture:
    """A little darker or lighter, warmer or colder: no two textures have quite the same colours."""
    tone = draw.number(0.82, 1.06)
    tinge = np.array([tone * draw.number(0.93, 1.07) for _ in range(3)], np.float32)
    result: Picture = picture * tinge
    return result


def source() -> Source:
    """The user's folder if one is named, else the textures of this package.

    ValueError, in one sentence, for a folder that is not as it should be.
    """
    named = os.environ.get(VARIABLE)
    return TextureFolder(Path(named)) if named else MadeTextures()
