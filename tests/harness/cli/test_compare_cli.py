"""`robospa compare` and `robospa report --lint` from the command line."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import robospa
from fake_runs import outcomes, write
from run_fakes import FakePolicy

from robospa.harness import machine_check
from robospa.harness.cli.main import COMMANDS
from robospa.protocol.server import ServerThread
from robospa.results.paper.columns import published_results
from robospa.tasks.catalog import build_scene, tasks


def test_published_models_are_compared() -> None:
    code, text, _ = robospa("compare", "pi0.5", "X-VLA")
    assert code == 0
    assert "SR of π0.5 minus X-VLA" in text
    assert "+2.4 [+1.0, +3.7]" in text  # overall at L5
    assert "MOVER on Wilson" in text


def test_a_run_against_the_paper_has_a_banner_and_names_over_its_columns(tmp_path: Path) -> None:
    write(tmp_path / "a-run-with-a-long-name", outcomes("Pick_Blocks_Size", 1, [1] * 9 + [0]))
    folder = str(tmp_path / "a-run-with-a-long-name")
    code, text, _ = robospa("compare", folder, "pi05")
    assert code == 0
    banner = text.splitlines()[0]
    for word in ("Another suite", "π0.5", "seeds", "object meshes", "renderer", "sentences"):
        assert word in banner
    assert re.search(r"level +\S*with-a-long-name +π0\.5 +difference", text)
    code, text, _ = robospa("compare", folder, "pi05", "--json")
    found = json.loads(text)
    assert code == 0 and found["banner"] == banner and len(found["cells"]) == 1


@pytest.mark.parametrize("name", ["pi05", "pi0.5", "π0.5", "PI0_5"])
def test_a_model_is_found_however_it_is_written(name: str) -> None:
    assert published_results(name).name == "π0.5"


def test_sample_sizes() -> None:
    code, text, _ = robospa("compare", "--power", "--base", "0.2")
    assert code == 0
    assert "5 points: 1092 on unrelated seeds; on equal seeds 825 if phi is 0.25" in text
    words = ["--tasks", "GAC", "--levels", "5", "--json"]
    found = json.loads(robospa("compare", "--power", *words)[1])
    assert found["variants"] == 4 and found["differences"][1]["unpaired"] == 1092
    assert set(found["half_widths"]["10"]) == {"RDT", "GO-1", "pi0.5", "X-VLA"}


def test_lint_of_the_paper_fails_with_its_findings() -> None:
    code, text, _ = robospa("report", "paper", "--lint")
    assert code == 1
    assert "8 errors, 0 warnings" in text


# ------------------------------------------------------------ `robospa paper` from the command line


def test_all_tables_are_written_and_the_errata_told(tmp_path: Path) -> None:
    code, out, _ = robospa("paper", "--out", str(tmp_path / "paper"), "--no-figures")
    assert code == 0
    assert "Overall average" in out
    assert "2747 printed cells checked; 22 do not follow" in out
    assert "main, RRR, X-VLA, Drop: printed 28.2, recomputed 26.2" in out
    names = {path.name for path in (tmp_path / "paper").iterdir()}
    assert {"tables.md", "tables.tex", "tables.html", "tables.csv", "main.tex"} <= names


# --------------- help as wide as the terminal, completion by the shell, and JSON for other programs


@pytest.mark.parametrize("columns", [60, 80, 118])
def test_help_is_as_wide_as_the_terminal(columns: int) -> None:
    widths = [len(line) for line in robospa("eval", "--help", columns=columns).out.splitlines()]
    assert columns - 16 < max(widths) <= columns


def test_the_list_of_commands_is_not_cut() -> None:
    text = " ".join(robospa("--help", columns=80).out.split()).partition("Evaluate a policy:")[2]
    assert "..." not in text
    assert [summary for summary in COMMANDS.values() if summary not in text] == []


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("robospa ta", "tasks"),
        ("robospa eval --emb", "--embodiment --embodiments"),
        ("robospa eval --split ", "heldout train indirect"),
        ("robospa eval --video f", "failures first"),
        ("robospa submit ve", "verify"),
    ],
)
def test_the_shell_completes(line: str, expected: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_ROBOSPA_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    assert robospa().out.split() == expected.split()


def test_tasks_as_json() -> None:
    listed = json.loads(robospa("tasks", "--json").out)
    assert [row["name"] for row in listed] == list(tasks())
    assert listed[0]["levels"]["5"] == {"candidates": 6, "subtasks": 1, "steps": 150}
    scene = json.loads(robospa("tasks", "pick blocks size", "--level", "2", "--json").out)
    assert scene["digest"] == build_scene("Pick_Blocks_Size", 2, 100000).digest
    assert set(scene["instructions"]) == {"train", "heldout", "indirect"}
    assert scene["plan"][0]["skill"] == "Pick"


def test_a_server_s_checks_as_json(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        machine_check,
        "run_checks",
        lambda: iter([machine_check.SystemCheck("simulator", True, "fine")]),
    )
    with ServerThread(policy_factory=FakePolicy) as server:
        words = ("--trials", "0", "--load-seconds", "0", "--json")
        found = json.loads(robospa("check", server.url, *words).out)
        machine = json.loads(robospa("check", "--json").out)
    assert found["url"] == server.url and found["passed"]
    assert {"name", "passed", "detail", "hint"} == set(found["checks"][0])
    assert machine["checks"] == [{"name": "simulator", "ok": True, "detail": "fine", "fix": ""}]


def test_figures_are_drawn_of_all_columns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[list[str], Path]] = []

    def draw(runs: Any, columns: Any, folder: Path) -> list[SimpleNamespace]:
        asked.append(([c.title for c in columns], folder))
        return [SimpleNamespace(name="one")]

    monkeypatch.setattr("robospa.results.report.report.draw_figures", draw)
    code, out, _ = robospa("paper", "--out", str(tmp_path / "p"), "--format", "csv")
    assert code == 0
    assert asked == [(["RDT", "GO-1", "π0.5", "X-VLA"], tmp_path / "p" / "figures")]
    assert "1 figures in" in out
