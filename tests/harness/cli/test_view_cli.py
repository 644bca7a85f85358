"""`robospa view`: says where to look, ends when told, refuses what is no run."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_runs import KNOWN, make_run

from robospa.harness.cli.main import main


def test_it_shows_a_run_for_a_while(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = make_run(tmp_path / "run", KNOWN).folder
    with pytest.raises(SystemExit) as stop:
        main(["view", str(folder), "--minutes", "0.0001"])
    assert not stop.value.code
    assert "http://127.0.0.1:" in capsys.readouterr().out


def test_what_is_no_run_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["view", str(tmp_path)])
    assert stop.value.code == 1
    assert "is not a run" in capsys.readouterr().err
