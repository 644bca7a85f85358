"""Textures of randomised scenes: images as pure functions of a split and a number.

10,000 seen and 1,000 unseen ones, made when they are asked for: nothing is downloaded or stored.
With $ROBOSPA_TEXTURES they are the files of a folder (`robospa.harness.textures.folder`).
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robospa.harness.textures.catalog import chosen
from robospa.harness.textures.field import SIZE, Draw, Picture
from robospa.harness.textures.folder import TextureFolder
from robospa.tasks.scene import SEEN, Texture

VARIABLE = "ROBOSPA_TEXTURES"
"""Environment variable that names a folder of the user's own textures."""
VERSION = 1
"""Another number means other images for the same textures."""


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
