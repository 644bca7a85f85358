"""Scores of small runs that can be computed by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fake_runs import trial_record

from robospa.results.paper.columns import published_column
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.scores import Scores, score
from robospa.results.statistics.intervals import METHODS
from robospa.trial import TrialKey

BASE = trial_record(TrialKey("A", 1, 0))


def trial(task: str, category: str, seed: int, done: int, total: int = 1) -> TrialRecord:
    success = done == total
    return replace(
        BASE,
        key=TrialKey(task, 1, seed),
        category=category,
        success=success,
        end="success" if success else "step_limit",
        done=done,
        best=done,
        total=total,
    )


def scores(records: list[TrialRecord], extra: tuple[TrialKey, ...] = ()) -> Scores:
    known = {r.key: r for r in records}
    return score([*known, *extra], known, {"Z": "GAC"})


def values(found: object, metric: str) -> float | None:
    estimate = found.values.get(metric)  # type: ignore[attr-defined]
    return None if estimate is None else estimate.value


def test_onta_and_rate_of_a_spatial_variant() -> None:
    cell = scores([trial("A", "GAC", n, int(n < 3)) for n in range(4)]).cells["A", 1]
    assert values(cell, "sr") == 0.75
    assert values(cell, "onta") == pytest.approx(0.5)
    assert "ps" not in cell.values


def test_progress_is_the_mean_share_of_subtasks_done_at_the_end() -> None:
    records = [trial("B", "OFE", n, done, total=4) for n, done in enumerate((0, 1, 4, 3))]
    cell = scores(records).cells["B", 1]
    assert values(cell, "ps") == pytest.approx(0.5)
    assert values(cell, "sr") == 0.25
    assert "onta" not in cell.values


def test_the_overall_value_is_the_mean_of_categories_not_of_tasks() -> None:
    records = [trial(f"A{n}", "GAC", 0, 1) for n in range(3)] + [trial("B", "SDE", 0, 0)]
    found = scores(records)
    assert values(found.overall[1], "sr") == pytest.approx(0.5)
    assert values(found.dimensions["spatial", 1], "sr") == pytest.approx(0.5)
    assert ("procedural", 1) not in found.dimensions


def test_the_mean_over_levels() -> None:
    easy, hard = trial("A", "GAC", 0, 1), trial("A", "GAC", 0, 0)
    hard = replace(hard, key=replace(hard.key, level=5), candidates=6)
    found = scores([easy, hard])
    assert values(found.tasks["A"], "sr") == 0.5
    assert values(found.categories["GAC", 0], "sr") == 0.5
    assert found.levels == (1, 5)


def test_a_lost_trial_is_missing_and_bounds_the_rate() -> None:
    lost = replace(trial("A", "GAC", 9, 0), end="infrastructure")
    cell = scores([trial("A", "GAC", 0, 1), lost]).cells["A", 1]
    assert (cell.listed, cell.trials, cell.missing) == (2, 1, 1)
    assert values(cell, "sr") == 1.0
    assert (cell.worst, cell.best) == (0.5, 1.0)


def test_a_variant_without_a_result_leaves_the_averages_open() -> None:
    found = scores([trial("A", "GAC", 0, 1)], extra=(TrialKey("Z", 1, 0),))
    assert found.cells["Z", 1].values == {"sr": None, "onta": None}
    assert values(found.categories["GAC", 1], "sr") is None
    assert values(found.overall[1], "onta") is None
    assert (found.overall[1].worst, found.overall[1].best) == (0.5, 1.0)
    assert found.overall[1].missing == 1


def test_onta_is_open_where_candidate_counts_differ() -> None:
    second = replace(trial("A", "GAC", 1, 1), candidates=3)
    cell = scores([trial("A", "GAC", 0, 1), second]).cells["A", 1]
    assert cell.values["onta"] is None


def test_intervals_by_the_chosen_method_leave_all_values_as_they_are() -> None:
    columns = {ci: published_column("RDT", ci=ci).scores for ci in METHODS}
    place = ("MIP", 5)
    values = {ci: scores.categories[place].values["sr"] for ci, scores in columns.items()}
    assert {e.value for e in values.values() if e} == {0.0}
    assert {ci: e.method for ci, e in values.items() if e} == {
        "wilson": "MOVER on Wilson",
        "exact": "MOVER on exact",
        "jeffreys": "MOVER on Jeffreys",
        "bootstrap": "stratified bootstrap",
    }
    point = values["bootstrap"]
    assert point and (point.low, point.high) == (0.0, 0.0)


def test_the_bootstrap_of_an_average_is_the_papers() -> None:
    found = published_column("RDT", ci="bootstrap").scores.overall[5].values["sr"]
    assert found
    assert 100 * found.low == pytest.approx(6.24, abs=0.06)
    assert 100 * found.high == pytest.approx(7.53, abs=0.06)
