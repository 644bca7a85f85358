"""Each rule of lint finds what it is for, and nothing in a clean run."""

import builtins
import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_runs import events, make_run, outcomes, record, shown, trial_record, write

from robospa.extras import MissingPackage
from robospa.results.failures.labels import FailedTrials
from robospa.results.lint import Finding, lint_faults, lint_published, lint_run, lint_runs
from robospa.results.records.runs import Run, read_run, to_line
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.run import trial_columns
from robospa.trial import TrialKey

SIZE, MUGS, BOTTLES = "Pick_Blocks_Size", "Pick_Mugs_Distance", "Put_Bottles_Dustbin"


def rules(found: list[Finding]) -> list[str]:
    return [f.rule for f in found]


def linted(folder: Path, *records: TrialRecord, **more: Any) -> list[Finding]:
    return lint_run(write(folder / "run", records, **more))


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"wall_time": 1e-5}, "too-fast"),
        ({"physics_steps": 3}, "fewer-steps"),
        ({"done": 5}, "progress-range"),
        ({"done": 0}, "ps-below-sr"),
        ({"end": "step_limit"}, "end-and-success"),
        ({"candidates": 9}, "mixed-candidates"),
        ({"total": 3, "done": 3}, "mixed-totals"),
        ({"category": "SDE"}, "mixed-categories"),
        ({"scene_digest": "scene Pick_Blocks_Size10"}, "same-scene"),
        ({"actions_digest": "actions Pick_Blocks_Size10 1"}, "same-actions"),
        ({"digest": "end Pick_Blocks_Size10 1 "}, "same-end-state"),
    ],
)
def test_one_wrong_trial_is_found(tmp_path: Path, change: dict[str, Any], rule: str) -> None:
    good, bad = outcomes(SIZE, 1, [1, 1])
    found = linted(tmp_path, good, replace(bad, **change))
    assert rules(found) == [rule]
    assert "Pick_Blocks_Size" in str(found[0])


def test_shared_actions_are_said_once_and_only_where_scenes_differ(tmp_path: Path) -> None:
    alike = [replace(r, actions_digest="a") for r in outcomes(SIZE, 1, [1, 1, 0])]
    copied = [replace(r, actions_digest="a", digest="d") for r in outcomes(SIZE, 2, [1, 1])]
    (found,) = linted(tmp_path / "one", *alike)
    assert found.rule == "same-actions" and len(found.text) < 150
    assert found.text.startswith("3 trials have the actions of another scene, such as Pick_Blocks")
    assert rules(linted(tmp_path / "two", *copied)) == ["same-end-state"]

    for name, value in (("split", "train"), ("mode", "random"), ("embodiment", "piper")):
        other = replace(alike[0], key=replace(alike[0].key, **{name: value}))  # type: ignore[arg-type]
        assert rules(linted(tmp_path / name, alike[0], other)) == ["mixed-suites"]
    levels = [replace(r, actions_digest="a", digest="d")
              for level in (1, 2) for r in outcomes(SIZE, level, [1])]  # fmt: skip
    assert linted(tmp_path / "levels", *levels) == []


def test_a_privileged_policy_may_repeat_itself(tmp_path: Path) -> None:
    alike = [replace(r, actions_digest="a") for r in outcomes(SIZE, 1, [1, 1, 0])]
    assert linted(tmp_path, *alike, settings={"privileged": True}) == []


def test_missing_trials_are_counted_and_named(tmp_path: Path) -> None:
    lost = record(SIZE, 1, 1, 0, end="infrastructure")
    owed = TrialKey(SIZE, 1, 2)
    (found,) = linted(tmp_path, record(SIZE, 1, 0, 1), lost, also_listed=[owed])
    assert found.rule == "missing"
    assert found.text.startswith("2 of 3 trials have no result: Pick_Blocks_Size-L1-1-")


def test_trials_listed_twice_or_not_at_all(tmp_path: Path) -> None:
    first = record(SIZE, 1, 0, 1)
    assert rules(linted(tmp_path / "a", first, also_listed=[first.key])) == ["listed-twice"]
    run = write(tmp_path / "b", outcomes(SIZE, 1, [1, 0]))
    assert rules(lint_run(replace(run, keys=run.keys[:1]))) == ["not-listed"]


def test_variants_that_do_not_exist(tmp_path: Path) -> None:
    run = write(tmp_path / "a", outcomes("Pick_Moon", 1, [1, 0]))
    assert lint_run(run, {(SIZE, 1)})[0].text == "Pick_Moon L1 not among the benchmark's variants"


def test_torn_and_repeated_records(tmp_path: Path) -> None:
    records = outcomes(SIZE, 1, [1, 0])
    run = write(tmp_path / "a", records)
    again = tmp_path / "a" / "trials" / "0001.jsonl"
    again.write_text(to_line(records[0]) + to_line(records[1])[:50])
    assert rules(lint_run(read_run(run.folder))) == ["torn-line", "recorded-twice"]


