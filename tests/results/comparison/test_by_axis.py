"""One policy in clean and in randomised scenes: one table, paired by seed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import make_run, shown

from robospa.results.comparison.compare import by_axis
from robospa.results.records.runs import by_setting
from robospa.results.report.report import make_report
from robospa.results.scoring.models import ModelResults, results_of_run

pytestmark = pytest.mark.usefixtures("same_figures_once")


def trials(mode: str, good: int, split: str = "heldout") -> list:  # type: ignore[type-arg]
    made = [shown("Pick_Blocks_Size", 1, n, n < good) for n in range(8)]
    return [replace(r, key=replace(r.key, mode=mode, split=split)) for r in made]


@pytest.fixture
def sides(tmp_path: Path) -> list[ModelResults]:
    run = make_run(tmp_path / "run", [*trials("clean", 6), *trials("randomized", 3)])
    return [results_of_run(part, part.keys[0].mode) for part in by_setting(run)]


def test_modes_stand_side_by_side_with_their_paired_difference(sides: list[ModelResults]) -> None:
    table = by_axis(sides)
    assert table is not None
    assert table.heads == ("clean", "randomized", "randomized minus clean")
    assert table.title == "SR by scene modes" and "paired by seed" in table.notes[0]
    assert [row.label for row in table.rows] == ["GAC", "spatial", "overall"]
    for row in table.rows:
        clean, randomized, gap = row.cells
        assert (clean.value, randomized.value, gap.value) == (75.0, 37.5, -37.5)
        assert gap.low is not None and gap.high is not None and gap.low < -37.5 < gap.high
        assert gap.text.startswith("-37.5 [-")


def test_robots_and_splits_together_have_names_of_both(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [*trials("clean", 6), *trials("randomized", 3, "indirect")])
    table = by_axis([results_of_run(part, str(i)) for i, part in enumerate(by_setting(run))])
    assert table is not None
    assert table.heads[:2] == ("clean heldout", "randomized indirect")


def test_runs_of_one_setting_have_no_such_table(sides: list[ModelResults]) -> None:
    assert by_axis(sides[:1]) is None and by_axis([sides[0], sides[0]]) is None


def test_the_report_shows_it_first(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [*trials("clean", 6), *trials("randomized", 3)])
    first = make_report(run).tables[0].table
    assert first.name == "sr-by-mode" and len(first.rows) == 3
