"""Failure types from events written by hand: one rule a test."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from fake_runs import events, trial_record

from robospa.results.failures.labels import counts_table, distribution, label
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import BASIC, TrialKey

Row = tuple[Any, ...]
PICK = {"target": [0], "other": []}
TOUCHED = (4, "closed", "target", 0, "touching")
TOWER = {"a": [0], "b": [1], "c": [2]}
CLICKS = {"can": [0, 2], "bread": [1], "basket": []}


def failed(
    category: str,
    rows: Sequence[Row],
    roles: Mapping[str, list[int]] = PICK,
    end: str = "step_limit",
    seed: int = 1,
) -> TrialRecord:
    """A failed trial of a category with these events."""
    return trial_record(
        TrialKey(f"Task_{category}", 3, seed),
        category=category,
        end=end,
        total=3,
        events=events(*rows),
        diagnostics={"roles": roles},
    )


def kind(record: TrialRecord) -> str:
    found = label(record)
    assert found is not None
    return found.kind


# -- what is no failure, and what needs no events ----------------------------------------------


def test_a_lost_trial_is_no_failure_of_the_policy() -> None:
    assert label(failed("GAC", [], end="infrastructure")) is None


def test_an_answer_that_cannot_be_executed_has_its_own_type() -> None:
    assert kind(failed("GAC", [], end="policy_error")) == "invalid_action"


# -- spatial -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([(2, "closed", "other", -1, "touching")], "target_grounding"),
        ([(2, "grasped", "other")], "target_grounding"),
        ([(2, "closed", "target", 0, "touching")], "target_execution"),
        ([(2, "grasped", "target"), (3, "dropped", "target")], "target_execution"),
        ([(2, "closed", "target", 0, "beside")], "no_contact_grasp"),
        ([(2, "closed", "other", -1, "beside")], "no_contact_grasp"),
        ([(2, "approached", "target", 0)], "target_execution"),
        ([(2, "approached", "other")], "target_grounding"),
        ([(2, "wrong_object", "other")], "target_grounding"),
        # a touch says more than a miss before it, and the first touch is the choice
        ([(2, "closed", "other", -1, "beside"), TOUCHED], "target_execution"),
        ([(2, "closed", "other", -1, "touching"), TOUCHED], "target_grounding"),
    ],
)
def test_spatial_rules(rows: list[Row], expected: str) -> None:
    assert {kind(failed(category, rows)) for category in ("CVR", *BASIC)} == {expected}


def test_collisions_with_clutter_change_no_type() -> None:
    """Not even by their number: what belongs to one attempt is looked for among the events next to
    it."""
    knocked = [(2.1, "clutter_moved", f"clutter_{i}") for i in range(10)]
    for category, rows in (
        ("CVR", [(2, "closed", "target", 0, "touching"), (5, "dropped", "target")]),
        ("OCE", [(2.0, "grasped", "a"), (2.2, "closed", "a", 0, "touching")]),
    ):
        roles = PICK if category == "CVR" else TOWER
        without, among = (
            failed(category, rows, roles),
            failed(category, [rows[0], *knocked, *rows[1:]], roles),
        )
        assert label(without) == label(among)
    nothing = label(failed("GAC", knocked))
    assert nothing is not None and nothing.kind == "no_attempt"


# -- procedural --------------------------------------------------------------------------------

STAPLER, POT = {"stapler": [0, 1, 2]}, {"pot": [0, 1, 2]}
LIFTED = [(1, "grasped", "pot"), (2, "subtask_done", "pot", 0), (4, "grasped", "pot")]
BOTTOM = (0, "subtask_done", "a", 0)
NEXT = [BOTTOM, (3, "subtask_done", "b", 1)]
UNDONE = [*NEXT, (5, "subtask_undone", "b", 1)]
OPENED = (5, "subtask_done", "a", 0)
CAN = (2, "subtask_done", "can", 0)


@pytest.mark.parametrize(
    ("category", "roles", "rows", "expected"),
    [
        ("OCE", TOWER, [BOTTOM, (3, "closed", "b", 1, "beside")], "manipulation"),
        ("OCE", TOWER, [BOTTOM, (3, "closed", "b", 1, "touching")], "manipulation"),
        ("OCE", TOWER, [BOTTOM, (3, "grasped", "b"), (4, "dropped", "b")], "manipulation"),
        ("OCE", TOWER, [BOTTOM, (3, "grasped", "b")], "manipulation"),
        ("OCE", TOWER, [BOTTOM, (3, "grasped", "c")], "temporal_ordering"),
        ("OCE", TOWER, [BOTTOM, (3, "grasped", "b"), (9, "grasped", "a")], "temporal_ordering"),
        ("OFE", TOWER, [(3, "grasped", "c"), (4, "dropped", "c")], "manipulation"),
        ("OCE", TOWER, NEXT, "no_attempt"),
        ("OCE", TOWER, [*NEXT, (5, "grasped", "b")], "redundant_repetition"),
        # a miss does not make what comes next an error of order
        ("OCE", TOWER, [BOTTOM, (3, "closed", "b", 1, "beside"), (9, "grasped", "c")],
         "manipulation"),
        # an undone subtask: by a collapse, or because its object was taken again
        ("OCE", TOWER, UNDONE, "manipulation"),
        ("OCE", TOWER, [*UNDONE, (5.3, "closed", "b", 1, "touching"), (5.4, "grasped", "b")],
         "redundant_repetition"),
        ("MIP", TOWER, [(3, "cue_hidden"), (5, "grasped", "b")], "memory"),
        ("MIP", TOWER, [(1, "failed", "", -1, "moved before")], "temporal_ordering"),
        ("MIP", TOWER, [(5, "wrong_order", "b", 1), (5, "failed", "b", 1, "opened too early")],
         "memory"),
        ("MIP", TOWER, [OPENED, (9, "closed", "a", 0, "touching"),
                        (9, "failed", "a", 0, "opened cover taken again")], "redundant_repetition"),
        ("MIP", TOWER, [OPENED, (9, "failed", "a", 0, "opened cover moved away")], "manipulation"),
        ("CAC", CLICKS, [CAN, (3, "repeated", "can", 2)], "redundant_repetition"),
        ("CAC", CLICKS, [CAN, (3, "wrong_order", "can", 2)], "redundant_repetition"),
        ("CAC", CLICKS, [(3, "wrong_order", "bread", 1)], "temporal_ordering"),
        ("CAC", CLICKS, [(3, "closed", "basket", -1, "touching")], "target_grounding"),
        # order is not enforced there: what was done badly weighs more
        ("CAC", CLICKS, [(3, "wrong_order", "can", 2), (6, "grasped", "bread"),
                         (7, "dropped", "bread")], "manipulation"),
        ("RPF", STAPLER, [(2, "approached", "stapler", 0)], "manipulation"),
        ("RPF", STAPLER, [(2, "approached", "stapler", 0), (3, "subtask_done", "stapler", 0)],
         "no_attempt"),
        # a harmless repetition is forgiven by progress
        ("CAC", CLICKS, [CAN, (3, "repeated", "can", 2), (6, "subtask_done", "can", 2),
                         (9, "grasped", "bread"), (10, "dropped", "bread")], "manipulation"),
        # taking a thing again that is needed again is no repetition
        ("RPF", POT, [*LIFTED, (5, "dropped", "pot")], "manipulation"),
        ("RPF", POT, LIFTED, "manipulation"),
        ("RPF", POT, [*LIFTED[:2], (3, "subtask_done", "pot", 1), (4, "subtask_done", "pot", 2),
                      (6, "grasped", "pot")], "redundant_repetition"),
    ],
)  # fmt: skip
def test_procedural_rules(
    category: str, roles: dict[str, list[int]], rows: list[Row], expected: str
) -> None:
    assert kind(failed(category, rows, roles)) == expected


def test_a_mistake_that_was_put_right_is_not_the_root() -> None:
    rows = [
        BOTTOM,
        (3, "grasped", "b"),
        (4, "dropped", "b"),
        (9, "subtask_done", "b", 1),
        (12, "closed", "c", 2, "beside"),
    ]
    found = label(failed("OCE", rows, TOWER))
    assert found is not None
    assert (found.kind, found.time) == ("manipulation", 12.0)


def test_closing_for_a_press_is_no_failed_grasp() -> None:
    rows = [
        (1, "closed", "bread", 1, "beside"),
        (2, "subtask_done", "can", 0),
        (3, "repeated", "can", 2),
    ]
    record = failed("CAC", rows, CLICKS)
    assert kind(record) == "manipulation"
    told = {**record.diagnostics, "pressed": ["can"]}
    assert kind(replace(record, diagnostics=told)) == "redundant_repetition"


# -- counts ------------------------------------------------------------------------------------


RUN = [
    failed("GAC", [(2, "grasped", "other")], seed=1),
    failed("GAC", [(2, "grasped", "other")], seed=2),
    failed("GAC", [], seed=3),
    failed("GAC", [], end="infrastructure", seed=4),
    failed("OCE", [(2, "dropped", "b")], TOWER, seed=1),
]


def test_counts_leave_out_what_is_no_failure() -> None:
    assert distribution(RUN, "category") == {
        "GAC": {"target_grounding": 2, "no_attempt": 1},
        "OCE": {"manipulation": 1},
    }


def test_counts_by_variant_and_as_a_table() -> None:
    assert distribution(RUN, "variant")["Task_OCE L3"] == {"manipulation": 1}
    first, *_ = counts_table(distribution(RUN), "task").rows
    assert (first.label, [cell.text for cell in first.cells]) == ("Task_GAC", ["3", "2", "0", "1"])
