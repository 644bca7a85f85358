"""What a run says of itself while it goes on."""

from __future__ import annotations

import io
import sys
import types

import pytest
from fake_runs import trial_record

from robospa.harness.progress import Progress, details, rate_text, summary
from robospa.harness.running.status import ServerStats, Status
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

LONG, SHORT = TrialKey("Long", 5, 1), TrialKey("Short", 1, 1)


def record(key: TrialKey, end: str = "success") -> TrialRecord:
    won = end == "success"
    return trial_record(key, won, end=end)


def test_plain_lines_where_there_is_no_terminal() -> None:
    stream = io.StringIO()
    with Progress(1, 0, stream) as progress:
        progress.add(record(SHORT, "step_limit"))
        progress.update(Status(0.0, 1, 1, 1))
    first, last = stream.getvalue().splitlines()
    assert first == "1 trial to run, 0 already done"
    assert last.startswith("1/1 trials, success 0.0 %")
    assert rate_text(1, 16) == "6.3 % [1.1, 28.3]", "as in tables, not 6.2"


def test_films_are_counted_beside_the_trials_and_after_them() -> None:
    stream = io.StringIO()
    with Progress(1, 0, stream) as progress:
        progress.add(record(SHORT, "step_limit"))
        progress.update(Status(0.0, 1, 1, 1, films=3))
        progress._line = float("-inf")
        progress.show_films(0, 3)
        progress.show_films(1, 2)  # too soon for another line
        progress._line = float("-inf")
        progress.show_films(2, 1)
    _, trials, first, last = stream.getvalue().splitlines()
    assert trials.endswith(", 3 films to make")
    assert first == "films: 0 made, 3 to make"
    assert last == "films: 2 made, 1 to make, 0:00 left"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def server(name: str, **means: float) -> ServerStats:
    found = ServerStats(name, frozenset({"Long"}), batch=8, running=2, task="Long", trials=7)
    found.means = {"p50": 120.0, **means}
    return found


def status(*servers: ServerStats) -> Status:
    shares = {"physics": 0.25, "rendering": 0.05, "waiting": 0.7}
    return Status(0.0, 4, 4, 2, servers, shares, left=90.0)


def test_the_live_view_shows_speed_servers_and_who_is_slow() -> None:
    stream = Terminal()
    with Progress(3, 1, stream) as progress:
        progress.add(record(LONG))
        progress.update(status(server("ws://a", queue=300.0, infer=100.0, batch=7.5)))
        progress.note("[news] about ws://a")
    shown = stream.getvalue()
    for text in (
        "2/3",
        "success 100.0 %",
        "trials/min",
        "1:30 left",
        "4 workers on 2 cores; physics 25 %, rendering 5 %, waiting 70 %",
        "answers in 120 ms, queue 300 ms, batch 7.5 of 8",
        "the policy server is the bottleneck",
        "[news] about ws://a",
    ):
        assert text in shown, text


def test_a_picture_is_not_drawn_more_often_than_it_can_be_read() -> None:
    stream = Terminal()
    with Progress(9, 0, stream) as progress:
        progress.update(status(server("ws://a")))
        before = len(stream.getvalue())
        for _ in range(50):
            progress.update(status(server("ws://a")))
        assert len(stream.getvalue()) == before


def test_plain_lines_tell_the_same_now_and_then() -> None:
    lines = details(status(server("ws://a", queue=1.0, infer=100.0)))
    assert lines == [
        "4 workers on 2 cores; physics 25 %, rendering 5 %, waiting 70 %",
        "ws://a: 7 trials, answers in 120 ms, queue 1.0 ms",
        "room for more workers: they wait 70 % of their time, no queue is long",
    ]
    stream = io.StringIO()
    with Progress(9, 0, stream) as progress:
        progress.add(record(SHORT))
        for _ in range(5):
            progress.update(status(server("ws://a")))
    assert len(stream.getvalue().splitlines()) == 2


def test_a_run_ends_with_where_its_time_went() -> None:
    first, *servers = summary({"physics": 0.9, "waiting": 0.1}, status(server("a"), server("b")))
    assert first == "time: physics 90 %, waiting 10 %, with 4 workers on 2 cores"
    assert servers == ["a: 7 trials, answers in 120 ms", "b: 7 trials, answers in 120 ms"]
    assert summary({}, status()) == []


def test_before_the_first_trial_has_ended_answers_are_counted() -> None:
    stream = io.StringIO()
    server = ServerStats("ws://a", frozenset({"Long"}))
    server.add_answers(7, 100.0)
    with Progress(24, 0, stream) as progress:
        progress._line -= 60.0
        progress.update(Status(0.0, 2, 2, 2, (server,)))
    assert stream.getvalue().splitlines()[1] == (
        "0/24 trials, first trials under way, 7 answers of the policy so far"
    )


def test_a_notebook_shows_one_picture_that_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    class Handle:
        def update(self, html: str) -> None:
            shown.append(html)

    def display(html: str, display_id: bool) -> Handle:
        shown.append(html)
        return Handle()

    kernel = types.SimpleNamespace(kernel=object())
    notebook = types.SimpleNamespace(get_ipython=lambda: kernel)
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    output = types.SimpleNamespace(HTML=str, display=display)
    monkeypatch.setitem(sys.modules, "IPython.display", output)
    stream = io.StringIO()
    with Progress(2, 0, stream) as progress:
        progress.note("warning: <b>")
        progress.add(record(SHORT))
        progress.add(record(LONG))
        progress.update()
    assert stream.getvalue() == ""
    assert "0/2" in shown[0] and "2/2" in shown[-1] and "success 100.0 %" in shown[-1]
    assert all("warning: &lt;b&gt;" in html for html in shown[1:])
