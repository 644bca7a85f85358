"""Images as the official clients prepare them before a model sees them.

Uses OpenCV, as they do, where it is installed, and Pillow elsewhere; the two differ by a grey level
here and there.
"""

from __future__ import annotations

import importlib
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.clients.model_policy import ModelMissing

Image = NDArray[np.uint8]
JPEG_QUALITY = 95
"""OpenCV's default."""


def resize(image: Image, width: int, height: int) -> Image:
    """uint8 (H, W, 3) to (height, width, 3), bilinear, aspect not kept."""
    if image.shape[:2] == (height, width):
        return image
    cv2 = _module("cv2")
    if cv2 is not None:
        return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR))
    pillow = pillow_image()
    resized = pillow.fromarray(image).resize((width, height), pillow.Resampling.BILINEAR)
    return np.asarray(resized)


def jpeg_round_trip(image: Image) -> Image:
    """What JPEG leaves of uint8 (H, W, 3) RGB, coded as if it were BGR: so official code does it,
    and the chroma that is lost is therefore another than usual."""
    cv2 = _module("cv2")
    if cv2 is not None:
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(image))
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    stream = io.BytesIO()
    pillow = pillow_image()
    swapped = np.ascontiguousarray(image[..., ::-1])
    pillow.fromarray(swapped).save(stream, "JPEG", quality=JPEG_QUALITY)
    with pillow.open(stream, formats=("JPEG",)) as picture:
        return np.ascontiguousarray(np.asarray(picture.convert("RGB"))[..., ::-1])


def pillow_image() -> Any:
    """Pillow's Image module; raises ModelMissing."""
    found = _module("PIL.Image")
    if found is None:
        raise ModelMissing("images need Pillow, which is not installed: pip install pillow")
    return found


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
