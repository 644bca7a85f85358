"""Scores of small runs that can be computed by hand."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import outcomes, record, write

from robospa.results.comparison.compare import compare_results
from robospa.results.records.runs import Run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.page import write_report
from robospa.results.report.report import make_report
from robospa.results.report.run_card import print_scores
from robospa.results.scoring.models import results_of_run
from robospa.results.scoring.scores import IDLE, Scores, score, score_run
from robospa.results.statistics.intervals import wilson
from robospa.trial import TrialKey


def scores(records: list[TrialRecord], extra: tuple[TrialKey, ...] = ()) -> Scores:
    known = {r.key: r for r in records}
    return score([*known, *extra], known, {"Z": "GAC"})


def values(found: object, metric: str) -> float | None:
    estimate = found.values.get(metric)  # type: ignore[attr-defined]
    return None if estimate is None else estimate.value


def test_the_first_choice_counts_beside_the_official_rule() -> None:
    records = outcomes("A", 1, [1, 1, 1, 0])
    took = {"time": 1.0, "kind": "wrong_object", "object": "other", "index": -1}
    records[0] = replace(records[0], events=(took,))
    cell = scores([*records, lost("A", 9)]).cells["A", 1]
    assert (cell.successes, cell.firsts) == (3, 2)
    assert [values(cell, m) for m in ("sr", "sr1", "onta", "onta1")] == [0.75, 0.5, 0.5, 0.0]
    assert "ps" not in cell.values
    assert cell.values["sr1"] == wilson(2, 4)
    assert [cell.bounds(m) for m in ("sr1", "onta1")] == [(0.4, 0.6), pytest.approx((-0.2, 0.2))]


def test_progress_is_the_mean_share_of_subtasks_done_at_the_end() -> None:
    records = [record("B", 1, n, k, 4, category="OFE") for n, k in enumerate((0, 1, 4, 3))]
    given = tuple({"time": t, "kind": "subtask_done", "object": "a", "index": t} for t in range(3))
    records[3] = replace(records[3], events=given)  # one subtask held before the first action
    cell = scores(records).cells["B", 1]
    assert [values(cell, m) for m in ("ps", IDLE, "sr")] == pytest.approx([0.5, 0.0625, 0.25])
    assert "onta" not in cell.values


def test_the_overall_value_is_the_mean_of_categories_not_of_tasks() -> None:
    records = [record(f"A{n}", 1, 0, 1) for n in range(3)]
    found = scores([*records, record("B", 1, 0, 0, category="SDE")])
    assert values(found.overall[1], "sr") == pytest.approx(0.5)
    assert values(found.dimensions["spatial", 1], "sr") == pytest.approx(0.5)
    assert ("procedural", 1) not in found.dimensions


def test_a_variant_without_a_result_leaves_the_averages_open() -> None:
    found = scores([record("A", 1, 0, 1)], extra=(TrialKey("Z", 1, 0),))
    assert found.cells["Z", 1].values == dict.fromkeys(("sr", "sr1", "onta", "onta1"))
    assert values(found.categories["GAC", 1], "sr") is None
    assert values(found.overall[1], "onta") is None
    assert found.overall[1].bounds("sr") == (0.5, 1.0)
    assert found.overall[1].missing == 1


pytestmark = pytest.mark.usefixtures("same_figures_once")

PICK, PUT = "Pick_Blocks_Size", "Put_Bottles_Dustbin"
WHY = "ws://gpu:8000 did not send actions within 120 s"


def lost(task: str, seed: int) -> TrialRecord:
    return record(task, 1, seed, 0, end="infrastructure", message=WHY, attempts=3)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Of 8 listed trials of a spatial variant 6 have a result, of 8 of a procedural one 6."""
    records = [*outcomes(PICK, 1, [1, 1, 1, 0, 1, 1]), lost(PICK, 6), lost(PICK, 7)]
    records += [record(PUT, 1, seed, 1 + seed % 2, 2) for seed in range(6)]
    never = [TrialKey(PUT, 1, 6), TrialKey(PUT, 1, 7)]
    return write(tmp_path_factory.mktemp("missing") / "run", records, never)


