"""`--log wandb`, against a W&B that only remembers what it was told."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import pytest
from fake_runs import make_run, shown

import robospa
from robospa.extras import MissingPackage
from robospa.harness.running.tracking import WandbTracker
from robospa.harness.settings import SettingsError

FAKES: dict[str, Any] = {
    "world": "run_fakes:FakeWorld",
    "parts": "run_fakes:parts",
    "tasks": "Pick_Blocks_Size",
    "levels": 1,
    "seeds": "100000-100001",
    "trials": 2,
    "workers": 1,
}


class FakeWandb(types.ModuleType):
    """Remembers; `broken` says which call fails."""

    def __init__(self, broken: str = "") -> None:
        super().__init__("wandb")
        self.broken, self.started, self.logged, self.finished = broken, [], [], 0  # type: ignore[var-annotated]
        self.summary: dict[str, Any] = {}

    def init(self, **arguments: Any) -> FakeWandb:
        self.started.append(arguments)
        return self

    def log(self, row: dict[str, Any]) -> None:
        if self.broken == "log":
            raise OSError("no network")
        self.logged.append(row)

    def finish(self) -> None:
        self.finished += 1

    def Table(self, columns: list[str], data: list[list[Any]]) -> tuple[list[str], list[Any]]:
        return columns, data


def test_rates_scores_and_every_trial_are_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = FakeWandb()
    monkeypatch.setitem(sys.modules, "wandb", fake)
    run = make_run(tmp_path / "mine", [shown("Pick_It", 1, n, n < 3) for n in range(4)], lost=1)
    tracker = WandbTracker(run.folder, "arms", {"run_seed": 0})
    for one in run.records.values():
        tracker.add(one)
    tracker.finish(run)
    tracker.close()
    (started,) = fake.started
    assert (started["project"], started["name"], started["resume"]) == ("arms", "mine", "allow")
    assert started["config"] == {"run_seed": 0}
    *rows, last = fake.logged
    assert [row["trials"] for row in rows] == [1, 2, 3, 4]
    assert rows[-1]["success_rate/Pick_It"] == rows[-1]["success_rate"] == 0.75
    columns, data = last["all_trials"]
    assert len(data) == 5 and dict(zip(columns, data[0], strict=True))["success"] is True
    assert fake.summary["sr_low"] < fake.summary["sr"] == 0.75 < fake.summary["sr_high"]
    assert fake.summary["missing"] == 1 and fake.finished == 1
    WandbTracker(run.folder, "arms", {})
    assert fake.started[1]["id"] == started["id"], "a resumed run goes on where it was"


def test_a_tracker_that_fails_costs_no_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    fake = FakeWandb(broken="log")
    monkeypatch.setitem(sys.modules, "wandb", fake)
    run = robospa.evaluate("run_fakes:FakePolicy", out=tmp_path, log="wandb", **FAKES)
    assert len(run.records) == 2 and not run.missing
    said = capfd.readouterr().err
    assert said.count("nothing more is logged") == 1 and "no network" in said
    assert fake.started[0]["config"]["policy"]["spec"]["name"] == "fake"


def test_what_cannot_be_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SettingsError, match="log 'tensorboard' is not one of none, wandb"):
        robospa.evaluate("hold", out=tmp_path / "run", log="tensorboard", **FAKES)
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(MissingPackage, match=r"wandb is not installed.*\[wandb\]'"):
        robospa.evaluate("hold", out=tmp_path / "run", log="wandb", **FAKES)
    assert not (tmp_path / "run").exists()
