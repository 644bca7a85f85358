"""Animated pictures of the documentation: what is shown, how long, and how large files get."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path

import docs_films as made
import numpy as np
import pytest

Image = pytest.importorskip("PIL.Image")


def test_some_frames_are_kept_with_the_sentence_below() -> None:
    film = made.Animation(partial(made.captioned, sentence="Take the red block " * 5), made.EVERY)
    for level in range(4):
        film.add(np.full((720, 960, 3), 60 * level, np.uint8))
    assert len(film.frames) == 4 // made.EVERY
    pixels = np.asarray(film.frames[-1])
    shown, strip = np.split(pixels, [made.SIZE[1]])
    assert strip.shape == (made.STRIP, made.SIZE[0], 3)
    assert (shown == 60 * made.EVERY).all()
    assert (strip[:, :8] == made.DARK).all() and strip.max() > 200, "the sentence fits"


def test_frames_follow_each_other_at_ten_a_second_in_the_quality_that_fits() -> None:
    rng = np.random.default_rng(1)
    frames = [Image.fromarray(rng.integers(0, 256, (72, 96, 3), np.uint8)) for _ in range(3)]
    best = made.encode(frames, 10**9)
    film = Image.open(io.BytesIO(best))
    assert (film.n_frames, film.size, film.format) == (3, (96, 72), "WEBP")
    film.seek(1)
    film.load()
    assert film.info["duration"] == 100 and film.info["loop"] == 0
    assert len(made.encode(frames, len(best) - 1)) < len(best)


def test_the_first_page_shows_it_and_it_is_small() -> None:
    film = Path(__file__).resolve().parents[2] / "docs" / "images" / "trials.webp"
    assert film.stat().st_size <= made.MOST_BYTES
