"""The paper's tables from published models and runs; what is missing is shown, never averaged."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fake_runs import outcomes, run_of, trial_record, write

from robospa.results.paper.columns import published_column, run_column
from robospa.results.paper.published import LEVELS, load
from robospa.results.paper.result_tables import summary_table, task_table
from robospa.results.paper.tables import make_tables
from robospa.results.records.runs import Run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.report import report_tables
from robospa.results.report.run_card import rows
from robospa.results.scoring.models import IncomparableError
from robospa.results.scoring.scores import score_run, to_json
from robospa.results.tables import Table, TableCell
from robospa.trial import TrialKey

DATA = load()


def make_run(
    records: Sequence[TrialRecord], name: str = "mine", suite: str = "robospa-1", **settings: Any
) -> Run:
    return run_of(records, suite=suite, settings={"policy": {"spec": {"name": name}}, **settings})


@cache
def full_run(model: str, trials: int = 100, **key: Any) -> tuple[TrialRecord, ...]:
    """Records with the success and progress that the paper prints for `model`."""
    made = []
    for task in DATA.tasks.values():
        for level in LEVELS:
            sr = DATA.value(model, "sr", task.name, level) or 0.0
            ps = DATA.value(model, "ps", task.name, level)
            count = task.counts[level - 1]
            left = round((ps or 0.0) * trials * count / 100)
            for n in range(trials):
                done = min(count, left) if ps is not None else int(n < sr)
                left -= done
                spatial = {"total": 1, "candidates": count}
                made.append(
                    trial_record(
                        TrialKey(task.name, level, n, **key),
                        100 * n < sr * trials,
                        category=task.category,
                        done=done,
                        **(spatial if ps is None else {"total": count, "candidates": 0}),
                    )
                )
    return tuple(made)


def entry(table: Table, row: str, column: int) -> TableCell:
    return next(line for line in table.rows if line.label == row).cells[column]


def test_a_run_with_the_published_counts_prints_the_published_digits() -> None:
    run = run_column(make_run(full_run("RDT"), name="again"))
    for name in ("main", "onta", "sr-tasks", "onta-tasks", "ps-tasks"):
        (table,) = make_tables([published_column("RDT"), run], [name], mark="none")
        for line in table.rows:
            half = len(line.cells) // 2
            first, second = (
                [e.text for e in part] for part in (line.cells[:half], line.cells[half:])
            )
            assert first == second, (name, line.label)


def test_lost_trials_are_marked_with_the_range_they_leave_open() -> None:
    records = [*full_run("RDT", trials=10)]
    place = next(n for n, r in enumerate(records) if r.key.task == "Pick_Blocks_Size")
    records[place] = replace(records[place], end="infrastructure", success=False)
    run = run_column(make_run(records))
    table = summary_table([run], "main", "sr", ("L1", "L5", "Drop"))
    assert entry(table, "Geometric Attribute Cognition", 0).sign == "†"
    assert entry(table, "Geometric Attribute Cognition", 1).sign == ""
    assert entry(table, "Overall average", 0).sign == "†"
    assert any("GAC L1 lacks 1, SR between" in note for note in table.notes)
    assert any("up to 10 trials per variant" in note for note in table.notes)


def test_a_task_that_was_not_run_leaves_all_averages_above_it_open() -> None:
    records = [r for r in full_run("RDT", trials=2) if r.key.variant != ("Pick_Blocks_Size", 5)]
    run = run_column(make_run(records))
    table = summary_table([published_column("RDT"), run], "main", "sr", ("L1", "L5", "Drop"))
    for row in ("Geometric Attribute Cognition", "Overall average"):
        assert [entry(table, row, n).text == "–" for n in (3, 4, 5)] == [False, True, True]
    assert entry(table, "Spatial Distance Estimation", 4).text != "–"
    assert any("not run are 1 at L5 of 56 tasks" in note for note in table.notes)
    (intervals,) = make_tables([run], ["intervals"])
    assert entry(intervals, "mine", 2).text == "–"
    assert entry(intervals, "mine", 1).text != "–"


def test_the_best_are_better_than_another_model_and_worse_than_none() -> None:
    columns = [published_column(model) for model in DATA.models]
    tied = summary_table(columns, "main", "sr", ("L1", "L5", "Drop"), "tied")
    highest = summary_table(columns, "main", "sr", ("L1", "L5", "Drop"), "highest")

    def marked(table: Table, row: str) -> list[int]:
        line = next(x for x in table.rows if x.label == row)
        return [n for n, e in enumerate(line.cells) if e.best]

    assert marked(highest, "Cross-View Reasoning") == [6, 7]
    assert marked(tied, "Cross-View Reasoning") == [6, 7, 9, 10]
    assert marked(highest, "Memory-Intensive Planning") == [1, 4, 6, 7, 10]
    assert marked(tied, "Memory-Intensive Planning") == [6], "at L5 nothing can be told apart"
    for table in (highest, tied):
        for line in table.rows:
            assert not any(line.cells[n].best for n in range(2, len(line.cells), 3))  # no drop


@pytest.mark.parametrize("mark", ["tied", "highest"])
def test_beside_runs_published_models_are_not_marked(mark: str) -> None:
    """Weak and weaker runs: the marks are those of a table without the paper's models."""
    runs = [run_column(make_run(full_run("RDT"), name="weak"))]
    runs.append(run_column(make_run(full_run("GO-1"), name="weaker")))
    published = [published_column(model, f"{model} (paper)") for model in ("pi0.5", "X-VLA")]
    for metric, name, heads in (("sr", "main", ("L1", "L5", "Drop")), ("ps", "ps", ("L1", "L3"))):
        both, alone = (
            summary_table(columns, name, metric, heads, mark)
            for columns in ([*runs, *published], runs)
        )
        cells, own = ([[e.best for e in line.cells] for line in t.rows] for t in (both, alone))
        assert cells == [line + [False] * len(line) for line in own]
        assert any(map(any, own))
        assert both.notes[0].startswith("(paper): another suite, with other")
    one = task_table([runs[0], *published[:1]], "sr-tasks", "sr", mark)
    assert not any(e.best for line in one.rows for e in line.cells), "one of each suite"


