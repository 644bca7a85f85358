"""Which films a run has, and which it owes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import KNOWN, RECORDS, make_run

from robospa.results.comparison.compare import compare_results
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import (
    Run,
    by_setting,
    film_name,
    films_in,
    owed_films,
    read_part,
    read_run,
    setting_name,
)
from robospa.results.report.page import write_report
from robospa.results.report.report import make_report
from robospa.results.scoring.models import results_of_run

NAMES = [film_name(record.key) for record in RECORDS]


def put(folder: Path, name: str) -> None:
    (folder / "videos").mkdir(exist_ok=True)
    (folder / name).write_bytes(b"film")


def test_a_film_is_owed_until_it_is_there(tmp_path: Path) -> None:
    wanted = [replace(record, video=name) for record, name in zip(RECORDS, NAMES, strict=True)]
    assert owed_films(tmp_path, wanted) == wanted
    put(tmp_path, NAMES[1])
    assert films_in(tmp_path) == {NAMES[1]}
    assert owed_films(tmp_path, wanted) == [wanted[0], *wanted[2:]]


def test_nothing_is_owed_of_a_trial_whose_film_nobody_wants(tmp_path: Path) -> None:
    assert owed_films(tmp_path, RECORDS) == []


def test_a_record_that_names_another_file_has_nothing_made(tmp_path: Path) -> None:
    strange = [replace(RECORDS[0], video=name) for name in ("../x.mp4", "videos/x.mp4", NAMES[1])]
    assert owed_films(tmp_path, strange) == []


def test_a_film_that_was_made_long_afterwards_belongs_to_its_trial(tmp_path: Path) -> None:
    run = make_run(tmp_path, RECORDS)
    assert {record.video for record in run.records.values()} == {""}
    put(tmp_path, NAMES[4])
    found = read_run(tmp_path).records
    assert [found[record.key].video for record in RECORDS] == [""] * 4 + [NAMES[4], ""]


pytestmark = pytest.mark.usefixtures("same_figures_once")

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
        assert (
            {key.embodiment for key in part.keys}
            == {robot}
            == set(part.manifest.settings.embodiment)
        )
        assert part.records.keys() == set(part.keys)
    assert by_setting(parts[0]) == [parts[0]]


def test_a_part_is_named_by_its_robot(run: Run) -> None:
    assert read_part(f"{run.folder}@franka-panda").keys == by_setting(run)[1].keys
    with pytest.raises(RunError, match="holds trials of aloha-agilex, franka-panda: choose one"):
        read_part(str(run.folder))
    with pytest.raises(RunError, match=r"choose one, such as .*@aloha-agilex"):
        read_part(f"{run.folder}@piper")


def test_the_report_has_the_robots_side_by_side(run: Run, tmp_path: Path) -> None:
    report = make_report(run)
    names = [model.name for model in report.models]
    assert [name.rpartition(" ")[2] for name in names] == [f"({robot})" for robot in ROBOTS]
    assert len(report.columns) == 2 and report.tables
    page = (write_report(report, tmp_path / "out") / "report.html").read_text()
    assert "franka-panda" in page


def test_robots_of_one_policy_are_compared_pair_by_pair(run: Run) -> None:
    one, two = (results_of_run(part, setting_name(part)) for part in by_setting(run))
    found = compare_results(one, two)
    assert found.paired
    assert any(note.startswith("Different robots: aloha-agilex and franka") for note in found.notes)
    assert all(row.only_second == 0 for row in found.cells)
