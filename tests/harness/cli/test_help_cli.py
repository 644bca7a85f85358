"""Help as wide as the terminal, completion by the shell, and JSON for other programs."""

from __future__ import annotations

import json

import pytest
from run_fakes import FakePolicy

from robospa.harness import machine_check
from robospa.harness.cli.main import COMMANDS, main
from robospa.protocol.server import ServerThread
from robospa.tasks.catalog import build_scene, tasks


def output(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as end:
        main(words)
    out, err = capsys.readouterr()
    assert not end.value.code, err
    return out


@pytest.mark.parametrize("columns", [60, 80, 118])
def test_help_is_as_wide_as_the_terminal(
    columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    widths = [len(line) for line in output(capsys, "eval", "--help").splitlines()]
    assert columns - 16 < max(widths) <= columns


def test_the_list_of_commands_is_not_cut(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = " ".join(output(capsys, "--help").split()).partition("Evaluate a policy:")[2]
    assert "..." not in text
    assert [summary for summary in COMMANDS.values() if summary not in text] == []


def test_options_of_eval_stand_in_the_groups_of_its_settings(
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = output(capsys, "eval", "--help-all")
    sections = {
        part.splitlines()[0].rstrip(":"): part for part in text.split("\n\n") if ":\n" in part
    }
    assert list(sections)[-7:] == [
        "Selection", "Simulation", "Timing", "Connection", "Retries", "Compute", "Recording"
    ]  # fmt: skip
    assert "--embodiment" in sections["Selection"] and "--video" in sections["Recording"]
    assert "--resume" in sections["Options"] and "--tasks" not in sections["Options"]


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
def test_the_shell_completes(
    line: str,
    expected: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("_ROBOSPA_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    assert output(capsys).split() == expected.split()


def test_tasks_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    listed = json.loads(output(capsys, "tasks", "--json"))
    assert [row["name"] for row in listed] == list(tasks())
    assert listed[0]["levels"]["5"] == {"candidates": 6, "subtasks": 1, "steps": 150}
    scene = json.loads(output(capsys, "tasks", "pick blocks size", "--level", "2", "--json"))
    assert scene["digest"] == build_scene("Pick_Blocks_Size", 2, 100000).digest
    assert set(scene["instructions"]) == {"train", "heldout", "indirect"}
    assert scene["plan"][0]["skill"] == "Pick"


def test_a_server_s_checks_as_json(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        machine_check,
        "run_checks",
        lambda: iter([machine_check.SystemCheck("simulator", True, "fine")]),
    )
    with ServerThread(policy_factory=FakePolicy) as server:
        found = json.loads(
            output(capsys, "check", server.url, "--trials", "0", "--load-seconds", "0", "--json")
        )
        machine = json.loads(output(capsys, "check", "--json"))
    assert found["url"] == server.url and found["passed"]
    assert {"name", "passed", "detail"} == set(found["checks"][0])
    assert machine["checks"] == [{"name": "simulator", "ok": True, "detail": "fine", "fix": ""}]
