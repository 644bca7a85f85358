"""Animated pictures of the documentation: what is shown, how long, and how large files get."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from robospa.harness.pictures.films import (
    DARK,
    EVERY,
    MOST_BYTES,
    SIZE,
    STRIP,
    Animation,
    captioned,
    encode,
)

Image = pytest.importorskip("PIL.Image")
ROOT = Path(__file__).resolve().parents[3]
FILM = ROOT / "docs" / "images" / "trials.webp"


def test_some_frames_are_kept_with_the_sentence_below() -> None:
    film = Animation(partial(captioned, sentence="Take the red block " * 5), EVERY)
    for level in range(4):
        film.add(np.full((720, 960, 3), 60 * level, np.uint8))
    assert len(film.frames) == 4 // EVERY
    pixels = np.asarray(film.frames[-1])
    assert pixels.shape == (SIZE[1] + STRIP, SIZE[0], 3)
    assert (pixels[: SIZE[1]] == 60 * EVERY).all()
    strip = pixels[SIZE[1] :]
    assert (strip[:, :8] == DARK).all() and strip.max() > 200, "the sentence fits"


def test_frames_follow_each_other_at_ten_a_second_in_the_quality_that_fits() -> None:
    rng = np.random.default_rng(1)
    frames = [Image.fromarray(rng.integers(0, 256, (72, 96, 3), np.uint8)) for _ in range(3)]
    best = encode(frames, 10**9)
    film = Image.open(io.BytesIO(best))
    assert (film.n_frames, film.size, film.format) == (3, (96, 72), "WEBP")
    film.seek(1)
    film.load()
    assert film.info["duration"] == 100 and film.info["loop"] == 0
    assert len(encode(frames, len(best) - 1)) < len(best)


def test_the_first_page_shows_it_and_it_is_small() -> None:
    assert f"({FILM.relative_to(ROOT)})" in (ROOT / "README.md").read_text()
    assert FILM.stat().st_size <= MOST_BYTES
