"""`robospa compare` and `robospa lint` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robospa.harness.cli.main import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(words)
    said = capsys.readouterr()
    code = stop.value.code
    return (code if isinstance(code, int) else 0), said.out, said.err


def test_published_models_are_compared(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "found.json"
    code, text, _ = run(capsys, "compare", "pi0.5", "X-VLA", "--drops", "--json", str(out))
    assert code == 0
    assert "SR of π0.5 minus X-VLA" in text
    assert "+2.4 [+1.0, +3.7]" in text  # overall at L5
    assert "MOVER on Wilson" in text
    assert "overall L1-L5: +30.3 [+28.8, +31.8]" in text
    assert len(json.loads(out.read_text())["cells"]) == 280


def test_sample_sizes(capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capsys, "compare", "--power", "--base", "0.2")
    assert code == 0
    assert "5 points: 1092 on unrelated seeds; on equal seeds 825 if phi is 0.25" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["compare"], "compare needs two sides"),
        (["compare", "nowhere", "RDT"], "nowhere is neither a folder nor a published model"),
        (["compare", "RDT", "GO-1", "--early"], "share no seed"),
        (["lint", "nowhere"], "nowhere is not a run"),
    ],
)
def test_mistakes_are_one_sentence(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    code, _, error = run(capsys, *words)
    assert code == 1
    assert said in error
    assert error.count("\n") == 1


def test_lint_of_the_paper_fails_with_its_findings(capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capsys, "lint", "paper")
    assert code == 1
    assert "10 errors, 0 warnings" in text
