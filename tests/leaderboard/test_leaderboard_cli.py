"""`robospa leaderboard`: from a bundle to a page, by the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bundle_fakes import FAKES, REFERENCE
from msgspec import to_builtins
from site_fakes import REPLAYED, make_valid, of_bundle

from robospa.harness.cli.main import main

pytestmark = pytest.mark.usefixtures("same_figures_once")


def call(*words: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(words)
    return int(stop.value.code or 0)


def test_evidence_of_another_bundle_adds_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robospa.leaderboard.rules.shipped", lambda world, parts: REFERENCE)
    valid = make_valid(tmp_path)
    path = tmp_path / "evidence.json"
    path.write_text(json.dumps({"valid": {"bundle": "0"}, "replayed": REPLAYED}))
    words = ["leaderboard", "add", str(valid.path), "--evidence", str(path)]
    words += ["--submissions", str(tmp_path / "home"), *FAKES]
    assert call(*words) == 1
    assert "of another bundle" in capsys.readouterr().err
    assert not (tmp_path / "home").exists()
    replayed = of_bundle(valid, REPLAYED)
    path.write_text(json.dumps({"valid": to_builtins(valid.evidence), "replayed": replayed}))
    assert call(*words) == 0
    assert (tmp_path / "home" / "fake-1" / "model.json").is_file()
    assert capsys.readouterr().out.startswith("Submission: ")
    assert call(*words, "--name", "again", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["submission"] == str(tmp_path / "home" / "again")
    assert told["evidence"]["bundle"] == valid.evidence.bundle


def test_a_broken_submission_stops_the_build_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "home" / "empty").mkdir(parents=True)
    words = ["leaderboard", "build", "--submissions", str(tmp_path / "home")]
    assert call(*words, "--out", str(tmp_path / "site")) == 1
    assert "manifest.json cannot be read" in capsys.readouterr().err
    assert not (tmp_path / "site").exists()
