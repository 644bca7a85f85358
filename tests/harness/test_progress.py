"""What a run says of itself while it goes on."""

from __future__ import annotations

import io

from robospa.harness.progress import Progress, Tally, clock
from robospa.harness.status import Status
from robospa.results.records import TrialKey, TrialRecord

LONG, SHORT = TrialKey("Long", 5, 1), TrialKey("Short", 1, 1)


def record(key: TrialKey, end: str = "success") -> TrialRecord:
    won = end == "success"
    return TrialRecord(
        key, "GAC", "go", "", end, won, int(won), int(won), 1, 2, 1, 50, 1, "", "", 0.1
    )


def test_lost_trials_are_no_failures() -> None:
    tally = Tally(2, 0)
    tally.add(record(LONG))
    tally.add(record(SHORT, "infrastructure"))
    assert "success 100.0 %" in tally.text()
    assert "1 lost" in tally.text()


def test_plain_lines_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    with Progress(1, 0, stream) as progress:
        progress.add(record(SHORT, "step_limit"))
        progress.show(Status(0.0, 1, 1, 1))
    first, last = stream.getvalue().splitlines()
    assert first == "1 trials to run, 0 already done"
    assert last.startswith("1/1 trials, success 0.0 %")


def test_clock() -> None:
    assert (clock(65), clock(3723)) == ("1:05", "1:02:03")
