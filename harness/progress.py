"""What the user sees while something long goes on: one bar, live on a terminal or in a notebook,
and a plain line now and then elsewhere. That of an evaluation also shows where its time goes."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TextIO, TypeVar

from robospa.harness.running.status import ServerStats, Status, server_text, shares_text
from robospa.results.records.trial_record import TrialRecord
from robospa.results.statistics.intervals import wilson
from robospa.results.tables import estimate_cell
from robospa.text import clock_text, counted, plain_console, recording_console

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

EVERY = 15.0
"""Seconds between two plain lines."""
DETAILS = 120.0
"""Seconds between two plain lines that say where the time goes."""
REFRESH = 0.5
"""Seconds between two pictures on a terminal."""
RECENT = 64
"""Trials over which the speed is measured."""
ROWS = 8
"""Servers that the live view lists; the busiest ones if there are more."""
COLUMNS = 110
"""Of a view in a notebook."""
FRAME = '<pre style="white-space:pre;overflow-x:auto;line-height:normal;margin:0">{code}</pre>'
B = TypeVar("B", bound="Bar")


class Bar:
    """So many `what` done of a `total`, and what is said of it; a context manager."""

    def __init__(self, what: str, total: int, done: int = 0, stream: TextIO | None = None) -> None:
        self.what, self.total, self.done = what, total, done
        self._stream = stream or sys.stderr
        self._screen: _TerminalScreen | _NotebookScreen | None = None
        self._text = ""
        self._shown = self._line = float("-inf")

    def __enter__(self: B) -> B:
        self._line = time.monotonic()
        if _in_notebook():
            self._screen = _NotebookScreen(self.head())
        elif self._stream.isatty():
            self._screen = _TerminalScreen(self._stream, self.head())
        return self

    def __exit__(self, *_: object) -> None:
        if self._screen is not None:
            self._screen.update(self.head())
            self._screen.stop()
            self._screen = None

    def show(
        self, text: str, line: str = "", picture: Callable[[], RenderableType] | None = None
    ) -> bool:
        """Show the bar with `text`, or `picture`, but not more often than anybody can read; whether
        that was a plain line. `line` stands for the plain line, and comes at the end no sooner."""
        now, self._text = time.monotonic(), text
        at_end = self.done == self.total and not line
        if self._screen is not None:
            if now - self._shown >= REFRESH or at_end:
                self._shown = now
                self._screen.update(picture() if picture else self.head())
            return False
        if now - self._line < EVERY and not at_end:
            return False
        self._line = now
        self.note(line or f"{self.done}/{self.total} {self.what}, {text}")
        return True

    def note(self, text: str) -> None:
        if self._screen is not None:
            self._screen.note(text)
        else:
            print(text, file=self._stream, flush=True)

    def head(self) -> Table:
        """The bar itself, with its text beside it."""
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        head = Table.grid(padding=(0, 1))
        bar = ProgressBar(total=max(self.total, 1), completed=self.done, width=28)
        head.add_row(bar, f"{self.done}/{self.total}", Text(self._text))
        return head


class _TerminalScreen:
    """A picture that stays at the bottom of a terminal."""

    def __init__(self, stream: TextIO, first: RenderableType) -> None:
        from rich.live import Live

        self._live = Live(first, console=plain_console(file=stream), auto_refresh=False)
        self._live.start()

    def update(self, picture: RenderableType) -> None:
        self._live.update(picture, refresh=True)

    def note(self, text: str) -> None:
        self._live.console.print(text, style="yellow")

    def stop(self) -> None:
        self._live.stop()


class _NotebookScreen:
    """The output of one cell, drawn anew with every picture; the lines that stay come first."""

    def __init__(self, first: RenderableType) -> None:
        from IPython.display import HTML, display

        self._notes: list[str] = []
        self._picture, self._as_html = first, HTML
        self._handle = display(self._html(), display_id=True)

    def update(self, picture: RenderableType) -> None:
        self._picture = picture
        self._handle.update(self._html())

    def note(self, text: str) -> None:
        self._notes.append(text)
        self._handle.update(self._html())

    def stop(self) -> None: ...

    def _html(self) -> object:
        from rich.text import Text

        console = recording_console(COLUMNS)
        for note in self._notes:
            console.print(Text(note))
        console.print(self._picture)
        return self._as_html(console.export_html(inline_styles=True, code_format=FRAME))


def _in_notebook() -> bool:
    """Whether this process is the kernel of a notebook, which shows HTML."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class Progress(Bar):
    """The bar of an evaluation: counts of what has come in, and the latest `Status`."""

    def __init__(self, total: int, already: int = 0, stream: TextIO | None = None) -> None:
        super().__init__("trials", total, already, stream)
        self.ran = self.successes = self.lost = 0
        self._times = deque([time.monotonic()], maxlen=RECENT)
        self._status: Status | None = None
        self._films_began: float | None = None
        self._detail = float("-inf")

    def __enter__(self) -> Progress:
        super().__enter__()
        first = self._detail == float("-inf")  # again for the films
        self._detail = self._line - DETAILS + 2 * EVERY
        if self._screen is None and first:
            left = counted(self.total - self.done, "trial")
            self.note(f"{left} to run, {self.done} already done")
        return self

    def add(self, record: TrialRecord) -> None:
        if not self.ran:
            self._line = float("-inf")  # the first result is shown at once
        self.ran += 1
        self.done += 1
        self.successes += record.success
        self.lost += record.end == "infrastructure"
        self._times.append(time.monotonic())

    @property
    def rate(self) -> float:
        """Trials a second over the last ones; falls while none comes in."""
        return (len(self._times) - 1) / max(time.monotonic() - self._times[0], 1e-9)

    def update(self, status: Status | None = None) -> None:
        """Show the counts and `status`; without one the time left follows from the trials so
        far."""
        self._status = status
        now = time.monotonic()
        plain = self.show(self._counts(), picture=self._picture)
        left = self.total - self.done
        if plain and status is not None and left and now - self._detail >= DETAILS:
            self._detail = now
            for text in details(status):
                self.note(f"  {text}")

    def show_films(self, made: int, pending: int) -> None:
        """Show that all trials are done, and how many films since then, as often as `show`."""
        now = time.monotonic()
        if self._films_began is None:
            self._films_began = now
        text = f"films: {made} made, {pending} to make"
        if made and pending:
            text += f", {clock_text(pending * (now - self._films_began) / made)} left"
        if self._screen is not None or pending:
            self.show(self._text, text, lambda: _group(self.head(), text))

    def _counts(self) -> str:
        """Success so far, speed and time left in words."""
        status = self._status
        if not self.ran:
            return "starting" if status is None else status.first_words
        scored = self.ran - self.lost
        parts = [f"success {rate_text(self.successes, scored)}" if scored else "no result yet"]
        parts.append(f"{60 * self.rate:.1f} trials/min")
        left = self.total - self.done
        seconds = left / self.rate if status is None else status.left
        if left and seconds is not None:
            parts.append(f"{clock_text(seconds)} left")
        if self.lost:
            parts.append(f"{self.lost} lost")
        if status is not None and status.films:
            parts.append(f"{status.films} film{'s' * (status.films != 1)} to make")
        return ", ".join(parts)

    def _picture(self) -> RenderableType:
        """What a terminal shows: bar, counts, where the time goes, servers, the bottleneck."""
        from rich.text import Text

        status = self._status
        if status is None:
            return self.head()
        shares = shares_text(status.shares)
        workers = f"{status.workers_text}; {shares}" if shares else status.workers_text
        lines: list[RenderableType] = [self.head(), Text(workers, style="dim")]
        if status.servers:
            lines.append(_table(status))
        if status.bottleneck:
            lines.append(Text(status.bottleneck, style="bold"))
        return _group(*lines)


