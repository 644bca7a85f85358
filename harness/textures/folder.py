"""A user's own textures: image files in a folder instead of those that are made.

The folder has a folder for each split, `seen` and `unseen`, with images that are called by their
numbers, as the official ones are: `unseen/0.png`, `unseen/1.png`, ... Texture k of a split is the
k-th file in the order of numbers; where there are fewer files than textures, they come round again.
"""

from __future__ import annotations

import hashlib
import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.textures.field import SIZE
from robospa.tasks.packs import PackError
from robospa.tasks.scene import TEXTURES, Texture

ENDINGS = (".png", ".jpg", ".jpeg", ".webp")
LARGEST = 8192
"""Pixels along a side of a file."""


class TextureFolder:
    """The images under `path`. PackError, in one sentence, if they are not as described above."""

    def __init__(self, path: Path) -> None:
        if not path.is_dir():
            raise PackError(
                f"there is no folder of textures {str(path)!r}; make it or unset ROBOSPA_TEXTURES"
            )
        self._path = path
        self._files = {split: _numbered(path / split) for split in TEXTURES}
        if not any(self._files.values()):
            raise PackError(
                f"the folder of textures {str(path)!r} has no image such as seen/0.png or "
                "unseen/0.png"
            )
        self.image = lru_cache(maxsize=64)(self._read)

    def _read(self, texture: Texture) -> NDArray[np.uint8]:
        """sRGB, uint8 (SIZE, SIZE, 3)."""
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
    """The images of a split in the order of their numbers."""
    if not folder.is_dir():
        return []
    files = [file for file in folder.iterdir() if file.suffix.lower() in ENDINGS]
    for file in files:
        if not (file.stem.isascii() and file.stem.isdigit()):
            raise PackError(
                f"the texture {str(file)!r} must be called by a number, such as 0{file.suffix}"
            )
    return sorted(files, key=lambda file: (int(file.stem), file.name))
