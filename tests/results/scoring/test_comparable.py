"""Scores over the trials that compare: by lead, by gap, asked again after the cue was hidden."""

import math
from pathlib import Path
from typing import Any

import pytest
from fake_runs import make_run, record, run_of, trial_record

from robospa.results.records.runs import Run, from_line, to_line
from robospa.results.records.trial_record import RetryRow, TrialRecord, query_entries
from robospa.results.report.page import write_report
from robospa.results.report.report import make_report
from robospa.results.report.run_card import facts
from robospa.results.scoring.comparable import comparable_table, executed_chunks
from robospa.results.scoring.models import results_of_run
from robospa.results.scoring.repeats import (
    FaultRate,
    fault_rates,
    many_policy_errors,
    policy_error_lines,
    repeat_lines,
    repeats_text,
    worst_case,
)
from robospa.trial import TrialKey

CVR, SDE, MIP = "Pick_Seals_Multi_View", "Pick_Mugs_Distance", "Remember_Color_Cover"


def led(task: str, level: int, seed: int, success: int, lead: object) -> TrialRecord:
    category = "CVR" if task == CVR else "SDE"
    return record(task, level, seed, success, category=category, diagnostics={"lead": lead})


def remembered(seed: int, success: int, asked: list[int], hidden: int | None) -> TrialRecord:
    """A memory trial of 40 actions, whose policy was asked at these and whose cue was hidden."""
    events = [{"time": 0.0, "kind": "cue_hidden", "object": "", "index": -1, "step": hidden}]
    return record(
        *(MIP, 3, seed, success),
        category="MIP",
        steps=40,
        events=events if hidden is not None else (),
        diagnostics=query_entries(asked, 40),
    )


RECORDS = [
    *(led(CVR, 1, n, 1, 0.0601) for n in range(3)),
    led(CVR, 1, 3, 0, 0.06),  # not more than officially
    *(led(CVR, 5, n, int(n < 1), 0.02 if n else 0.2) for n in range(4)),
    led(CVR, 5, 4, 0, None),  # not known
    *(led(SDE, 2, n, n, 0.05 + 0.02 * n) for n in range(2)),
    remembered(0, 1, [0], 10),  # all of it from what it saw at reset
    remembered(1, 1, [0, 16, 32], 10),
    remembered(2, 0, [0, 10, 26], 10),
    remembered(3, 0, [0, 16], None),  # moved before
]
"""CVR L1: 3 of 4, led 3 of 3; L5: 1 of 5, led 1 of 1; SDE L2: 1 of 2, apart 1 of 1; MIP L3: 2 of 4,
asked again 1 of 2."""


@pytest.fixture
def run(tmp_path: Path) -> Any:
    return make_run(tmp_path / "run", RECORDS)


def test_rates_over_the_trials_that_compare_stand_beside_those_over_all(run: Any) -> None:
    table = comparable_table([results_of_run(run, "mine")])
    assert table is not None
    found = {}
    for row in table.rows:
        if row.kind == "section":
            category = row.label[:3]
        else:
            found[category, row.label] = row.cells
    values = {place: tuple(cell.value for cell in cells[:5]) for place, cells in found.items()}
    assert values == {
        ("SDE", "L2"): (50, 50, 100, 100, 1),
        ("SDE", "mean"): (50, 50, 100, 100, 1),
        ("CVR", "L1"): (75, 75, 100, 100, 3),
        ("CVR", "L5"): (20, 20, 100, 100, 1),
        ("CVR", "mean"): (47.5, 47.5, 100, 100, 4),
        ("MIP", "L3"): (50, 50, 50, 50, 2),
        ("MIP", "mean"): (50, 50, 50, 50, 2),
    }
    assert found["CVR", "L5"][4].text == "1 of 5"
    assert found["MIP", "L3"][5].text == "16 [10, 40]"
    assert found["CVR", "L1"][2].low == pytest.approx(43.85, abs=0.01)  # Wilson, 3 of 3


@pytest.mark.usefixtures("no_figures")
def test_the_table_is_in_all_that_a_report_writes(run: Any, tmp_path: Path) -> None:
    folder = write_report(make_report(run), tmp_path / "report")
    for name in ("report.html", "report.md", "tables/tables.csv", "tables/comparable.tex"):
        text = (folder / name).read_text()
        assert "leads by more than 6 cm" in text and "16 [10, 40]" in text.replace("\\", ""), name
    assert run.comparable().cells[CVR, 5].values["sr"].value == 1.0
    frame = run.to_pandas()
    assert frame.lead.max() == 0.2 and frame.asked_again.sum() == 2


def test_where_no_trial_compares_the_chunks_are_told_all_the_same(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [remembered(n, 1, [0], 10) for n in range(2)])
    table = comparable_table([results_of_run(run)])
    assert table is not None
    assert [c.text for c in table.rows[1].cells] == [*["–"] * 4, "0 of 2", "40 [40, 40]"]


