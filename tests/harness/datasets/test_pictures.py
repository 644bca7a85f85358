"""Pictures as they are kept: all frames, in their order, the same bytes every time, and joined."""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_datasets import film_of, painted

from robospa.harness.datasets.episode import EpisodeFilm, Stills
from robospa.harness.datasets.lerobot import FilmFiles
from robospa.harness.datasets.pictures import (
    CODECS,
    FPS,
    EpisodeFilmError,
    JoinedFilm,
    check_film,
    encode,
    film_frames,
)
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


LENGTHS = (5, 1, 8)


def joined(path: Path, films: list[bytes]) -> bytes:
    film = JoinedFilm(path)
    for data, frames in zip(films, LENGTHS, strict=True):
        film.append(data, frames)
    film.close()
    return path.read_bytes()


def test_a_joined_film_shows_every_frame_at_its_time(tmp_path: Path) -> None:
    films = [film_of(painted(seed, frames)) for seed, frames in enumerate(LENGTHS)]
    data = joined(tmp_path / "a.mp4", films)
    own = [frame for film in films for frame in film_frames(film)]
    found = list(film_frames(data))
    assert len(found) == sum(LENGTHS)
    assert all((a == b).all() for a, b in zip(own, found, strict=True))
    with av.open(io.BytesIO(data)) as film:
        times = [frame.time for frame in film.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(sum(LENGTHS)) / FPS, atol=1e-9)
    assert data == joined(tmp_path / "b.mp4", films)  # the same bytes again


def test_films_of_other_encoders_or_lengths_are_refused(tmp_path: Path) -> None:
    film = JoinedFilm(tmp_path / "film.mp4")
    film.append(film_of(painted(0, 4)), 4)
    with pytest.raises(EpisodeFilmError, match="other settings"):
        film.append(film_of(painted(0, 4)[:, :32]), 4)
    with pytest.raises(EpisodeFilmError, match="4 frames, and the episode 5"):
        check_film(film_of(painted(0, 4)), 5)
    film.close()


def test_sampled_frames_are_some_of_all() -> None:
    data = film_of(painted(0, 30))
    frames = list(film_frames(data))
    some = list(film_frames(data, 4))
    places = [next(t for t, f in enumerate(frames) if (f == s).all()) for s in some]
    assert len(some) == 4 and places == sorted(places) and places[0] == 0 and places[-1] >= 27


def test_film_files_go_on_in_a_next_file(tmp_path: Path) -> None:
    data = film_of(painted(0, 5))
    files = FilmFiles(tmp_path, limit=2.2 * len(data) / 1024**2)
    places = [files.add(data, 5) for _ in range(3)]
    files.close()
    assert [place for place, _ in places] == [(0, 0), (0, 0), (0, 1)]
    assert [round(start * FPS) for _, start in places] == [0, 5, 0]
    assert len(list(film_frames((tmp_path / "chunk-000/file-001.mp4").read_bytes()))) == 5


def test_times_in_long_films_are_found_within_what_lerobot_tolerates() -> None:
    """It compares times as float32 within 1e-4 s; far into a film those are further apart than
    that, but at 17 frames a second both ways to a time are rounded to the same one."""
    inside = np.arange(2000)
    stored = (inside / FPS).astype(np.float32).astype(float)
    for start in range(0, 300_000, 1999):
        asked, shown = start / FPS + stored, (start + inside) / FPS
        apart = np.abs(asked.astype(np.float32) - shown.astype(np.float32))
        assert apart.max() < 1e-4