def test_tasks_with_the_same_results(tmp_path: Path) -> None:
    rows = [(1, [1, 1, 1, 0]), (2, [1, 1, 0, 0]), (3, [1, 0, 0, 0])]
    records = [r for task in (SIZE, MUGS) for n, k in rows for r in outcomes(task, n, k)]
    (found,) = linted(tmp_path, *records)
    assert found.rule == "identical-rows"
    assert "Pick_Blocks_Size and Pick_Mugs_Distance" in found.text


@pytest.mark.parametrize(
    ("records", "found"),
    [
        (outcomes(SIZE, 1, [1, 0, 1]) + [record(BOTTLES, 2, n, 1, 2) for n in range(3)], []),
        (outcomes(SIZE, 1, [1, 0]) + outcomes(SIZE, 2, [1]), ["unequal-trials"]),
        # few successes may agree by chance, and few failures
        ([r for task in (SIZE, MUGS) for n in (1, 2) for r in outcomes(task, n, [1, 0])], []),
        (
            [
                r
                for task in (SIZE, MUGS)
                for n in (1, 2, 3)
                for r in outcomes(task, n, [0] * n + [1] * (60 - n))
            ],
            [],
        ),
    ],
)
def test_whole_runs(tmp_path: Path, records: list[TrialRecord], found: list[str]) -> None:
    assert rules(linted(tmp_path, *records)) == found


def test_the_paper() -> None:
    found = lint_published()
    assert lint_published() == found
    assert sorted(rules(found)) == sorted(["identical-rows"] * 2 + ["ps-not-a-share"] * 6)
    same = [f.text for f in found if f.rule == "identical-rows"]
    assert [f.where for f in found if f.rule == "identical-rows"] == ["RDT", "RDT"]
    assert same[0].startswith("Lift_Fan_Repeat and Place_Object_Scale_Click")
    assert same[1].startswith("Rank_Blocks_Size and Click_Bell_Clockwise_Order")


def test_runs_that_do_not_belong_in_one_table(tmp_path: Path) -> None:
    one, two = (
        write(tmp_path / name, [record(SIZE, 1, 0, 1)], about={"versions": {"robospa": name}})
        for name in ("a", "b")
    )
    assert rules(lint_runs([one, two])) == ["mixed-versions"]
    other = replace(record(SIZE, 1, 0, 1), key=TrialKey(SIZE, 1, 0, "piper"))
    three = write(tmp_path / "c", [other], about={"versions": {"robospa": "a"}})
    assert rules(lint_runs([one, three])) == ["mixed-suites"]
    assert lint_runs([one, one]) == []


LOST = {"retries": (RetryRow("deadline"),), "attempts": 2}


def results(count: int, repeated: int, level: int = 1) -> list[TrialRecord]:
    return [
        trial_record(TrialKey("Pick_Fake", level, n), **(LOST if n < repeated else {}))
        for n in range(count)
    ]


def severities(records: list[TrialRecord]) -> list[str]:
    return [finding.severity for finding in lint_faults(records, "run")]


@pytest.mark.parametrize(
    ("count", "repeated", "found"),
    [
        (1000, 2, []),
        (1000, 3, ["warning"]),
        (1000, 10, ["warning"]),
        (1000, 11, ["error"]),
        (24, 2, ["warning"]),
        (24, 3, ["error", "error"]),  # of the run and of the level
    ],
)
def test_repeated_trials_are_bounded(count: int, repeated: int, found: list[str]) -> None:
    assert severities(results(count, repeated)) == found


def test_one_crash_of_a_server_is_no_error_of_its_level() -> None:
    sound = [r for level in (2, 3, 4, 5) for r in results(560, 0, level)]
    assert severities([*results(560, 16), *sound]) == ["warning"]
    assert severities([*results(560, 18), *sound]) == ["error"]


def test_many_policy_errors_ask_for_a_look_and_name_the_reason() -> None:
    broken = [
        trial_record(TrialKey("Pick_Fake", 1, n), end="policy_error", message=f"nan in {n}")
        for n in range(3)
    ]
    (finding,) = lint_faults([*results(50, 0)[10:], *broken], "run")
    assert str(finding) == (
        "warning: run: 3 of 43 trials ended in a policy error, 3 of them: nan in 0 [policy-errors]"
    )
    assert severities([*results(100, 0)[10:], *broken]) == []


@pytest.mark.parametrize(
    ("others", "reads", "found"),
    [(0, 30, ""), (3, 27, ""), (12, 18, "12 of 30"), (27, 3, "guessing gives 6")],
)
def test_successes_after_other_choices(tmp_path: Path, others: int, reads: int, found: str) -> None:
    records = outcomes(SIZE, 1, [1] * (others + reads), candidates=5)
    took = [replace(r, events=events((1.0, "grasped", "other"))) for r in records[:others]]
    run = linted(tmp_path, *took, *records[others:])
    assert [f.rule for f in run] == ["after-other-choices"] * bool(found)
    assert all(found in f.text for f in run)
    assert ("guessing" in "".join(f.text for f in run)) == (reads == 3)


