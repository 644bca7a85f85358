"""Basic grounding tasks: scored and tabled by themselves, never part of an average above them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import outcomes, write

from robospa.results.paper.columns import published_column, run_column
from robospa.results.paper.tables import make_tables
from robospa.results.records.runs import Run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.score_table import rows
from robospa.results.report.tables import report_tables
from robospa.results.scoring.scores import score_run, to_json

SETS = 5
SOLVED = (4, 3, 4, 2, 4)
"""Of four trials of each set at level 1; half of them at level 2."""


def grounding(sets: int = SETS) -> list[TrialRecord]:
    found: list[TrialRecord] = []
    for i in range(sets):
        for level, done in ((1, SOLVED[i]), (2, 2)):
            made = outcomes(f"Ground_{i}", level, [1] * done + [0] * (4 - done))
            found += [replace(r, category="CBG") for r in made]
    return found


def run_of(folder: Path, records: list[TrialRecord]) -> Run:
    return write(folder, records, categories={r.key.task: r.category for r in records})


@pytest.fixture
def mixed(tmp_path: Path) -> Run:
    """Every basic trial fails or not; the one base task always succeeds."""
    return run_of(tmp_path / "run", outcomes("Pick_Blocks_Size", 1, [1] * 4) + grounding())


def test_no_average_includes_them(mixed: Run) -> None:
    scores = score_run(mixed)
    sr = scores.overall[0].values["sr"]
    assert sr is not None and sr.value == 1.0
    assert set(scores.dimensions) == {("spatial", 1), ("spatial", 0)}
    own = scores.categories["CBG", 1].values["sr"]
    assert own is not None and own.value == pytest.approx(17 / 20)
    assert own.low < 17 / 20 < own.high


def test_their_rows_come_last(mixed: Run) -> None:
    labels = [row.label for row in rows(score_run(mixed))]
    assert labels[:2] == ["Pick Blocks Size", "Ground 0"]
    assert labels[-2:] == ["overall", "CBG Color-Based Grounding"]


def test_a_run_of_them_alone_has_no_overall_value(tmp_path: Path) -> None:
    scores = score_run(run_of(tmp_path / "run", grounding()))
    assert to_json(scores)["overall"] == {}
    assert [r.label for r in rows(scores)][-1] == "CBG Color-Based Grounding"


def test_the_table_sets_own_runs_beside_the_printed_values(mixed: Run) -> None:
    (table,) = make_tables([published_column("pi0.5"), run_column(mixed)], ["basic"])
    assert [width for _, width in table.groups] == [5, 5]
    color, position, _ = table.rows
    assert [e.text for e in color.cells[:2]] == ["80.6", "77.8"]
    assert color.cells[5].value == pytest.approx(85.0)
    assert color.cells[5].text.startswith("85.0 [")
    assert color.cells[6].value == pytest.approx(50.0)
    assert {e.text for e in (*color.cells[7:], *position.cells[5:])} == {"–"}


def test_a_mean_over_some_of_the_sets_stays_open(tmp_path: Path) -> None:
    column = run_column(run_of(tmp_path / "run", grounding(sets=4)))
    (table,) = make_tables([column], ["basic"])
    assert {e.text for e in table.rows[0].cells[5:]} == {"–"}


def test_without_such_runs_the_table_is_the_printed_one() -> None:
    (table,) = make_tables([published_column("pi0.5")], ["basic"])
    assert table.groups == () and len(table.heads) == 5


def test_runs_of_them_alone_are_in_no_table_of_the_benchmark(tmp_path: Path) -> None:
    column = run_column(run_of(tmp_path / "run", grounding()))
    main, basic = make_tables([published_column("pi0.5"), column], ["main", "basic"])
    assert len(main.groups) == 1 and len(basic.groups) == 2


def test_the_report_shows_the_table(mixed: Run, tmp_path: Path) -> None:
    assert "basic" in [s.table.name for s in report_tables([run_column(mixed)])]
    alone = run_column(run_of(tmp_path / "alone", grounding()))
    assert [s.table.name for s in report_tables([alone])] == ["basic"]
