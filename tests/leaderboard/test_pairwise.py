"""Two submissions on equal seeds: the numbers are those of `robospa compare` on the runs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from bundle_fakes import PICK, make_run
from msgspec import to_builtins
from site_fakes import Weaker, make_submission

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.entries import entry_of
from robospa.leaderboard.site import pairs_of, write_pairs
from robospa.leaderboard.submission import read_submissions
from robospa.leaderboard.verify import compare_scores, outcomes_of, paired, results_of, scores_of
from robospa.results.comparison.compare import compare_results
from robospa.results.records.runs import Run, read_run
from robospa.results.records.trial_record import EventRow
from robospa.results.scoring.models import ModelResults, results_of_run
from robospa.results.scoring.scores import to_json


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Run]:
    folder = tmp_path_factory.mktemp("pairs")
    return (
        read_run(make_run(folder / "one")),
        read_run(make_run(folder / "two", policy=Weaker())),
    )


def side(run: Run) -> ModelResults:
    return results_of("x", outcomes_of(run), run.manifest)


def test_the_numbers_are_those_of_comparing_the_runs(runs: tuple[Run, Run]) -> None:
    rows = paired(side(runs[0]), side(runs[1]))
    for metric in ("sr", "onta"):
        right = compare_results(*(results_of_run(run) for run in runs), metric)
        assert right.paired
        for row in (*right.cells, *right.groups):
            shown = rows[metric][row.label][str(row.level)]
            wanted = [100 * x for x in (row.estimate.value, row.estimate.low, row.estimate.high)]
            assert shown[:3] == pytest.approx(wanted, abs=0.006)
            assert shown[3:5] == [row.only_first, row.only_second]
            assert shown[5] == pytest.approx(row.q, rel=0.05)
    assert rows["sr"][PICK]["0"][3:5] == [5, 0], "one seed of four at each of five levels"
    assert "ps" not in rows


def test_scores_follow_from_outcomes_alone(runs: tuple[Run, Run]) -> None:
    """First choices and what held at the start, too, though no event is kept."""
    blank = EventRow(time=0.0, kind="wrong_object", object="", index=-1, note="", step=0)
    more = (blank, {**blank, "kind": "subtask_done", "index": 0})
    records = {
        key: replace(record, events=(*more[: key.level % 3], *record.events))
        for key, record in runs[0].records.items()
    }
    run = replace(runs[0], records=records)
    assert not compare_scores(scores_of(run), to_json(side(run).scores))
    rate = side(run).scores.categories["GAC", 0].values
    assert rate["sr"].value > rate["sr1"].value == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("success", "01", "not of 4 trials"),
        ("success", "01x1", "must be text of 0, 1 and 2"),
        ("done", "9999", "more is done than"),
        ("total", 99, "must be a whole number <= 35, not 99"),
        ("more", 1, "unknown field 'more'"),
    ],
)
def test_outcomes_that_cannot_be_are_refused(
    runs: tuple[Run, Run], field: str, value: object, words: str
) -> None:
    outcomes = to_builtins(outcomes_of(runs[0]))
    outcomes[f"{PICK}/1"][field] = value
    with pytest.raises(BundleError, match=words):
        results_of("x", outcomes, runs[0].manifest)
    del outcomes[f"{PICK}/1"]
    with pytest.raises(BundleError, match="other variants"):
        results_of("x", outcomes, runs[0].manifest)


def test_pairs_are_written_once_and_only_of_what_was_measured_alike(tmp_path: Path) -> None:
    home, said = tmp_path / "home", []
    for number in (1, 2):
        make_submission(tmp_path / f"m{number}", home, name=f"Fake {number}")
    entries = [entry_of(found) for found in read_submissions(home)]
    (tmp_path / "pairs" / "gone").mkdir(parents=True)
    (tmp_path / "pairs" / "gone" / "x.js").write_text("")
    write_pairs(pairs_of(entries), tmp_path, said.append)
    text = (tmp_path / "pairs" / "fake-1" / "fake-2.js").read_text()
    head, call = text.split("\n", 1)
    assert head.startswith("// ")
    rows = json.loads(call.removeprefix('pairLoaded("fake-1/fake-2", ').removesuffix(");\n"))
    assert rows["sr"]["GAC"]["0"][:1] == [0]
    assert not (tmp_path / "pairs" / "gone").exists()
    write_pairs(pairs_of(entries), tmp_path, said.append)
    assert said == ["Fake 1 and Fake 2 on equal seeds"]
