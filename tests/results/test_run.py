"""What a run shows of itself in Python: a table, a data frame, failures, a notebook's view."""

from __future__ import annotations

import builtins
from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import make_run, shown

from robospa.extras import MissingPackage
from robospa.results.failures.labels import FailedTrials
from robospa.results.records.runs import Run
from robospa.results.run import trial_columns

GRASP = {"time": 1.5, "kind": "grasped", "object": "object_2", "index": -1, "note": "", "step": 4}
WRONG = shown(
    "Pick_It",
    2,
    8,
    False,
    end="step_limit",
    events=(GRASP,),
    diagnostics={
        "roles": {},
        "objects": {"object_2": "the <small> cube"},
        "unreachable_actions": 6,
        "first_unreachable": "the left arm cannot reach it",
    },
)
ROWS = [
    shown("Pick_It", 1, 7, True),
    WRONG,
    shown("Pick_It", 2, 9, False, end="infrastructure"),
]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return make_run(tmp_path / "run", ROWS, lost=1)


def test_a_row_for_every_listed_trial_and_nothing_said_of_those_without_a_result(run: Run) -> None:
    columns = trial_columns(run)
    assert {len(column) for column in columns.values()} == {4}
    by_seed = {seed: n for n, seed in enumerate(columns["seed"])}
    ends = {seed: columns["end"][n] for seed, n in by_seed.items()}
    assert ends == {7: "success", 8: "step_limit", 9: "infrastructure", 900: "not run"}
    success = {seed: columns["success"][n] for seed, n in by_seed.items()}
    assert success == {7: True, 8: False, 9: None, 900: None}
    failed = by_seed[8]
    assert columns["failure"][failed] == "target grounding"
    assert "the <small> cube" in columns["evidence"][failed]
    assert columns["unreachable_actions"][failed] == 6
    assert columns["progress"][by_seed[7]] == 1.0


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
    assert failure.type == "target grounding" and failure.step == 4
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


def test_a_failure_stays_on_its_line_below_its_heads(run: Run) -> None:
    (one,) = run.failures()
    other = replace(one, seed=12345, type="no attempt", evidence="it\nfell " + "far " * 100)
    _, first, second = str(FailedTrials([one, other])).splitlines()
    assert first.index("took") == second.index("it fell") and second.endswith("far far")


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
    assert run._repr_html_().count("cannot reach it") == 1


def test_several_robots_are_sections_of_one_table(tmp_path: Path) -> None:
    other = [replace(r, key=replace(r.key, embodiment="piper")) for r in ROWS[:2]]
    one_level = [r for r in ROWS if r.key.level == 2]
    table = make_run(tmp_path / "run", [*one_level, *other]).table()
    assert [row.label for row in table.rows if row.kind == "section"] == ["aloha-agilex", "piper"]
    assert table.heads[:2] == ("L1", "L2")
    first = next(row for row in table.rows if row.kind == "row")
    assert first.cells[0].text == "" and first.cells[1].text == "0.0"


def test_a_notebook_shows_scores_failures_and_what_could_not_be_reached(run: Run) -> None:
    html = run._repr_html_()
    assert "<table" in html and "failures: 1 target grounding" in html
    assert "cannot reach it" in html and "<script>" not in html


def test_a_run_is_one_line_where_it_is_printed(run: Run) -> None:
    assert repr(run).endswith("run', 1 successes in 2 of 4 trials)") and "\n" not in repr(run)
