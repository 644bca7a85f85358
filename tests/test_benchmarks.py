"""The results of benchmarks have the common form, and their page says what they say."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
FILES = sorted((FOLDER / "results").glob("*.json"))


def script(name: str, patch: pytest.MonkeyPatch) -> Any:
    """A module of benchmarks/, which import each other by name as scripts do."""
    patch.syspath_prepend(str(FOLDER))
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    patch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def common(monkeypatch: pytest.MonkeyPatch) -> Any:
    return script("common", monkeypatch)


@pytest.mark.usefixtures("common")
def test_the_page_is_up_to_date(monkeypatch: pytest.MonkeyPatch) -> None:
    report = script("report", monkeypatch)
    written = report.PAGE.read_text(encoding="utf-8")
    assert report.page(report.load()) == written, "run: python benchmarks/report.py"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_result_has_the_common_form(path: Path, common: Any) -> None:
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["benchmark"] == path.stem
    assert found["command"] and found["date"]
    assert {"cores", "cpu"} <= set(found["machine"]) and "python" in found["versions"]
    for row in found["rows"]:
        again = common.Metric(**{k: v for k, v in row.items() if k != "met"})
        assert again.to_json() == row
        assert row["value"] is not None or row["note"], "what was not measured says why"


def test_a_bar_is_judged_by_its_numbers(common: Any) -> None:
    assert common.Metric("a", 1.2, "x", at_most=1.25).met is True
    assert common.Metric("a", 1.3, "x", at_most=1.25).met is False
    assert common.Metric("a", 0.89, "", at_least=0.9).met is False
    assert common.Metric("a", None, "", at_least=0.9, note="no peer").met is None


def test_figures_from_before_are_kept(tmp_path: Path, common: Any) -> None:
    path = tmp_path / "x.json"
    common.write(common.Result("x", "X", (common.Metric("a", 2.0, before=3.0),)), path)
    common.write(common.Result("x", "X", (common.Metric("a", 1.0),)), path)
    assert json.loads(path.read_text())["rows"][0]["before"] == 3.0


def test_the_command_is_noted_without_where_to_write(
    common: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["/there/wire.py", "--json", "--requests", "5", "--circumstances", "it rains", "--fill"]
    monkeypatch.setattr(sys, "argv", words)
    assert common.command() == "python benchmarks/wire.py --requests 5 --fill"
