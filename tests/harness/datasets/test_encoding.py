"""Pictures as they are kept: all frames, in their order, the same bytes every time."""

from __future__ import annotations

import io
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.harness.datasets import pictures as coding
from robospa.harness.datasets.episode import EpisodeFilm, Stills
from robospa.harness.datasets.pictures import CODECS, FPS, CodecMissing, encode, require
from robospa.observation import CameraSpec

CAMERAS = (CameraSpec("head", 64, 48), CameraSpec("front", 32, 32))
FRAMES = 7


def pictures() -> list[list[NDArray[np.uint8]]]:
    """The head's frames get redder, the front camera's bluer."""
    return [
        [np.full((c.height, c.width, 3), [30 * t * (i == 0), 40, 30 * t * i], np.uint8)
         for i, c in enumerate(CAMERAS)]
        for t in range(FRAMES)
    ]  # fmt: skip


@pytest.mark.parametrize("codec", CODECS)
def test_every_frame_is_there_in_its_colours(codec: str) -> None:
    made = encode(pictures(), CAMERAS, codec)
    assert made == encode(pictures(), CAMERAS, codec)
    assert list(made) == ["head", "front"]
    for i, camera in enumerate(CAMERAS):
        seen = made[camera.name]
        assert (seen.codec, seen.width, seen.height) == (codec, camera.width, camera.height)
        frames = decoded(seen)
        assert len(frames) == FRAMES
        for t, frame in enumerate(frames):
            assert frame.shape == (camera.height, camera.width, 3)
            wanted = [30 * t * (i == 0), 40, 30 * t * i]
            assert np.abs(frame.mean(axis=(0, 1)) - wanted).max() < 12, (codec, t)


def decoded(seen: EpisodeFilm | Stills) -> list[NDArray[np.uint8]]:
    if isinstance(seen, Stills):
        from PIL import Image

        return [np.asarray(Image.open(io.BytesIO(data))) for data in seen.frames]
    import av

    with av.open(io.BytesIO(seen.data)) as file:
        frames = list(file.decode(video=0))
        assert [round(frame.time * FPS, 6) for frame in frames] == list(range(FRAMES))
        keys = [t for t, frame in enumerate(frames) if frame.key_frame]
    assert all(b - a <= 2 for a, b in pairwise([*keys, FRAMES]))
    return [frame.to_ndarray(format="rgb24") for frame in frames]


def test_an_encoder_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = coding._Encoder("libnone", {})
    monkeypatch.setattr(coding, "ENCODERS", {**coding.ENCODERS, "av1": missing})
    with pytest.raises(CodecMissing, match="no encoder libnone here: choose h264 or png or jpeg"):
        require("av1")
