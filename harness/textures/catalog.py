"""All kinds of textures, and which colours and styles of each belong to which split.

A kind has a few sets of colours and a few styles. One in seven of their combinations belongs to the
unseen textures, the others to the seen ones: the same kinds of material in both, no combination in
two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from robospa.harness.textures import cloth, plain, prints, stone, tiles, wood
from robospa.harness.textures.field import Draw, Picture
from robospa.tasks.scene import UNSEEN

Colors = tuple[str, ...]
Maker = Callable[[Draw, Colors, int], Picture]


@dataclass(frozen=True)
class Kind:
    """A kind of material: what makes it, from which colours (`rrggbb`), in how many styles."""

    make: Maker
    colors: tuple[Colors, ...]
    styles: int
    share: int = 2
    """How often it comes, in relation to the others."""


KINDS = (
    Kind(wood.veneer, wood.WOODS, 4, 4),
    Kind(wood.boards, wood.WOODS, 4, 4),
    Kind(wood.parquet, wood.WOODS, 2),
    Kind(wood.slats, wood.WOODS, 2, 1),
    Kind(stone.marble, stone.MARBLES, 2, 3),
    Kind(stone.granite, stone.GRANITES, 2),
    Kind(stone.terrazzo, stone.CHIPS, 2, 3),
    Kind(stone.concrete, stone.EARTHS, 2),
    Kind(stone.layered, stone.EARTHS, 2),
    Kind(stone.gravel, stone.EARTHS, 2),
    Kind(cloth.weave, cloth.CLOTHS, 2, 3),
    Kind(cloth.twill, cloth.CLOTHS, 2),
    Kind(cloth.tartan, cloth.TARTANS, 2),
    Kind(cloth.gingham, cloth.CLOTHS, 2),
    Kind(cloth.knit, cloth.CLOTHS, 2, 1),
    Kind(cloth.felt, cloth.CLOTHS, 2, 1),
    Kind(tiles.square, tiles.GLAZES, 4),
    Kind(tiles.chequer, tiles.GLAZES, 2),
    Kind(tiles.brick, tiles.BRICKS, 2, 3),
    Kind(tiles.hexagons, tiles.GLAZES, 2),
    Kind(tiles.mosaic, tiles.GLAZES, 2),
    Kind(prints.stripes, prints.INKS, 3),
    Kind(prints.dots, prints.INKS, 4),
    Kind(prints.zigzag, prints.INKS, 4),
    Kind(prints.lozenges, prints.INKS, 2, 1),
    Kind(prints.flowers, prints.INKS, 2),
    Kind(prints.leaves, prints.INKS, 2),
    Kind(prints.shapes, prints.INKS, 3),
    Kind(prints.scales, prints.INKS, 2, 1),
    Kind(plain.paper, plain.PAPERS, 3),
    Kind(plain.plaster, plain.PAINTS, 2, 3),
    Kind(plain.worn, plain.PAINTS, 2),
    Kind(plain.leather, plain.HIDES, 2),
    Kind(plain.cork, plain.HIDES, 2, 1),
    Kind(plain.brushed, plain.METALS, 2, 1),
    Kind(plain.ground, plain.GREENS, 2, 1),
)

_LOTS = tuple(kind for kind in KINDS for _ in range(kind.share))
UNSEEN_EVERY, UNSEEN_AT = 7, 4


@cache
def combinations(kind: Kind, split: str) -> tuple[tuple[Colors, int], ...]:
    """The colours and styles of `kind` that belong to `split`."""
    every = [(colors, style) for style in range(kind.styles) for colors in kind.colors]
    return tuple(
        pair
        for number, pair in enumerate(every)
        if (number % UNSEEN_EVERY == UNSEEN_AT) == (split == UNSEEN)
    )


def chosen(draw: Draw, split: str) -> tuple[Kind, Colors, int]:
    """A kind, its colours and its style."""
    kind = draw.pick(_LOTS)
    return (kind, *draw.pick(combinations(kind, split)))
