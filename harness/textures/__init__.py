"""Textures of randomised scenes: images as pure functions of a split and a number.

10,000 seen and 1,000 unseen ones, made when they are asked for: nothing is downloaded or stored.
With $ROBOSPA_TEXTURES they are the files of a folder.
"""

import hashlib
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.textures import materials, prints
from robospa.harness.textures.field import SIZE, Draw, Picture
from robospa.tasks.packs import PackError
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
    Material(materials.veneer, materials.WOODS, 4, 4),
    Material(materials.boards, materials.WOODS, 4, 4),
    Material(materials.parquet, materials.WOODS, 2),
    Material(materials.slats, materials.WOODS, 2, 1),
    Material(materials.marble, materials.MARBLES, 2, 3),
    Material(materials.granite, materials.GRANITES, 2),
    Material(materials.terrazzo, materials.CHIPS, 2, 3),
    Material(materials.concrete, materials.EARTHS, 2),
    Material(materials.layered, materials.EARTHS, 2),
    Material(materials.gravel, materials.EARTHS, 2),
    Material(materials.weave, materials.CLOTHS, 2, 3),
    Material(materials.twill, materials.CLOTHS, 2),
    Material(materials.tartan, materials.TARTANS, 2),
    Material(materials.gingham, materials.CLOTHS, 2),
    Material(materials.knit, materials.CLOTHS, 2, 1),
    Material(materials.felt, materials.CLOTHS, 2, 1),
    Material(materials.square, materials.GLAZES, 4),
    Material(materials.chequer, materials.GLAZES, 2),
    Material(materials.brick, materials.BRICKS, 2, 3),
    Material(materials.hexagons, materials.GLAZES, 2),
    Material(materials.mosaic, materials.GLAZES, 2),
    Material(prints.stripes, prints.INKS, 3),
    Material(prints.dots, prints.INKS, 4),
    Material(prints.zigzag, prints.INKS, 4),
    Material(prints.lozenges, prints.INKS, 2, 1),
    Material(prints.flowers, prints.INKS, 2),
    Material(prints.leaves, prints.INKS, 2),
    Material(prints.shapes, prints.INKS, 3),
    Material(prints.scales, prints.INKS, 2, 1),
    Material(prints.paper, prints.PAPERS, 3),
    Material(prints.plaster, prints.PAINTS, 2, 3),
    Material(prints.worn, prints.PAINTS, 2),
    Material(prints.leather, prints.HIDES, 2),
    Material(prints.cork, prints.HIDES, 2, 1),
    Material(prints.brushed, prints.METALS, 2, 1),
    Material(prints.ground, prints.GREENS, 2, 1),
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
        return {"made": VERSION}


def _tinged(draw: Draw, picture: Picture) -> Picture:
    """A little darker or lighter, warmer or colder: no two textures have quite the same colours."""
    tone = draw.number(0.82, 1.06)
    tinge = np.array([tone * draw.number(0.93, 1.07) for _ in range(3)], np.float32)
    result: Picture = picture * tinge
    return result


ENDINGS = (".png", ".jpg", ".jpeg", ".webp")
LARGEST = 8192
"""Pixels along a side of a file."""


class TextureFolder:
    """A user's own textures: folders `seen` and `unseen` of images that are called by their
    numbers, as the official ones are: `unseen/0.png`, `unseen/1.png`, ... Texture k of a split is
    the k-th in the order of numbers; where there are fewer files than textures, they come round
    again. PackError, in one sentence, if `path` is no such folder."""

    def __init__(self, path: Path) -> None:
        if not path.is_dir():
            raise PackError(
                f"there is no folder of textures {str(path)!r}; make it or unset ROBOSPA_TEXTURES"
            )
        self._path = path
        self._files = {split: _numbered(path / split) for split in (SEEN, UNSEEN)}
        if not any(self._files.values()):
            raise PackError(
                f"the folder of textures {str(path)!r} has no image such as seen/0.png or "
                "unseen/0.png"
            )
        self.image = lru_cache(maxsize=64)(self._read)

    def _read(self, texture: Texture) -> NDArray[np.uint8]:
        from PIL import Image, UnidentifiedImageError

        files = self._files[texture.split]
        if not files:
            raise PackError(
                f"the folder of textures {str(self._path)!r} has no {texture.split} images, which "
                f"this scene mode needs; add {texture.split}/0.png, 1.png, ..."
            )
        file = files[texture.index % len(files)]
        if not file.is_file():  # such as a pipe, which nobody may ever write to
            raise PackError(f"the texture {str(file)!r} cannot be read: it is no file")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Image.DecompressionBombWarning)
                with Image.open(file) as opened:
                    if max(opened.size) > LARGEST:
                        raise PackError(
                            f"the texture {str(file)!r} has {opened.width}x{opened.height} pixels, "
                            f"more than {LARGEST} along a side"
                        )
                    picture = opened.convert("RGB").resize((SIZE, SIZE), Image.Resampling.BOX)
        except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
            raise PackError(f"the texture {str(file)!r} cannot be read: {error}") from error
        return np.asarray(picture, dtype=np.uint8)

    def about(self) -> dict[str, object]:
        """How many images there are, and a hash of their names and sizes."""
        listed = hashlib.sha256()
        for split, files in self._files.items():
            for file in files:
                try:
                    size = file.stat().st_size
                except OSError as error:
                    raise PackError(f"the texture {str(file)!r} cannot be read: {error}") from error
                listed.update(f"{split}/{file.name} {size}\n".encode())
        counts = {split: len(files) for split, files in self._files.items()}
        return {"folder": self._path.name, **counts, "hash": listed.hexdigest()[:16]}


def _numbered(folder: Path) -> list[Path]:
    """The images of a split in the order of their numbers; what macOS writes beside a file when it
    copies it, such as ._0.png, is none."""
    if not folder.is_dir():
        return []
    images = (file for file in folder.iterdir() if file.suffix.lower() in ENDINGS)
    files = [file for file in images if not file.name.startswith("._")]
    for file in files:
        if not (file.stem.isascii() and file.stem.isdigit()):
            raise PackError(
                f"the texture {str(file)!r} must be called by a number, such as 0{file.suffix}"
            )
    return sorted(files, key=lambda file: (int(file.stem), file.name))


Source = MadeTextures | TextureFolder
"""Where images of textures come from."""


def source() -> Source:
    """The user's folder if one is named, else the textures of this package. ValueError, in one
    sentence, for a folder that is not as it should be."""
    named = os.environ.get(VARIABLE)
    return TextureFolder(Path(named)) if named else MadeTextures()