def test_a_run_on_another_robot_is_a_row_of_the_embodiment_tables_only() -> None:
    run = run_column(make_run(full_run("RDT", trials=2, embodiment="ur5-wsg")))
    columns = [published_column("RDT"), run]
    (table,) = make_tables(columns, ["embodiments-spatial"])
    assert [row.label for row in table.rows[-2:]] == ["X-VLA, UR5", "mine, UR5"]
    both = make_tables([*columns, run_column(make_run(full_run("RDT", trials=2)), "same")])
    for table in both:
        if table.name == "main":
            assert "same" in table.group_of and "mine" not in table.group_of
        if table.name.startswith("embodiments-"):
            labels = [row.label for row in table.rows]
            assert labels.index("same, Aloha-AgileX") == 1
            assert labels.index("mine, UR5") == labels.index("X-VLA, UR5") + 1


def test_other_suites_scenes_or_splits_are_refused() -> None:
    base = full_run("RDT", trials=1)
    unknown = make_run(base, suite="")
    other = full_run("RDT", trials=1, split="train")
    mixed = full_run("RDT", trials=1, mode="randomized")
    first = run_column(make_run(base, suite="robospa-1"), "a")
    for second, what in (
        (run_column(make_run(base, suite="robospa-2"), "b"), "suite"),
        (run_column(make_run(other, name="another"), "b"), "split"),
        (run_column(make_run(mixed, name="another"), "b"), "mode"),
    ):
        with pytest.raises(IncomparableError, match=f"a and b cannot .* {what}s "):
            make_tables([first, second], ["main"])
    with pytest.raises(IncomparableError, match="b does not state its suite"):
        make_tables([first, run_column(unknown, "b")], ["main"])
    assert make_tables([run_column(unknown, "b"), published_column("RDT")], ["main"])


@pytest.mark.parametrize("key", [TrialKey("Juggle", 1, 0), TrialKey("Pick_Blocks_Size", 6, 0)])
def test_unknown_variants_are_named(key: TrialKey) -> None:
    with pytest.raises(IncomparableError, match=f"{key.task} L{key.level}"):
        run_column(make_run([trial_record(key, True)]))