# --------- what a run shows of itself in Python: a table, a data frame, failures, a notebook's view


WRONG = shown(
    *("Pick_It", 2, 8, False),
    events=events((1.5, "grasped", "object_2")),
    diagnostics={
        "roles": {},
        "objects": {"object_2": "the <small> cube"},
        "unreachable_actions": 6,
        "first_unreachable": "the left arm cannot reach it",
    },
)
ROWS = [shown("Pick_It", 1, 7, True), WRONG, shown("Pick_It", 2, 9, False, end="infrastructure")]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return make_run(tmp_path / "run", ROWS, lost=1)


def test_a_row_for_every_listed_trial_and_nothing_said_of_those_without_a_result(run: Run) -> None:
    columns = trial_columns(run)
    assert {len(column) for column in columns.values()} == {4}

    def of(name: str) -> dict[Any, Any]:
        return dict(zip(columns["seed"], columns[name], strict=True))

    assert of("end") == {7: "success", 8: "step_limit", 9: "infrastructure", 900: "not run"}
    assert of("success") == {7: True, 8: False, 9: None, 900: None}
    assert of("failure")[8] == "target grounding" and "the <small> cube" in of("evidence")[8]
    assert of("unreachable_actions")[8] == 6 and of("progress")[7] == 1.0


def test_rows_are_written_as_csv_without_pandas(run: Run, tmp_path: Path) -> None:
    run.to_csv(tmp_path / "trials.csv")
    head, *rows = csv.reader((tmp_path / "trials.csv").read_text().splitlines())
    assert head == list(trial_columns(run)) and len(rows) == len(run.keys)


def test_a_data_frame_averages_over_what_has_a_result(run: Run) -> None:
    pandas = pytest.importorskip("pandas", reason="pandas comes with the extra notebook")
    frame = run.to_pandas()
    assert list(frame.columns) == list(trial_columns(run))
    assert frame.success.mean() == 0.5 and frame.success.isna().sum() == 2
    assert dict(frame.groupby("level").success.mean()) == {1: 1.0, 2: 0.0}
    assert pandas.api.types.is_integer_dtype(frame.steps.dtype)


def test_without_pandas_a_sentence_says_what_brings_it(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = builtins.__import__

    def without(name: str, *words: object, **more: object) -> object:
        if name.partition(".")[0] == "pandas":
            raise ModuleNotFoundError("No module named 'pandas'", name="pandas")
        return found(name, *words, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.setattr("robospa.extras.import_module", lambda name: without(name))
    with pytest.raises(MissingPackage, match=r"pandas is not installed.*\[notebook\]'"):
        run.to_pandas()


def test_failures_name_objects_as_they_look(run: Run) -> None:
    (failure,) = run.failures()
    assert (failure.task, failure.level, failure.seed) == ("Pick_It", 2, 8)
    assert failure.type == "target grounding" and failure.step == 3
    assert failure.evidence == "took the <small> cube, which was not asked for"


def test_failures_are_printed_a_line_each_and_stay_a_list(run: Run) -> None:
    failures = run.failures()
    (failure,) = failures
    assert str(failures).splitlines() == [
        "1 failed trial",
        f"{WRONG.key.slug}  target grounding  took the <small> cube, which was not asked for",
    ]
    assert failure.trial == WRONG.key.slug and repr(failures) == str(failures)
    html = failures._repr_html_()
    assert "<table" in html and "the &lt;small&gt; cube" in html
    assert isinstance(failures, list) and failures == [failure]
    assert str(failures[:1]) == str(failures), "a slice is shown in the same way"
    assert str(FailedTrials()) == "0 failed trials"


def test_of_very_many_failures_the_first_are_printed(run: Run) -> None:
    many = FailedTrials(run.failures() * 250)
    lines = str(many).splitlines()
    assert len(lines) == 102 and lines[0] == "250 failed trials"
    assert lines[-1] == "and 150 more: a slice, such as [100:], shows them"
    assert lines[-1] in many._repr_html_()


def test_the_table_is_text_and_html(run: Run) -> None:
    table = run.table()
    text = str(table)
    assert "Pick It" in text and "SR [95 %]" in text and "L2" in text
    assert "<table" in table._repr_html_() and "Pick It" in table._repr_html_()
    assert "cannot reach it" in text, "why so little succeeded stands below it"
    html = run._repr_html_()
    assert html.count("cannot reach it") == 1 and "failures: 1 target grounding" in html


def test_several_robots_are_sections_of_one_table(tmp_path: Path) -> None:
    other = [replace(r, key=replace(r.key, embodiment="piper")) for r in ROWS[:2]]
    one_level = [r for r in ROWS if r.key.level == 2]
    table = make_run(tmp_path / "run", [*one_level, *other]).table()
    assert [row.label for row in table.rows if row.kind == "section"] == ["aloha-agilex", "piper"]
    assert table.heads[:2] == ("L1", "L2")
    first = next(row for row in table.rows if row.kind == "row")
    assert first.cells[0].text == "" and first.cells[1].text == "0.0"