def rate_text(successes: int, trials: int) -> str:
    """`25.0 % [7.1, 59.1]`: a rate with its 95 % interval, as if all trials were of one kind."""
    return estimate_cell(wilson(successes, trials)).text.replace(" [", " % [")


def _group(*lines: RenderableType) -> RenderableType:
    from rich.console import Group

    return Group(*lines)


def _table(status: Status) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("policy", overflow="ellipsis", no_wrap=True, max_width=40)
    for name in ("workers", "trials"):
        table.add_column(name, justify="right")
    table.add_column("", no_wrap=True)
    table.add_column("task", overflow="ellipsis", no_wrap=True, style="dim")
    shown = _busiest(status.servers)
    for server in shown:
        state = Text(server_text(server, status.now), style="" if server.up else "yellow")
        counts = (str(server.running), str(server.trials))
        table.add_row(Text(server.target), *counts, state, Text(server.task))
    if more := len(status.servers) - len(shown):
        table.add_row(f"and {more} more", "", "", "", "")
    return table


def _busiest(servers: Sequence[ServerStats]) -> list[ServerStats]:
    """At most ROWS of them, in their own order; those that are away first of all."""
    if len(servers) <= ROWS:
        return list(servers)
    order = sorted(servers, key=lambda s: (s.up, -s.running, -s.trials))[:ROWS]
    return [server for server in servers if server in order]


def details(status: Status) -> list[str]:
    """Lines that say where the time goes, what the servers do and what the bottleneck is."""
    shares = shares_text(status.shares)
    lines = [f"{status.workers_text}; {shares}"] if shares else []
    used = [s for s in _busiest(status.servers) if s.trials or not s.up]
    lines += [
        f"{s.target}: {counted(s.trials, 'trial')}, {server_text(s, status.now)}" for s in used
    ]
    return [*lines, status.bottleneck] if status.bottleneck else lines


def summary(shares: Mapping[str, float], status: Status) -> list[str]:
    """The same about a whole run, for its end."""
    lines = [f"time: {shares_text(shares)}, with {status.crowd}"]
    used = [s for s in _busiest(status.servers) if s.trials]
    for one in used:
        trials = f"{counted(one.trials, 'trial')}, " if len(used) > 1 else ""
        lines += [f"{one.target}: {trials}{server_text(one, status.now)}"] if one.means else []
    return lines if shares else []
