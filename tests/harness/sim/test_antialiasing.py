"""What becomes of a picture that was taken: its parts, sky and smoothed edges. Needs no device."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.harness.sim.antialiasing import CONTRAST, Smoother
from robospa.harness.sim.cameras import pixels

Bytes = NDArray[np.uint8]
FINER = 16


def half_plane(degrees: float, size: int = 48, finer: int = 1) -> Bytes:
    """A dark side and a bright one of a line through the picture, (size, size, 4)."""
    at = (np.arange(size * finer) + 0.5) / finer - size / 2 - 0.2
    way = math.radians(degrees)
    bright = at * math.sin(way) + at[:, None] * math.cos(way) > 0
    levels = np.where(bright[..., None], [200, 180, 220, 255], [40, 60, 20, 255])
    fine = levels.reshape(size, finer, size, finer, 4)
    return fine.mean(axis=(1, 3)).round().astype(np.uint8)


def error(picture: Bytes, truth: Bytes) -> float:
    """Of the middle, root of the mean square."""
    inner = (slice(8, -8), slice(8, -8))
    return float(np.sqrt(np.square(picture[inner].astype(float) - truth[inner]).mean()))


def smoothed(picture: Bytes, count: int = 1) -> Bytes:
    return Smoother(*picture.shape[:2], count)(picture).copy()


@pytest.mark.parametrize("degrees", [3, 10, 20, 30, 40, 50, 70, 85, 100, 120, 160, 175])
def test_slanted_edges_come_near_to_those_of_a_finer_picture(degrees: float) -> None:
    rough, truth = half_plane(degrees), half_plane(degrees, finer=FINER)
    assert error(smoothed(rough), truth) < 0.55 * error(rough, truth)


@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_straight_edges_and_what_is_flat_stay(degrees: float) -> None:
    picture = half_plane(degrees)
    np.testing.assert_array_equal(smoothed(picture), picture)


def test_corners_dots_thin_lines_and_soft_gradients_stay() -> None:
    picture = np.full((40, 40, 4), 50, dtype=np.uint8)
    picture[5:15, 5:20] = 200
    picture[25, 30] = 250
    picture[30, 4:30] = 250
    picture[:, 36:] = 50 + CONTRAST
    np.testing.assert_array_equal(smoothed(picture), picture)


def test_pictures_of_a_row_are_smoothed_as_alone() -> None:
    alone = [half_plane(degrees) for degrees in (20, 110, 45)]
    row = smoothed(np.hstack(alone), 3)
    np.testing.assert_array_equal(row, np.hstack([smoothed(picture) for picture in alone]))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (3, 7)])
def test_pictures_of_any_size_and_colours_are_between_what_was_there(
    shape: tuple[int, int],
) -> None:
    smoother = Smoother(*shape, 1)
    for seed in range(20):
        levels = np.random.default_rng(seed).choice([10, 240], (*shape, 1)).astype(np.uint8)
        after = smoother(np.repeat(levels, 4, axis=2))
        assert after.min() >= 10 and after.max() <= 240


SKY = np.array([101, 112, 103], dtype=np.uint8)


def taken(row: Bytes, count: int) -> list[Bytes]:
    """What becomes of RGBA (height, width, 4) that a camera has taken."""
    camera: Any = SimpleNamespace(get_picture={"Color": row}.__getitem__)
    return pixels(camera, SKY, count)


def random_picture(width: int) -> Bytes:
    return np.random.default_rng(0).integers(100, 120, (6, width, 4), dtype=np.uint8)


def test_a_row_is_cut_into_its_pictures() -> None:
    row = random_picture(12)
    for image, part in zip(taken(row, 3), np.split(row, 3, axis=1), strict=True):
        assert image.flags.c_contiguous and image.flags.owndata
        np.testing.assert_array_equal(image, part[..., :3])


def test_the_sky_is_where_nothing_was_drawn_and_nowhere_else() -> None:
    row = random_picture(8)
    row[2, 1] = row[4, 7] = 0
    drawn = row[..., :3].copy()
    left, right = taken(row, 2)
    assert left[2, 1].tolist() == right[4, 3].tolist() == SKY.tolist()
    assert (np.hstack([left, right]) != drawn).any(axis=2).sum() == 2