@pytest.fixture(scope="module")
def report(run: Run) -> Path:
    return write_report(make_report(run), run.folder / "report")


def test_rates_are_of_results_and_bounds_of_all_that_is_listed(run: Run) -> None:
    scores = score_run(run)
    pick, put = scores.cells[PICK, 1], scores.cells[PUT, 1]
    assert pick.values["sr"] is not None and pick.values["sr"].value == pytest.approx(5 / 6)
    assert pick.bounds("sr") == (5 / 8, 7 / 8)
    assert pick.bounds("onta") == (2 * 5 / 8 - 1, 2 * 7 / 8 - 1)  # two candidates
    assert pick.bounds("ps") is None
    assert put.bounds("ps") == pytest.approx((4.5 / 8, 6.5 / 8))
    overall = scores.overall[1]
    assert overall.missing == 4
    assert overall.bounds("sr") == pytest.approx(((5 / 8 + 3 / 8) / 2, (7 / 8 + 5 / 8) / 2))


def test_the_terminal_marks_incomplete_variants_and_says_why(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    print_scores(run, results_of_run(run))
    text = capsys.readouterr().out
    assert "83.3†" in text and "50.0†" in text
    assert "16 trials: 8 success, 4 step limit, 2 missing, 2 not run († lacks trials)" in text
    assert "SR would be 62.5 and SR@1 62.5, if all had succeeded 87.5 and 87.5" in text
    assert f"missing 2: {WHY}" in text
    assert "missing 2: not run yet" in text


def test_every_table_of_a_report_names_what_is_missing(report: Path) -> None:
    markdown = (report / "report.md").read_text()
    assert "Pick Blocks Size L1 lacks 2, SR between 62.5 and 87.5" in markdown
    assert "Pick Blocks Size L1 lacks 2, ONTA between 25.0 and 75.0" in markdown
    assert "Put Bottles Dustbin L1 lacks 2, PS between 56.3 and 81.3" in markdown
    assert "ends: 8 success, 4 step limit, 2 missing, 2 not run" in markdown
    assert "did not send actions within 120 s" in markdown
    latex = (report / "tables" / "sr-tasks.tex").read_text()
    assert r"83.3$^{\dagger}$" in latex and "lacks 2, SR between 62.5 and 87.5" in latex
    page = (report / "report.html").read_text()
    assert "2 trials missing, so between 62.5 and 87.5" in page
    assert "4 of 16 trials are missing" in page
    drawn = [path.read_text() for path in (report / "figures").glob("*.svg")]
    assert any("(4 of 16 missing)" in text for text in drawn)
    data = json.loads((report / "report.json").read_text())["runs"][0]
    assert data["overall"]["L1"]["missing"] == 4
    assert data["ends"] == {"success": 8, "step limit": 4, "missing": 2, "not run": 2}


def test_the_csv_has_them_as_numbers(report: Path) -> None:
    text = (report / "tables" / "tables.csv").read_text()
    read = [r for r in csv.DictReader(text.splitlines()) if r["group"] != "doing nothing"]
    rows = {(r["table"], r["row"]): r for r in read}
    found = rows["sr-tasks", "Pick Blocks Size"]
    shown = [found[name] for name in ("sign", "missing", "worst_case", "best_case")]
    assert shown == ["†", "2", "62.5", "87.5"]
    assert rows["ps-tasks", "Put Bottles Dustbin"]["worst_case"] == "56.25"


def test_a_comparison_knows_its_worst_and_best_case(run: Run, tmp_path: Path) -> None:
    records = outcomes(PICK, 1, [0] * 8) + [record(PUT, 1, seed, 1, 2) for seed in range(8)]
    other = write(tmp_path / "other", records)
    found = compare_results(results_of_run(run, "mine"), results_of_run(other, "other"))
    assert (
        "mine lacks 4 of the trials that both list: over these the difference is +50.0 in the "
        "worst and +75.0 in the best case for mine." in found.notes
    )
    whole = compare_results(results_of_run(other, "other"), results_of_run(other, "again"))
    assert not any("lacks" in note for note in whole.notes)
