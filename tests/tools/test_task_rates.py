"""The table of every task's rates holds several runs, and progress beside that of doing nothing."""

from __future__ import annotations

import dataclasses

from fake_runs import record
from task_rates import task_rates

from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.scores import Scores, score

GIVEN = ({"time": 0.0, "kind": "subtask_done", "object": "a", "index": 0},)


def scores(*records: TrialRecord) -> Scores:
    return score([r.key for r in records], {r.key: r for r in records})


def test_a_row_a_task() -> None:
    put = record("Put_Bottles_Dustbin", 1, 0, 2, 4)
    pick = record("Pick_Blocks_Size", 1, 0, 1)
    first = scores(dataclasses.replace(put, events=GIVEN), pick)
    table = task_rates({"a": first, "b": scores(pick)})
    rows = {row.label: [cell.text for cell in row.cells] for row in table.rows if row.cells}
    assert rows == {
        "Pick_Blocks_Size": ["100", "100", "", "1", "100", "100", "", "1", ""],
        "Put_Bottles_Dustbin": ["0", "0", "50", "1", "", "", "", "", "25"],
    }
