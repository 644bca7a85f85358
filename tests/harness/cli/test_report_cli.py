"""`robospa report`: what it refuses, and the failures of a run with their evidence."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest
from command_line import robospa
from fake_runs import trial_record

from robospa.results.records.runs import to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

pytestmark = pytest.mark.usefixtures("same_figures_once")


LIFT = {"time": 3.0, "kind": "grasped", "object": "b", "index": -1, "note": "", "step": 4}


def record(seed: int, end: str) -> TrialRecord:
    key = TrialKey("Pick_Blocks_Size", 2, seed)
    return trial_record(
        key,
        end == "success",
        end=end,
        candidates=3,
        steps=9,
        physics_steps=900,
        events=(LIFT,),
        diagnostics={"roles": {"a": [0], "b": []}},
        video="videos/x.mp4",
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    records = [record(1, "step_limit"), record(2, "success"), record(3, "infrastructure")]
    (tmp_path / "trials").mkdir()
    (tmp_path / "trials" / "0000.jsonl").write_text("".join(map(to_line, records)))
    row = {k: v for k, v in asdict(records[0].key).items() if k != "seed"}
    (tmp_path / "run.json").write_text(json.dumps({"trials": [{**row, "seeds": [1, 2, 3]}]}))
    return tmp_path


def test_failures_are_counted(folder: Path) -> None:
    out = robospa("report", folder, "--failures").out
    assert out.splitlines()[1].split() == ["Pick_Blocks_Size", "1", "1"]
    assert "1 failed trials of 3, 1 missing" in out


def test_every_failed_trial_with_its_evidence(folder: Path) -> None:
    (row,) = json.loads(robospa("report", folder, "--failures", "--trials", "--json").out)
    assert (row["seed"], row["type"], row["step"]) == (1, "target grounding", 4)
    assert (row["time"], row["video_seconds"]) == (3.0, 1.5)
    assert "took b" in row["evidence"]


def test_an_unknown_grouping_is_refused(folder: Path) -> None:
    assert "not by 'robot'" in robospa("report", folder, "--failures", "--by", "robot").err


def test_the_runs_of_a_folder_are_found(folder: Path) -> None:
    shutil.copytree(folder, folder.parent / "runs" / "mine")
    assert robospa("report", folder.parent / "runs").code == 0
    assert (folder.parent / "runs" / "report" / "report.html").exists()
