"""`robospa eval --latency`: a run for every latency, then one table and one figure."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import robospa
from run_fakes import run_here

from robospa.harness.running import evaluate as running
from robospa.harness.running.runner import Runner
from robospa.harness.running.status import TimeBreakdown

WORDS = [
    "eval",
    "clock_fakes:walker",
    *("--world", "clock_fakes:TargetWorld", "--parts", "run_fakes:parts"),
    *("--tasks", "Pick_Blocks_Size", "--levels", "1", "--seeds", "100000-100011"),
    *("--trials", "12", "--action-rate", "16.67"),
]


class Inline(Runner):
    """In the place of the driver: one worker in this process."""

    def status(self, now: float) -> Any:
        return None

    def run(self) -> None:
        self.times = TimeBreakdown()
        for record in run_here(self.config, self.keys):
            self.on_record(record)


@pytest.fixture(autouse=True)
def one_process(monkeypatch: pytest.MonkeyPatch, world_asked_here: None) -> None:
    monkeypatch.setattr(running, "Runner", Inline)
    monkeypatch.setattr(running, "summary", lambda shares, status: [])


def test_one_command_gives_runs_a_table_and_a_figure(tmp_path: Path) -> None:
    words = ["--latency", "0,120,240,480", "--out", str(tmp_path)]
    code, out, err = robospa(*WORDS, *words)
    assert code == 0, err
    assert "success against latency" in out and "alf of the success is gone at" in out
    manifest = json.loads((tmp_path / "240ms" / "run.json").read_text())
    assert manifest["settings"]["clock"]["latency_ms"] == 240
    data = json.loads((tmp_path / "success-latency.json").read_text())
    rates = [point["success"]["value"] for point in data["points"]]
    assert rates == sorted(rates, reverse=True) and rates[0] > rates[-1]
    assert {p.suffix for p in tmp_path.glob("success-latency.*")} == {
        ".json", ".md", ".svg", ".png", ".pdf"
    }  # fmt: skip
    code, out, _ = robospa(*WORDS, *words, "--resume", "--json")
    assert code == 0 and json.loads(out)["points"] == data["points"]
