"""`robospa official assets`: what a folder of official assets holds."""

import json
from pathlib import Path

import pytest
from made_archive import make_archive

from robospa.harness.cli.main import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[str, str, int]:
    """What `robospa official assets` prints, on stdout and stderr, and its exit code."""
    with pytest.raises(SystemExit) as end:
        main(["official", "assets", *words])
    out, err = capsys.readouterr()
    return out, err, int(end.value.code or 0)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("ROBOSPA_ASSETS", raising=False)


def test_a_folder_is_added_and_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = make_archive(tmp_path / "assets", ["can"], ("objects", "background_texture"))
    before = sorted(root.rglob("*"))
    out, _, code = run(capsys, str(root), "--add")
    assert code == 0 and "tasks can run with this folder" in out
    assert sorted(root.rglob("*")) == before
    listed, _, code = run(capsys)
    assert code == 0 and listed == out
    data = json.loads(run(capsys, "--json")[0])
    assert data["textures"] == {"seen": 2, "unseen": 2}
    assert "Pick_Cans_Relational" not in data["missing"]
    assert data["missing"]["Pick_Seals_Multi_View"] == ["100_seal"]
    assert "100_seal/visual" in data["faults"]["100_seal/base0"]


def test_a_torn_file_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = make_archive(tmp_path / "assets", ["can"])
    torn = root / "objects" / "071_can" / "visual" / "base3.glb"
    torn.write_bytes(torn.read_bytes()[:500])
    out, _, _ = run(capsys, str(root), "--json")
    data = json.loads(out)
    assert "unpack the archive again" in data["faults"]["071_can/base3"]
    assert data["missing"]["Pick_Cans_Relational"] == ["071_can"]


def test_without_a_folder_it_says_how_to_name_one(capsys: pytest.CaptureFixture[str]) -> None:
    _, err, code = run(capsys)
    assert code == 1 and "`robospa official assets DIR --add`" in err
