"""Which films a run has, and which it owes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import robospa
from fake_runs import KEY, KNOWN, RECORDS, make_run, record, trial_record, write

from robospa.results.comparison.compare import compare_results
from robospa.results.failures.labels import label
from robospa.results.lint import lint_run
from robospa.results.records.action_problems import (
    problem_counts,
    problem_data,
    problem_lines,
    trial_problems,
)
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import (
    Run,
    by_setting,
    film_name,
    read_part,
    read_run,
    setting_name,
)
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.models import results_of_run

pytestmark = pytest.mark.usefixtures("no_figures")

NAMES = [film_name(record.key) for record in RECORDS]


def put(folder: Path, name: str) -> None:
    (folder / "videos").mkdir(exist_ok=True)
    (folder / name).write_bytes(b"film")


def test_a_film_that_was_made_long_afterwards_belongs_to_its_trial(tmp_path: Path) -> None:
    run = make_run(tmp_path, RECORDS)
    assert {record.video for record in run.records.values()} == {""}
    put(tmp_path, NAMES[4])
    found = read_run(tmp_path).records
    assert [found[record.key].video for record in RECORDS] == [""] * 4 + [NAMES[4], ""]


ROBOTS = ("aloha-agilex", "franka-panda")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """The same trials with two robots; the second one solves none, in scenes of other digests."""
    second = [
        replace(r, key=replace(r.key, embodiment=ROBOTS[1]), success=False, end="step_limit",
                done=0, best=0, scene_digest="f" * 16)
        for r in KNOWN
    ]  # fmt: skip
    return make_run(tmp_path / "run", [*KNOWN, *second])


def test_a_run_of_several_robots_is_taken_apart(run: Run) -> None:
    parts = by_setting(run)
    assert [setting_name(part) for part in parts] == list(ROBOTS)
    assert sum(len(part.keys) for part in parts) == len(run.keys)
    for part, robot in zip(parts, ROBOTS, strict=True):
        assert {key.embodiment for key in part.keys} == {robot}
        assert set(part.manifest.settings.embodiment) == {robot}
        assert part.records.keys() == set(part.keys)
    assert by_setting(parts[0]) == [parts[0]]


def test_a_part_is_named_by_its_robot(run: Run) -> None:
    assert read_part(f"{run.folder}@franka-panda").keys == by_setting(run)[1].keys
    with pytest.raises(RunError, match="holds trials of aloha-agilex, franka-panda: choose one"):
        read_part(str(run.folder))
    with pytest.raises(RunError, match=r"choose one, such as .*@aloha-agilex"):
        read_part(f"{run.folder}@piper")


def test_robots_of_one_policy_are_compared_pair_by_pair(run: Run) -> None:
    one, two = (results_of_run(part, setting_name(part)) for part in by_setting(run))
    found = compare_results(one, two)
    assert found.paired
    assert any(note.startswith("Different robots: aloha-agilex and franka") for note in found.notes)
    assert all(row.only_second == 0 for row in found.cells)


# ---- actions that were executed otherwise than sent are counted, and every reader of a run is told


FIRST = "action 2: the left arm cannot reach position (0.000, 0.000, 0.050) and holds"
BELOW: dict[str, Any] = {"unreachable_actions": 98, "first_unreachable": FIRST}
HINT = "are poses in the world frame, in metres, with quaternions w x y z?"


def trial(seed: int, steps: int = 100, **diagnostics: Any) -> TrialRecord:
    return record("Pick_Blocks_Size", 1, seed, done=0, steps=steps, diagnostics=diagnostics)


def test_one_trial() -> None:
    text = trial_problems(trial_record(KEY, steps=100, diagnostics=BELOW))
    assert text == (
        "98 of 100 actions (98 %) ask for a pose out of reach, so that the arm holds: "
        f"{HINT} First: {FIRST}"
    )
    assert trial_problems(trial_record(KEY)) == ""


def test_rare_ones_come_without_a_hint() -> None:
    some = {"clipped_grippers": 1, "first_clipped_gripper": "action 7: left gripper is 1.2"}
    assert trial_problems(trial_record(KEY, steps=1000, diagnostics=some)) == (
        "1 of 1000 actions (under 1 %) send a gripper outside 0 (closed) to 1 (open); "
        "first: action 7: left gripper is 1.2"
    )


def test_a_run_has_one_line_for_each_kind_and_the_first_example() -> None:
    records = [trial(2, **BELOW), trial(1, **BELOW), trial(0, text_budget=50, clipped_joints=1)]
    reach, joints = problem_counts(records)
    assert (reach.actions, reach.of, reach.trials) == (196, 300, 2)
    assert reach.first.startswith("Pick_Blocks_Size-L1-1-") and reach.first.endswith(FIRST)
    assert (joints.actions, joints.share, joints.often) == (1, 1 / 300, False)
    assert problem_lines(records)[2] == (
        "1 of 3 trials (33 %) have an instruction that is longer than the policy reads"
    )
    assert problem_data(records) == {
        "actions": 300,
        "unreachable_actions": 196,
        "clipped_joints": 1,
        "clipped_grippers": 0,
        "truncated_instructions": 1,
    }


def test_no_attempt_names_the_reason() -> None:
    roles = {"roles": {"object_0": [0]}}
    found = label(trial_record(KEY, steps=100, diagnostics={**BELOW, **roles}))
    assert found is not None and found.kind == "no_attempt"
    assert found.evidence == (
        "no gripper came near anything that was asked for; 98 of 100 actions (98 %) ask for a "
        f"pose out of reach, so that the arm holds: {HINT}"
    )


@pytest.mark.parametrize(
    ("diagnostics", "rule"),
    [
        (BELOW, "unreachable-actions"),
        ({"clipped_joints": 10}, "clipped-joints"),
        ({"clipped_grippers": 5}, "clipped-grippers"),
        ({"clipped_grippers": 4}, ""),
        ({"text_budget": 50}, "truncated-instructions"),
    ],
)
def test_lint_warns_above_a_share(tmp_path: Path, diagnostics: dict[str, Any], rule: str) -> None:
    found = lint_run(write(tmp_path / "run", [trial(0, **diagnostics)]))
    assert [(one.rule, one.severity) for one in found] == ([(rule, "warning")] if rule else [])


def test_report_and_failures_say_it(tmp_path: Path) -> None:
    folder = write(tmp_path / "run", [trial(0, **BELOW), trial(1, text_budget=50)]).folder
    printed = robospa("report", folder, "--failures").out
    assert "98 of 200 actions (49 %) ask for a pose out of reach" in printed
    assert "1 of 2 trials (50 %) have an instruction that is longer" in printed
    assert robospa("report", folder, "--out", tmp_path / "report").code == 0
    data = json.loads((tmp_path / "report" / "report.json").read_text())
    assert data["runs"][0]["problems"]["unreachable_actions"] == 98
    text = (tmp_path / "report" / "report.md").read_text()
    assert "not executed as sent: 98 of 200 actions" in text
    page = (tmp_path / "report" / "report.html").read_text()
    assert "98 of 200 actions (49 %)" in page and "98 of 100 actions (98 %)" in page
