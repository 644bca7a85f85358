"""Textures as pure functions, and those of a user's folder."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robospa.harness import textures
from robospa.harness.textures import KINDS, MadeTextures, TextureFolder, combinations, source
from robospa.harness.textures.field import SIZE, Draw, Field, cell, noise, wave
from robospa.tasks.scene import SEEN, UNSEEN, Texture

DIGESTS = {
    ("seen", 0): "3a2e2a4dd1ac",
    ("seen", 1): "e25df9f1d3f4",
    ("seen", 9999): "2b735840446a",
    ("seen", 137): "c95377e56394",
    ("seen", 4242): "59277b863afd",
    ("unseen", 0): "d490bc4ac41a",
    ("unseen", 7): "da35ec1cada6",
    ("unseen", 999): "3d696fd5362a",
    ("unseen", 55): "c3726a33728f",
}
"""The beginning of the SHA-256 of some images: another value means another machine's arithmetic,
or a change of the textures, which needs another VERSION."""


def test_images_are_the_same_on_every_machine() -> None:
    found = {
        (split, index): hashlib.sha256(MadeTextures.image(Texture(split, index)).tobytes())
        for split, index in DIGESTS
    }
    assert {key: value.hexdigest()[:12] for key, value in found.items()} == DIGESTS


def test_an_image_is_kept_and_not_to_be_changed() -> None:
    image = MadeTextures.image(Texture(SEEN, 5))
    assert image is MadeTextures.image(Texture(SEEN, 5))
    assert image.shape == (SIZE, SIZE, 3)
    assert image.dtype == np.uint8
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 0


def test_splits_have_the_same_kinds_and_no_combination_in_common() -> None:
    for kind in KINDS:
        seen, unseen = combinations(kind, SEEN), combinations(kind, UNSEEN)
        assert unseen
        assert not set(seen) & set(unseen)
        assert len(seen) + len(unseen) == kind.styles * len(kind.colors)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.make.__name__)
def test_every_kind_paints_a_picture(kind: textures.Material) -> None:
    for style in (0, kind.styles - 1):
        picture = kind.make(Draw(3, style), kind.colors[0], style)
        assert picture.shape == (SIZE, SIZE, 3)
        assert picture.dtype == np.float32  # twice as fast as float64
        assert np.isfinite(picture).all()
        assert float(picture.std()) > 0.004


def test_building_blocks() -> None:
    turns: Field = np.array([-1.0, -0.75, 0.0, 0.25, 0.5, 2.0], np.float32)
    np.testing.assert_allclose(wave(turns), (1.0, 0.0, 1.0, 0.0, -1.0, 1.0), atol=1e-6)
    whole, rest = cell(np.array([2.25, -0.25], np.float32))
    assert (whole.tolist(), rest.tolist()) == ([2, -1], [0.25, 0.75])
    clouds = noise(Draw(1), 5)
    assert 0.0 <= float(clouds.min()) < 0.2
    assert 0.8 < float(clouds.max()) <= 1.0


def folder(path: Path, **numbers: tuple[int, ...]) -> Path:
    """A folder of images whose grey level is their number."""
    for split, some in numbers.items():
        (path / split).mkdir()
        for number in some:
            Image.new("RGB", (40, 30), (number,) * 3).save(path / split / f"{number}.png")
    return path


def test_a_folder_of_own_textures_goes_by_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(textures.VARIABLE, str(folder(tmp_path, unseen=(2, 10, 1))))
    (tmp_path / "unseen" / "._2.png").write_bytes(b"attributes of 2.png")
    own = source()
    levels = [int(own.image(Texture(UNSEEN, index))[0, 0, 0]) for index in range(4)]
    assert levels == [1, 2, 10, 1]
    assert own.image(Texture(UNSEEN, 0)).shape == (SIZE, SIZE, 3)
    about = own.about()
    assert {key: about[key] for key in ("folder", "seen", "unseen")} == {
        "folder": tmp_path.name,
        "seen": 0,
        "unseen": 3,
    }
    with pytest.raises(ValueError, match=r"has no seen images, which this scene mode needs"):
        own.image(Texture(SEEN, 0))
    monkeypatch.delenv(textures.VARIABLE)
    assert source().about() == {"made": textures.VERSION}


def test_a_bad_folder_is_said_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no folder of textures"):
        TextureFolder(tmp_path / "none")
    with pytest.raises(ValueError, match=r"has no image such as seen/0\.png"):
        TextureFolder(tmp_path)
    folder(tmp_path, seen=(0,))
    (tmp_path / "seen" / "1.png").write_bytes(b"no image")
    with pytest.raises(ValueError, match=r"1\.png' cannot be read"):
        TextureFolder(tmp_path).image(Texture(SEEN, 1))
    (tmp_path / "seen" / "oak.png").write_bytes(b"")
    with pytest.raises(ValueError, match=r"oak\.png' must be called by a number, such as 0\.png"):
        TextureFolder(tmp_path)
