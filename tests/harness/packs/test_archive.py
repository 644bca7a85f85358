"""Where the user's official assets are, which files belong to a model, and the cache of them."""

import os
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from robospa.harness.packs import archive as cache
from robospa.harness.packs.archive import Archive, ArchiveError, note, open_archive
from robospa.tasks.official import OfficialModel

CAN = OfficialModel("071_can", "3")


@pytest.fixture(autouse=True)
def nothing_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("ROBOSPA_ASSETS", raising=False)


def archive_with(root: Path, *files: str) -> Archive:
    for file in files:
        path = root / "objects" / "071_can" / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return open_archive(root)


def test_what_is_no_folder_of_assets_says_why(tmp_path: Path) -> None:
    (tmp_path / "objects.zip").touch()
    (tmp_path / "other").mkdir()
    for folder, keyword in (
        (None, "robospa official assets DIR --add"),
        (tmp_path / "objects.zip", "is a file"),
        (tmp_path / "other", "holds none of"),
        (tmp_path / "none", "does not exist"),
    ):
        with pytest.raises(ArchiveError, match=keyword):
            open_archive(folder)


def test_what_is_closed_to_us_is_said_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    archive = archive_with(tmp_path, "model_data3.json")
    with pytest.raises(ArchiveError, match=r"base3\.glb' is missing"):
        archive.files(CAN)
    monkeypatch.setattr(Path, "is_dir", closed)
    with pytest.raises(ArchiveError, match="Permission denied"):
        open_archive(tmp_path)
    monkeypatch.setattr(Path, "is_file", closed)
    with pytest.raises(ArchiveError, match=r"base3\.glb': Permission denied"):
        archive.files(CAN)


def test_a_folder_is_named_noted_or_in_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("noted", "named", "environment"):
        (tmp_path / name / "objects").mkdir(parents=True)
    note(open_archive(tmp_path / "noted"))
    assert open_archive().root == tmp_path / "noted"
    monkeypatch.setenv("ROBOSPA_ASSETS", str(tmp_path / "environment"))
    assert open_archive().root == tmp_path / "environment"
    assert open_archive(tmp_path / "named").root == tmp_path / "named"


@pytest.mark.parametrize(
    ("there", "visual", "collision"),
    [
        (["visual/base3.glb", "collision/base3.glb"], "visual/base3.glb", "collision/base3.glb"),
        (["visual/base3.glb"], "visual/base3.glb", "visual/base3.glb"),
        (["base3.glb", "textured3.obj"], "base3.glb", "base3.glb"),
        (["textured3.obj"], "textured3.obj", "textured3.obj"),
    ],
)
def test_meshes_are_looked_for_as_officially(
    tmp_path: Path, there: list[str], visual: str, collision: str
) -> None:
    files = archive_with(tmp_path, "model_data3.json", *there).files(CAN)
    folder = tmp_path / "objects" / "071_can"
    assert (files.visual, files.collision) == (folder / visual, folder / collision)


def test_nothing_outside_the_parts_is_read(tmp_path: Path) -> None:
    archive = archive_with(tmp_path / "archive", "visual/base3.glb", "model_data3.json")
    secret = tmp_path / "secret.glb"
    secret.touch()
    link = archive.root / "objects" / "071_can" / "collision" / "base3.glb"
    link.parent.mkdir()
    link.symlink_to(secret)
    with pytest.raises(ArchiveError, match="leads out of the assets' folder and is not read"):
        archive.files(CAN)
    with pytest.raises(ArchiveError, match="leads out"):
        archive.inside(archive.root / "objects" / ".." / ".." / "secret.glb")


def test_a_part_may_lie_on_another_disk(tmp_path: Path) -> None:
    elsewhere = tmp_path / "disk" / "objects" / "071_can"
    elsewhere.mkdir(parents=True)
    (elsewhere / "model_data3.json").touch()
    (elsewhere / "base3.glb").touch()
    (tmp_path / "archive").mkdir()
    (tmp_path / "archive" / "objects").symlink_to(elsewhere.parent)
    assert open_archive(tmp_path / "archive").files(CAN).visual == elsewhere / "base3.glb"


def maker() -> Mock:
    """Makes arrays that say how often they were made."""
    return Mock(side_effect=[{"a": np.full(3, n), "b": np.zeros(2)} for n in range(1, 5)])


def test_equal_content_is_made_once_wherever_it_lies(tmp_path: Path) -> None:
    make, files = maker(), [tmp_path / name for name in "ab"]
    for file in files:
        file.write_bytes(b"mesh")
    first, second = (cache.cached((file,), "how", make) for file in files)
    assert first == second and make.call_count == 1
    assert cache.load_arrays(first)["a"].tolist() == [1, 1, 1]
    assert [*cache.load_arrays(first, "b")] == ["b"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "cache"]


def test_other_content_or_another_way_is_made_anew(tmp_path: Path) -> None:
    make, file = maker(), tmp_path / "a"
    file.write_bytes(b"mesh")
    entries = {cache.cached((file,), "how", make), cache.cached((file,), "else", make)}
    file.write_bytes(b"mess")
    os.utime(file, ns=(0, 0))
    entries.add(cache.cached((file,), "how", make))
    assert len(entries) == make.call_count == 3


def test_a_damaged_entry_is_thrown_away(tmp_path: Path) -> None:
    make, file = maker(), tmp_path / "a"
    file.write_bytes(b"mesh")
    entry = cache.cached((file,), "how", make)
    entry.write_bytes(entry.read_bytes()[:50])
    with pytest.raises(ValueError, match="was damaged: start again"):
        cache.load_arrays(entry)
    assert cache.load_arrays(cache.cached((file,), "how", make))["a"].tolist() == [2, 2, 2]
