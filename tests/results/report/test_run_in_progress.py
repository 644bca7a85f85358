"""Not yet run is not missing: a run in progress shows what has finished, with intervals."""

import json
import re
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import KNOWN, make_run

from robospa.harness.report_server import LiveReport
from robospa.harness.running.atomic_file import run_lock
from robospa.results.lint import lint_run
from robospa.results.records.runs import Run, in_progress, read_run, to_line
from robospa.results.report.page import to_data
from robospa.results.report.report import make_report
from robospa.results.report.run_card import print_scores
from robospa.results.scoring.models import results_of_run
from robospa.results.statistics.intervals import wilson

pytestmark = pytest.mark.usefixtures("no_figures")


@pytest.fixture
def going() -> Iterator[ExitStack]:
    """Holds the locks of runs until it is closed."""
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def folder(tmp_path: Path, going: ExitStack) -> Path:
    """A run of two variants: 4 of 12 trials of the first have finished, 3 of them well; a process
    runs it."""
    run = make_run(tmp_path / "run", KNOWN, lost=8)
    lines = "".join(to_line(record) for record in KNOWN[:4])
    (run.folder / "trials" / "0000.jsonl").write_text(lines)
    going.enter_context(run_lock(run.folder))
    return run.folder


def card_of(page: str) -> str:
    """The text of the summary's first number, and all that follows."""
    return " ".join(re.sub("<[^>]*>", " ", page.split('<div class="big">', 1)[1]).split())


def page_of(folder: Path) -> str:
    with closing(LiveReport(folder)) as live:
        return live.read()[0].decode()


def test_a_run_is_in_progress_while_its_lock_is_held(folder: Path, going: ExitStack) -> None:
    assert in_progress(folder) and read_run(folder).in_progress
    going.close()
    assert not in_progress(folder) and not read_run(folder).in_progress
    assert not in_progress(folder / "nowhere")


def test_trials_that_are_still_to_run_are_not_missing(folder: Path, going: ExitStack) -> None:
    run = read_run(folder)
    assert (len(run.waiting), len(run.missing), len(run.without_result)) == (10, 0, 10)
    assert not [f for f in lint_run(run) if f.rule == "missing"]
    assert to_data(make_report(run))["runs"][0]["run"]["to_run"] == 10  # type: ignore[index]
    going.close()
    run = read_run(folder)
    assert (len(run.waiting), len(run.missing), len(run.without_result)) == (0, 10, 10)
    assert [f for f in lint_run(run) if f.rule == "missing"]


def test_lost_trials_of_a_run_in_progress_are_missing(folder: Path) -> None:
    lost = replace(KNOWN[4], end="infrastructure")
    with (folder / "trials" / "0000.jsonl").open("a") as file:
        file.write(to_line(lost))
    run = read_run(folder)
    assert run.missing == (lost.key,) and len(run.waiting) == 9


def test_the_live_page_shows_the_rate_so_far_with_its_interval(folder: Path) -> None:
    page = page_of(folder)
    card = card_of(page)
    found = wilson(3, 4)
    interval = f"95 % interval [{100 * found.low:.1f}, {100 * found.high:.1f}]"
    assert f"75.0 % {interval}" in card
    assert "mean over 1 variant, 4 trials so far" in card
    assert "10 of 14 trials still to run" in card
    summary = page.split('id="summary"')[1].split("</section>")[0]
    assert "missing" not in re.sub("<[^>]*>", "", summary)
    assert "are missing" not in page.split("<main")[0]
    assert "10 trials are still to run; averages are over what has finished." in page


def test_averages_of_a_live_page_are_over_what_has_finished(folder: Path) -> None:
    tables = {shown.table.name: shown.table for shown in make_report(read_run(folder)).tables}
    rows = {row.label: [e.text for e in row.cells] for row in tables["main"].rows if row.cells}
    assert rows["Geometric Attribute Cognition"] == rows["Overall average"] == ["75.0"]


def test_a_stopped_run_shows_no_rate_over_what_it_lacks(folder: Path, going: ExitStack) -> None:
    going.close()
    page = page_of(folder)
    assert "no value: results are missing" in card_of(page)
    assert "10 of 14 trials are missing" in page


def test_the_first_page_of_a_run_says_that_there_is_no_result_yet(folder: Path) -> None:
    (folder / "trials" / "0000.jsonl").write_text("")
    page = page_of(folder)
    assert "no result yet" in page and "14 of 14 trials still to run" in page
    assert "No tables" not in page


def test_the_terminal_counts_what_is_still_to_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run: Run = read_run(folder)
    print_scores(run, results_of_run(run))
    text = capsys.readouterr().out
    assert "14 trials: 10 still to run, 3 success, 1 step limit" in text
    assert "missing" not in text
    assert json.loads(json.dumps(to_data(make_report(run))))