def test_other_categories_and_older_records_have_no_table(tmp_path: Path) -> None:
    records = [record("Pick_Blocks_Size", 1, 0, 1), record(SDE, 1, 0, 1)]
    assert comparable_table([results_of_run(make_run(tmp_path / "run", records))]) is None


@pytest.mark.parametrize(
    ("asked", "steps", "lengths"),
    [
        ((), 0, {}),
        ((0,), 12, {12: 1}),  # cut off, but the only one
        ((0, 16, 32), 40, {16: 2}),
        ((0, 16, 32), 48, {16: 2}),
        (range(100), 100, {1: 99}),
        ((0, 4, 12, 16), 17, {4: 2, 8: 1}),
    ],
)
def test_chunks_are_what_was_executed_between_two_queries(
    asked: Any, steps: int, lengths: dict[int, int]
) -> None:
    entries = query_entries(asked, steps)
    made = record(MIP, 1, 0, 0, steps=steps, diagnostics=entries)
    assert executed_chunks(made) == lengths


@pytest.mark.parametrize("entry", [None, 7, "16", {"x": 1}, {"16": "many"}, {"16": math.nan}])
def test_what_is_no_count_of_chunks_counts_nothing(entry: object) -> None:
    made = record(MIP, 1, 0, 0, diagnostics={"chunks": entry, "last_query": 0, "lead": entry})
    assert not executed_chunks(made)


# ------------------------- repeated trials are counted, and the worst that they may hide is bounded


LOST = RetryRow("connection_lost", "the line went dead", 7)
AWAY = RetryRow("unreachable", "nobody listens")


def key(seed: int, level: int = 1) -> TrialKey:
    return TrialKey("Pick_Fake", level, seed)


def made(*records: TrialRecord) -> Run:
    return run_of(records)


def test_retries_survive_the_file_and_old_lines_have_none() -> None:
    record = trial_record(retries=(AWAY, LOST), attempts=3)
    assert from_line(to_line(record)) == record
    old = to_line(trial_record(attempts=3)).replace('"retries":[],', "")
    assert "retries" not in old
    assert from_line(old) == trial_record(attempts=3)


def test_in_the_worst_case_every_repeated_trial_had_failed() -> None:
    run = made(
        trial_record(key(1), True),
        trial_record(key(2), True, retries=(LOST,), attempts=2),
        trial_record(key(3), True, retries=(AWAY,), attempts=2),
        trial_record(key(4), False, retries=(LOST,), attempts=2),
    )
    cell = worst_case(run).cells["Pick_Fake", 1]
    assert (cell.successes, cell.firsts) == (2, 2)


def test_rates_are_given_over_all_levels_and_for_each() -> None:
    run = made(
        trial_record(key(1), True, retries=(LOST, LOST), attempts=3),
        trial_record(key(2), end="policy_error"),
        trial_record(key(3, 2), True),
        trial_record(key(4, 2), end="infrastructure", retries=(LOST,)),
    )
    assert fault_rates(run.records.values()) == [
        FaultRate(0, 3, 1, 2, 1),
        FaultRate(1, 2, 1, 2, 1),
        FaultRate(2, 1, 0, 0, 0),
    ]


def test_policy_errors_are_grouped_without_their_numbers() -> None:
    errors = [
        trial_record(key(n), end="policy_error", message=f"nan in action {n}") for n in range(3)
    ]
    other = trial_record(key(9), end="policy_error", message="no camera")
    found = policy_error_lines(made(other, *errors))
    assert found == [
        "policy errors 4 of 4 (100.0 %; L1 100.0 %)",
        "policy error 3: nan in action 0",
        "policy error 1: no camera",
    ]
    card = dict(facts(made(other, *errors)))
    assert card["policy errors"].endswith("L1 100.0 %); 3 nan in action 0; 1 no camera")
    assert policy_error_lines(made(trial_record())) == []


def test_half_of_all_trials_in_policy_errors_is_a_failed_run() -> None:
    error, sound = trial_record(key(1), end="policy_error"), trial_record(key(2))
    assert "1 of 2 trials ended in a policy error" in many_policy_errors(made(error, sound))
    assert many_policy_errors(made(error, sound, trial_record(key(3)))) == ""
    assert many_policy_errors(made()) == ""


def test_repeated_trials_are_told_with_level_cause_and_worst_case() -> None:
    run = made(
        trial_record(key(1), True, retries=(LOST, LOST), attempts=3),
        trial_record(key(2), True),
        trial_record(key(3, 3)),
    )
    assert repeats_text(run) == "1 of 3 (33.3 %; L1 50.0 %): 2 connection lost"
    (line,) = repeat_lines(run)
    assert (
        "1 of 3 trials would be successes instead of 2, 1 by the first choice instead of 2" in line
    )
    assert repeat_lines(made(trial_record())) == []


def test_attempts_of_an_older_version_have_no_cause() -> None:
    assert repeats_text(made(trial_record(attempts=2))).endswith(": 1 unknown (an older version)")
