"""`robospa official assets`: what a folder of official assets holds."""

import json
from pathlib import Path

import pytest
from command_line import robospa
from made_archive import READS_MESHES, make_archive

ASSETS = ("official", "assets")


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("ROBOSPA_ASSETS", raising=False)


def test_a_folder_is_added_and_listed(tmp_path: Path) -> None:
    root = make_archive(tmp_path / "assets", ["can"], ("objects", "background_texture"))
    before = sorted(root.rglob("*"))
    code, out, _ = robospa(*ASSETS, root, "--add")
    assert code == 0 and "tasks can run with this folder" in out
    assert sorted(root.rglob("*")) == before
    code, listed, _ = robospa(*ASSETS)
    assert code == 0 and listed == out
    data = json.loads(robospa(*ASSETS, "--json").out)
    assert data["textures"] == {"seen": 2, "unseen": 2}
    assert "Pick_Cans_Relational" not in data["missing"]
    assert data["missing"]["Pick_Seals_Multi_View"] == ["100_seal"]
    assert "100_seal/visual" in data["faults"]["100_seal/base0"]


def test_a_torn_file_is_one_sentence(tmp_path: Path) -> None:
    root = make_archive(tmp_path / "assets", ["can"])
    torn = root / "objects" / "071_can" / "visual" / "base3.glb"
    torn.write_bytes(torn.read_bytes()[:500])
    data = json.loads(robospa(*ASSETS, root, "--json").out)
    assert "unpack the archive again" in data["faults"]["071_can/base3"]
    assert data["missing"]["Pick_Cans_Relational"] == ["071_can"]


@READS_MESHES
def test_a_cache_that_cannot_be_written_is_no_fault_of_the_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "file"))
    code, _, err = robospa(*ASSETS, make_archive(tmp_path / "assets", ["bowl"]))
    assert code == 1 and "file/packs" in err and "Not a directory" in err
