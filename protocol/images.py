"""JPEG as a declared image codec: the client encodes, the server decodes. Raw needs none of this.

Only for servers whose spec says `image_codec: jpeg`. Pillow is imported on first use. An encoded
image travels as binary data in the place of the array.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.protocol.codec import DEFAULT_LIMITS, Limits
from robospa.protocol.errors import DecodeError, EncodeError

QUALITY = 90


def encode_jpeg(image: NDArray[np.uint8]) -> bytes:
    """uint8 (H, W, 3) RGB to JPEG, quality 90, 4:2:0. Raises EncodeError."""
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise EncodeError(f"{image.dtype} array of shape {image.shape} cannot become a JPEG")
    stream = io.BytesIO()
    _pillow().fromarray(np.ascontiguousarray(image)).save(stream, "JPEG", quality=QUALITY)
    return stream.getvalue()


def decode_jpeg(data: bytes, limits: Limits = DEFAULT_LIMITS) -> NDArray[np.uint8]:
    """JPEG to uint8 (H, W, 3) RGB; the size is checked before a pixel is decoded."""
    try:
        with _pillow().open(io.BytesIO(data), formats=("JPEG",)) as picture:
            if picture.width * picture.height * 3 > limits.array:
                raise DecodeError(f"JPEG of {picture.width} x {picture.height} is over the limit")
            return np.asarray(picture.convert("RGB"))
    except DecodeError:
        raise
    except Exception as error:  # Pillow raises many kinds for broken files
        raise DecodeError(f"an image is no JPEG: {error}") from error


def encode_images(observation: Mapping[str, Any]) -> dict[str, Any]:
    """The observation with every image as JPEG; nothing else is touched."""
    return _map_images(
        observation, lambda image: encode_jpeg(image) if isinstance(image, np.ndarray) else image
    )


def decode_images(
    observation: Mapping[str, Any], limits: Limits = DEFAULT_LIMITS
) -> dict[str, Any]:
    """The observation with every JPEG as an array."""
    return _map_images(
        observation, lambda image: decode_jpeg(image, limits) if isinstance(image, bytes) else image
    )


def _map_images(view: Mapping[str, Any], change: Callable[[Any], Any]) -> dict[str, Any]:
    changed = dict(view)
    if isinstance(changed.get("images"), dict):
        changed["images"] = {name: change(image) for name, image in changed["images"].items()}
    if isinstance(changed.get("history"), dict):
        changed["history"] = {
            offset: _map_images(past, change) if isinstance(past, dict) else past
            for offset, past in changed["history"].items()
        }
    return changed


def _pillow() -> Any:
    try:
        from PIL import Image
    except ImportError as error:
        raise EncodeError(
            "images as JPEG need Pillow, which is not installed: pip install pillow"
        ) from error
    return Image
