"""`robospa paper` from the command line."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from robospa.harness.cli.main import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(("paper", *words))
    said = capsys.readouterr()
    code = stop.value.code
    return (code if isinstance(code, int) else 0), said.out, said.err


def test_all_tables_are_written_and_the_errata_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, out, _ = run(capsys, "--out", str(tmp_path / "paper"), "--no-figures")
    assert code == 0
    assert "Overall average" in out
    assert "2747 printed cells walked; 22 do not follow" in out
    assert "main, RRR, X-VLA, Drop: printed 28.2, recomputed 26.2" in out
    names = {path.name for path in (tmp_path / "paper").iterdir()}
    assert {"tables.md", "tables.tex", "tables.html", "tables.csv", "main.tex"} <= names


def test_what_is_printed_as_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ("--out", str(tmp_path / "p"), "--table", "basic", "--format", "md", "--json")
    code, out, _ = run(capsys, *words)
    found = json.loads(out)
    assert code == 0 and found["checked"] == 2747 and len(found["errata"]) == 22
    assert found["files"] == [str(tmp_path / "p" / "tables.md")]
    drop = next(e for e in found["errata"] if (e["row"], e["column"]) == ("RRR", "Drop"))
    assert (drop["printed"], drop["recomputed"]) == (28.2, 26.2)
    assert found["table"]["name"] == "basic" and found["table"]["rows"][0]["cells"]


def test_figures_are_drawn_of_all_columns(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[list[str], Path]] = []

    def draw(runs: Any, columns: Any, folder: Path) -> list[SimpleNamespace]:
        asked.append(([c.title for c in columns], folder))
        return [SimpleNamespace(name="one")]

    monkeypatch.setattr("robospa.results.report.report.draw_figures", draw)
    code, out, _ = run(capsys, "--out", str(tmp_path / "p"), "--format", "csv")
    assert code == 0
    assert asked == [(["RDT", "GO-1", "π0.5", "X-VLA"], tmp_path / "p" / "figures")]
    assert "1 figures in" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--format", "pdf"), "no format is called 'pdf'; there are md, tex, html, csv and all"),
        (("--table", "mian"), "no table is called 'mian'; there are main,"),
        (("--mark", "bold"), "no mark is called 'bold'; there are tied, highest, none"),
        (("--run", "nowhere"), "nowhere is not a run"),
    ],
)
def test_mistakes_are_one_sentence_and_write_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    code, out, err = run(capsys, "--out", str(tmp_path / "p"), *words)
    assert (code, out) == (1, "")
    assert said in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "p").exists()


def test_a_run_stands_beside_the_published(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    trials = {
        "task": "Pick_Blocks_Size",
        "level": 1,
        "embodiment": "aloha-agilex",
        "mode": "clean",
        "split": "heldout",
        "seeds": [100000],
    }
    folder = tmp_path / "run"
    (folder / "trials").mkdir(parents=True)
    settings = {"policy": {"spec": {"name": "mine"}}}
    (folder / "run.json").write_text(json.dumps({"settings": settings, "trials": [trials]}))
    words = ("--out", str(tmp_path / "p"), "--run", str(folder), "--no-figures")
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert "mine: of 56 tasks 55 at L1, 56 at L5 were not run" in " ".join(out.split())
