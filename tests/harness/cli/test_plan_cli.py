"""`robospa plan` on the command line."""

from __future__ import annotations

import json

import pytest

from robospa.harness.cli.main import main


def output(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as end:
        main(["plan", *words])
    assert not end.value.code
    return capsys.readouterr().out


def test_it_says_which_budget_is_enough(capsys: pytest.CaptureFixture[str]) -> None:
    text = output(capsys)
    assert text.startswith("28,000 trials, 12,4")
    assert "560 trials tell the overall success rate to within 2.2 (RDT)" in text
    assert "For 2.5 points either way --budget 976 is enough" in text
    assert "To tell 5 points apart: 1,092 trials a side" in text
    assert "Least budget: 280" in text


def test_it_is_about_the_selected_trials(capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(
        output(capsys, "--tasks", "GAC", "--levels", "5", "--trials", "20", "--json")
    )
    assert found["trials"] == 80 and found["least"] == 4
    assert list(found["half_widths"]) == ["80"] and found["enough"] == {}


def test_a_server_that_is_not_there_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["plan", "ws://127.0.0.1:9", "--tasks", "GAC"])
    assert end.value.code == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert said[-1].startswith("robospa: ") and "127.0.0.1:9" in said[-1]


@pytest.mark.sim
def test_a_sample_says_what_all_trials_will_cost(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = ("--tasks", "Pick_Blocks_Size", "--levels", "1", "--trials", "20", "--workers", "1")
    found = json.loads(output(capsys, "oracle", *chosen, "--seconds", "2", "--json"))["cost"]
    assert found["trials"] == 20 and 1 <= found["sampled"] <= 20
    assert found["calls"] >= 20 and found["seconds"] > 0 and found["server_hours"] == 0
