"""Grounding and execution: of scripted policies that choose right with probability p and carry that
out with probability q, both are recovered in every category."""

import random
from typing import Any

import pytest
from fake_runs import events, make_run, trial_record

from robospa.results.records.trial_record import TrialRecord
from robospa.results.run import load_run
from robospa.results.scoring.first_choice import first_choice
from robospa.results.scoring.grounding import choices_of, grounding_table, summed, tally_of
from robospa.results.scoring.models import results_of_run
from robospa.results.statistics.intervals import clustered
from robospa.trial import BASIC, CATEGORIES, SPATIAL, TrialKey

Row = tuple[Any, ...]
P, Q, TRIALS, CANDIDATES = 0.7, 0.4, 600, 5
ROLES = {"a": [0], "b": [1], "c": [2], "d": [3], "place": []}


def record(category: str, rows: list[Row], seed: int = 0, **more: Any) -> TrialRecord:
    return trial_record(
        TrialKey("Task", 3, seed),
        category=category,
        events=events(*((2.0 + 2 * n, *row) for n, row in enumerate(rows))),
        success=any(row[0] == "success" for row in rows),
        **{"total": 4, "diagnostics": {"roles": ROLES, "pressed": []}, **more},
    )


def took(name: str) -> Row:
    return ("closed", name, *(ROLES[name] or [-1]), "touching")


def spatial(category: str, rng: random.Random, seed: int) -> TrialRecord:
    right, done = rng.random() < P, rng.random() < Q
    rows = [took("a" if right else "place"), ("dropped", "a", 0)]
    rows += [("subtask_done", "a", 0), ("success", "a")] if done else []
    return record(category, rows, seed, total=1, candidates=CANDIDATES)


def free(category: str, rng: random.Random, seed: int) -> TrialRecord:
    """The first step is done; the next is begun, or the first once more."""
    rows: list[Row] = [took("a"), ("subtask_done", "a", 0)]
    if rng.random() > P:
        rows += [("repeated", "a", 0)] if category == "RPF" else [took("a")]
    else:
        rows += [took("b"), ("subtask_done", "b", 1) if rng.random() < Q else ("dropped", "b", 1)]
    return record(category, rows, seed)


def ordered(category: str, rng: random.Random, seed: int) -> TrialRecord:
    """Two choices: of what is due, which may be missed, or of something whose turn is later."""
    rows: list[Row] = []
    due, names = 0, "abcd"
    for later in (2, 3):
        if rng.random() > P:
            rows.append(("wrong_order", names[later], later))
            continue
        done = rng.random() < Q
        rows.append(("subtask_done" if done else "approached", names[due], due))
        due += 1
    pressed = {"roles": ROLES, "pressed": [*names]}
    return record(category, rows, seed, diagnostics=pressed)


MADE = dict.fromkeys((*SPATIAL, *BASIC), spatial) | {"RPF": free, "OFE": free}


@pytest.mark.parametrize("category", [*CATEGORIES, *BASIC])
def test_p_and_q_are_recovered(category: str) -> None:
    rng, make = random.Random(category), MADE.get(category, ordered)
    found = summed([tally_of(make(category, rng, seed)) for seed in range(TRIALS)])
    forced = 1 if make is free else 0  # the first of two choices is always right and carried out
    right, chosen = forced + (2 - forced) * P, 2
    p, q = right / chosen, (forced + (2 - forced) * P * Q) / right
    if make is spatial:
        p, q = (P - 1 / CANDIDATES) / (1 - 1 / CANDIDATES), Q
    assert found.accuracy and found.execution
    assert found.accuracy.low < p < found.accuracy.high
    assert found.execution.low < q < found.execution.high
    assert found.accuracy.high - found.accuracy.low < 0.11


def test_sr1_is_the_product_of_its_parts() -> None:
    rng = random.Random(1)
    records = [spatial("GAC", rng, seed) for seed in range(50)] + [record("GAC", [], total=1)]
    found = summed([tally_of(r) for r in records])
    assert found.done == sum(map(first_choice, records))
    assert (found.trials, found.chosen) == (51, 50)
    assert found.no_choice and found.no_choice.value == 1 / 51


@pytest.mark.parametrize(
    ("category", "rows", "expected"),
    [
        ("GAC", [("closed", "a", 0, "beside"), ("approached", "place")], ""),
        ("GAC", [took("place"), took("a"), ("success", "a")], "place-"),
        ("GAC", [("wrong_object", "place"), took("a")], "place-"),
        ("OFE", [took("place"), took("a"), ("dropped", "a", 0), ("grasped", "a")], "a"),
        ("OFE", [("closed", "a", 0, "beside"), took("b"), ("subtask_done", "b", 1)], "a b+"),
        ("OCE", [took("b"), took("a"), ("subtask_done", "a", 0)], "b- a+"),
        ("OCE", [took("a"), took("b"), ("subtask_done", "b", 1)], "a b+"),
        ("MIP", [took("place"), took("a")], "place- a"),
        ("CAC", [took("a"), ("wrong_order", "b", 1), ("subtask_done", "b", 1)], "a b+"),
        ("CAC", [("wrong_order", "b", 1), ("subtask_done", "b", 1)], "b-"),
    ],
)
def test_choices(category: str, rows: list[Row], expected: str) -> None:
    made = choices_of(record(category, rows))
    signs = ["+" if one.done else "" if one.right else "-" for one in made]
    assert " ".join(c.object + sign for c, sign in zip(made, signs, strict=True)) == expected


def test_what_holds_from_the_start_is_no_choice_and_a_tool_is_chosen_once() -> None:
    given = events((0.0, "subtask_done", "a", 0))
    assert tally_of(trial_record(category="OCE", total=2, events=given))[:2] == (1, 0)
    roles = {"tool": [0, 1], "a": [], "b": []}
    rows: list[Row] = [("grasped", "tool"), ("subtask_done", "a", 0), ("subtask_done", "b", 1)]
    used = record("OCE", rows, total=2, diagnostics={"roles": roles, "pressed": ["a", "b"]})
    assert tally_of(used)[:4] == (2, 2, 2, 2)


def test_what_a_trial_has_in_common_widens_the_interval() -> None:
    alike, apart = clustered([(3, 3), (0, 3)] * 20), clustered([(1, 1), (0, 1)] * 60)
    assert alike and apart and clustered([(0, 0)]) is None
    assert alike.value == apart.value == 0.5
    assert alike.high - alike.low > 1.6 * (apart.high - apart.low)


def test_a_run_has_them_as_a_table_and_by_level(tmp_path: Any) -> None:
    rng = random.Random(2)
    run = make_run(tmp_path / "run", [spatial("GAC", rng, seed) for seed in range(20)])
    loaded = load_run(run.folder)
    whole = loaded.grounding()["spatial", 0]
    assert loaded.grounding()["GAC", 3] == whole and whole.chosen == 20
    table = grounding_table([results_of_run(loaded)])
    assert table and [row.label[:3] for row in table.rows] == ["GAC", "spa"]
    assert table.rows[0].cells[-1].text == "20"
    said = f"spatial: {whole.right} of 20 choices were right, and {whole.done} of"
    assert said in table.notes[1] and "for 0 of 20 steps nothing" in table.notes[1]
