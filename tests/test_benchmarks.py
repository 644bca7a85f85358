"""The results of benchmarks have one form, and their page says what they say."""

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"


@pytest.fixture
def frame(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module `frame` of benchmarks/, where scripts import each other by name."""
    monkeypatch.syspath_prepend(FOLDER)
    yield importlib.import_module("frame")
    del sys.modules["frame"]


def test_the_page_says_what_the_files_do(frame: Any) -> None:
    results = frame.load()
    page = frame.PAGE.read_text(encoding="utf-8")
    assert frame.page(results) == page, "run: python benchmarks/frame.py"
    for result in results:
        assert {"command", "date", "circumstances", "text"} <= set(result)
        for figure in frame.figures(result):
            assert figure.value is not None or figure.note, "what was not measured says why"


def test_a_bar_is_judged_by_its_numbers(frame: Any) -> None:
    assert frame.Figure("a", 1.2, "x", at_most=1.25).met is True
    assert frame.Figure("a", 1.3, "x", at_most=1.25).met is False
    assert frame.Figure("a", 0.89, "", at_least=0.9).met is False
    assert frame.Figure("a", None, "", at_least=0.9, note="no peer").met is None


def test_options_become_arguments_and_the_result_is_kept(
    frame: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame, "RESULTS", tmp_path)
    monkeypatch.setattr(frame, "PAGE", tmp_path / "page.md")
    words = ["/x/wire.py", "b", "--json", "--rounds", "5", "--circumstances", "it rains", "--quick"]
    monkeypatch.setattr(sys, "argv", words)

    def measure(rounds: int = 2, quick: bool = False) -> Any:
        return frame.Result("T", [frame.Figure("a | b", rounds + quick, "ms", at_most=6)])

    frame.main(a=lambda: None, b=measure)
    found = json.loads((tmp_path / "b.json").read_text())
    assert found["command"] == "python benchmarks/wire.py b --rounds 5 --quick"
    assert "| a \\| b | 6 ms | <= 6 met |  |" in (tmp_path / "page.md").read_text()
    assert found["circumstances"] == "it rains"


def test_finished_jobs_are_not_done_again(frame: Any, tmp_path: Path) -> None:
    path, done = tmp_path / "build" / "x.jsonl", []

    def run(name: str, seed: int) -> dict[str, int]:
        done.append((name, seed))
        return {"value": seed}

    frame.gather(path, [("a", 1)], run)
    found = frame.gather(path, [("a", 1), ("b", 2)], run)
    assert done == [("a", 1), ("b", 2)]
    assert [(row.job, row.value) for row in found] == [(("a", 1), 1), (("b", 2), 2)]