def test_other_mistakes_are_named() -> None:
    with pytest.raises(IncomparableError, match="lists no trials"):
        run_column(make_run([]))
    with pytest.raises(ValueError, match="no published model is called 'pi1'; there are RDT"):
        published_column("pi1")
    with pytest.raises(IncomparableError, match="two columns are called RDT"):
        make_tables([published_column("RDT"), published_column("RDT")], ["main"])
    with pytest.raises(ValueError, match="no table is called 'mian'; there are main"):
        make_tables([published_column("RDT")], ["mian"])
    with pytest.raises(ValueError, match="no mark is called"):
        make_tables([published_column("RDT")], ["main"], mark="bold")
    with pytest.raises(IncomparableError, match="at least one"):
        make_tables([], ["main"])


def test_a_privileged_policy_is_called_so() -> None:
    oracle = run_column(make_run(full_run("RDT", trials=1), privileged=True))
    assert oracle.title == "mine (privileged)"
    columns = [published_column("RDT"), oracle, published_column("X-VLA")]
    (table,) = make_tables(columns, ["sr-tasks"], mark="highest")
    shown = entry(table, "Hang Mug Stack Blocks", 5), entry(table, "Hang Mug Stack Blocks", 0)
    assert [e.best for e in shown] == [False, False]  # competes with nobody
    assert not any(e.best for line in table.rows for e in line.cells[5:10])


def test_values_that_do_not_follow_are_marked_and_the_printed_ones_told() -> None:
    (main, ps) = make_tables(
        [published_column("GO-1"), published_column("X-VLA")], ["main", "ps-tasks"]
    )
    assert entry(main, "Composite Action Coordination", 0).sign == "*"
    assert any("CAC GO-1 L1 24.2" in note for note in main.notes)
    assert entry(ps, "Click Bell Open Microwave Place Object", 5).text == "15.0"
    assert entry(ps, "Click Bell Open Microwave Place Object", 5).sign == "*"


def test_a_task_has_one_name_in_all_tables() -> None:
    """The paper's tables print some tasks under another name than the benchmark's code has."""
    columns = [published_column(model) for model in DATA.models]
    text = "".join(
        cell
        for table in make_tables(columns)
        for line in table.rows
        for cell in (line.label, *(e.text for e in line.cells), *table.notes)
    )
    for task in DATA.tasks.values():
        assert task.title == task.name.replace("_", " ")
        assert task.title in text
        assert task.printed == task.title or task.printed not in text


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


def written(folder: Path, records: list[TrialRecord]) -> Run:
    return write(folder, records, categories={r.key.task: r.category for r in records})


@pytest.fixture
def mixed(tmp_path: Path) -> Run:
    """Every basic trial fails or not; the one base task always succeeds."""
    return written(tmp_path / "run", outcomes("Pick_Blocks_Size", 1, [1] * 4) + grounding())


def test_no_average_includes_them(mixed: Run) -> None:
    scores = score_run(mixed)
    sr = scores.overall[0].values["sr"]
    assert sr is not None and sr.value == 1.0
    assert set(scores.dimensions) == {("spatial", 1), ("spatial", 0)}
    own = scores.categories["CBG", 1].values["sr"]
    assert own is not None and own.value == pytest.approx(17 / 20)
    assert own.low < 17 / 20 < own.high


def test_their_rows_come_last(mixed: Run) -> None:
    labels = [label for _, label in rows(score_run(mixed))]
    assert labels[:2] == ["GAC Pick Blocks Size", "CBG Ground 0"]
    assert labels[-2:] == ["overall", "CBG Color-Based Grounding"]


def test_a_run_of_them_alone_has_no_overall_value(tmp_path: Path) -> None:
    scores = score_run(written(tmp_path / "run", grounding()))
    assert to_json(scores)["overall"] == {}
    assert [label for _, label in rows(scores)][-1] == "CBG Color-Based Grounding"


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
    column = run_column(written(tmp_path / "run", grounding(sets=4)))
    (table,) = make_tables([column], ["basic"])
    assert {e.text for e in table.rows[0].cells[5:]} == {"–"}


def test_runs_of_them_alone_are_in_no_table_of_the_benchmark(tmp_path: Path) -> None:
    column = run_column(written(tmp_path / "run", grounding()))
    main, basic = make_tables([published_column("pi0.5"), column], ["main", "basic"])
    assert len(main.groups) == 1 and len(basic.groups) == 2


def test_the_report_shows_the_table(mixed: Run, tmp_path: Path) -> None:
    assert "basic" in [s.table.name for s in report_tables([run_column(mixed)])]
    alone = run_column(written(tmp_path / "alone", grounding()))
    assert [s.table.name for s in report_tables([alone])] == ["basic"]
