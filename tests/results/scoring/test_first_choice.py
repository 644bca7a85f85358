"""What counts as a first choice, from events written by hand."""

from typing import Any

import pytest
from fake_runs import events, trial_record

from robospa.results.scoring.first_choice import first_choice
from robospa.trial import TrialKey

Row = tuple[Any, ...]
PICK = {"target": [0], "other": []}
STEPS = {"can": [0, 2], "bread": [1], "basket": []}
LIFTED: list[Row] = [(5.0, "closed", "target", 0, "touching"), (5.1, "grasped", "target", 0)]
IN_TURN: list[Row] = [(1.0, "subtask_done", "can", 0), (2.0, "subtask_done", "bread", 1)]
EARLY = (1.0, "wrong_order", "bread", 1)
NEAR_CAN = (1.5, "approached", "can", 0)


def chosen(
    category: str,
    rows: list[Row],
    roles: dict[str, list[int]] = STEPS,
    task: str = "Task",
    success: bool = True,
    **diagnostics: object,
) -> bool:
    return first_choice(
        trial_record(
            TrialKey(task, 3, 1),
            category=category,
            success=success,
            total=3,
            events=events(*rows),
            diagnostics={"roles": roles, **diagnostics},
        )
    )


@pytest.mark.parametrize(
    ("before", "expected"),
    [
        ([], True),
        ([(1.0, "closed", "other", -1, "beside")], True),
        ([(1.0, "approached", "other", -1)], True),
        ([(1.0, "dropped", "target", 0)], True),
        ([(1.0, "closed", "other", -1, "touching")], False),
        ([(1.0, "grasped", "other", -1)], False),
        ([(1.0, "wrong_object", "other", -1)], False),
    ],
)
@pytest.mark.parametrize("category", ["GAC", "CBG"])
def test_nothing_else_is_taken_before_the_target(
    category: str, before: list[Row], expected: bool
) -> None:
    assert chosen(category, before + LIFTED, PICK) is expected
    assert not chosen(category, before + LIFTED, PICK, success=False)


@pytest.mark.parametrize(
    ("category", "rows", "expected"),
    [
        ("OFE", IN_TURN, True),
        ("OFE", [*IN_TURN, (3.0, "dropped", "can", 0), (4.0, "closed", "can", 0, "beside")], True),
        ("OFE", [(0.5, "closed", "basket", -1, "touching"), *IN_TURN], True),
        ("MIP", [(0.5, "closed", "basket", -1, "touching"), *IN_TURN], False),
        ("OCE", [(0.5, "wrong_object", "basket", -1), *IN_TURN], False),
        ("OFE", [(0.5, "closed", "bread", 1, "touching"), *IN_TURN], True),
        ("OCE", [(0.5, "closed", "bread", 1, "touching"), *IN_TURN], False),
        ("OCE", [EARLY, *IN_TURN], False),
        ("MIP", [EARLY, *IN_TURN], False),
        ("RPF", [*IN_TURN, (3.0, "repeated", "can", 0)], False),
        ("OFE", [*IN_TURN, (3.0, "grasped", "bread", 1)], False),
    ],
)
def test_no_step_is_wrong_early_or_repeated(category: str, rows: list[Row], expected: bool) -> None:
    assert chosen(category, rows) is expected


def test_memory_without_an_order_in_the_sentence_has_nothing_too_early() -> None:
    assert chosen("MIP", [EARLY, *IN_TURN], task="Remember_Orientation_Restore", out_of_order=1)
    assert not chosen("MIP", IN_TURN, task="Press_Stapler_Memory", out_of_order=1)


@pytest.mark.parametrize(
    ("rows", "pressed", "expected"),
    [
        ([EARLY, NEAR_CAN, *IN_TURN], ["bread"], True),
        ([EARLY, *IN_TURN], ["bread"], False),
        ([EARLY, NEAR_CAN, *IN_TURN], [], False),
    ],
)
def test_a_press_in_passing_is_no_choice(
    rows: list[Row], pressed: list[str], expected: bool
) -> None:
    assert chosen("CAC", rows, pressed=pressed) is expected
