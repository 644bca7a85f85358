"""`robospa compare` and `robospa report --lint` from the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from fake_runs import outcomes, write

from robospa.harness.cli.main import main
from robospa.results.comparison.compare import heads_of
from robospa.results.paper.columns import published_results


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(words)
    said = capsys.readouterr()
    code = stop.value.code
    return (code if isinstance(code, int) else 0), said.out, said.err


def test_published_models_are_compared(capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capsys, "compare", "pi0.5", "X-VLA")
    assert code == 0
    assert "SR of π0.5 minus X-VLA" in text
    assert "+2.4 [+1.0, +3.7]" in text  # overall at L5
    assert "MOVER on Wilson" in text


def test_a_run_against_the_paper_has_a_banner_and_names_over_its_columns(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    write(tmp_path / "a-run-with-a-long-name", outcomes("Pick_Blocks_Size", 1, [1] * 9 + [0]))
    folder = str(tmp_path / "a-run-with-a-long-name")
    code, text, _ = run(capsys, "compare", folder, "pi05")
    assert code == 0
    banner = text.splitlines()[0]
    for word in ("Another suite", "π0.5", "seeds", "object meshes", "renderer", "sentences"):
        assert word in banner
    assert re.search(r"level +\S*with-a-long-name +π0\.5 +difference", text)
    code, text, _ = run(capsys, "compare", folder, "pi05", "--json")
    found = json.loads(text)
    assert code == 0 and found["banner"] == banner and len(found["cells"]) == 1


def test_two_runs_have_no_banner(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for name, found in (("one", [1, 1, 0]), ("two", [1, 0, 0])):
        write(tmp_path / name, outcomes("Pick_Blocks_Size", 1, found))
    code, text, _ = run(capsys, "compare", str(tmp_path / "one"), str(tmp_path / "two"))
    assert code == 0
    assert text.startswith("SR of one minus two")
    assert "only one  only two" in text


def test_names_over_columns_stay_apart() -> None:
    long = "an-evaluation-of-many-words"
    assert heads_of("one", "two") == ["one", "two"]
    assert heads_of(f"{long}-1", f"{long}-2") == ["…n-of-many-words-1", "…n-of-many-words-2"]
    assert heads_of(f"a-{long}", f"b-{long}") == ["first", "second"]


@pytest.mark.parametrize("name", ["pi05", "pi0.5", "π0.5", "PI0_5"])
def test_a_model_is_found_however_it_is_written(name: str) -> None:
    assert published_results(name).name == "π0.5"


def test_sample_sizes(capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run(capsys, "compare", "--power", "--base", "0.2")
    assert code == 0
    assert "5 points: 1092 on unrelated seeds; on equal seeds 825 if phi is 0.25" in text
    words = ["--tasks", "GAC", "--levels", "5", "--json"]
    found = json.loads(run(capsys, "compare", "--power", *words)[1])
    assert found["variants"] == 4 and found["differences"][1]["unpaired"] == 1092
    assert set(found["half_widths"]["10"]) == {"RDT", "GO-1", "pi0.5", "X-VLA"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["compare"], "compare needs two sides"),
        (
            ["compare", "nowhere", "RDT"],
            "there is no folder nowhere, and no published model is called",
        ),
        (["compare", "pi06", "RDT"], "did you mean pi0.5? there are RDT, GO-1, pi0.5, X-VLA"),
        (["report", "nowhere", "--lint"], "nowhere is not a run"),
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
    code, text, _ = run(capsys, "report", "paper", "--lint")
    assert code == 1
    assert "8 errors, 0 warnings" in text
