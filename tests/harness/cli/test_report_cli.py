"""`robospa report`: the failures of a run with their evidence."""

import json
import shutil
from pathlib import Path

import pytest
from command_line import robospa
from fake_runs import trial_record, write

from robospa.trial import TrialKey

pytestmark = pytest.mark.usefixtures("same_figures_once")

LIFT = {"time": 3.0, "kind": "grasped", "object": "b", "index": -1, "note": "", "step": 4}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    told = {"candidates": 3, "steps": 9, "physics_steps": 900, "events": (LIFT,)}
    told |= {"diagnostics": {"roles": {"a": [0], "b": []}}, "video": "videos/x.mp4"}
    ends = ((1, "step_limit"), (2, "success"), (3, "infrastructure"))
    keys = {n: TrialKey("Pick_Blocks_Size", 2, n) for n, _ in ends}
    records = [trial_record(keys[n], end == "success", end=end, **told) for n, end in ends]
    return write(tmp_path / "run", records).folder


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
