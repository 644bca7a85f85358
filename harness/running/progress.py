"""What the user sees while a run goes on: a live view on a terminal or in a notebook, plain lines
elsewhere."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

from robospa.harness.running.screens import NotebookScreen, Screen, TerminalScreen, in_notebook
from robospa.harness.running.status import ServerStats, Status, server_text, shares_text
from robospa.results.records.trial_record import TrialRecord
from robospa.results.statistics.intervals import wilson
from robospa.text import clock_text, percent_text

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


class Tally:
    """Counts of what has come in, and the text that sums them up."""

    def __init__(self, total: int, already: int) -> None:
        self.total = total
        self.already = already
        self.ran = 0
        self.successes = 0
        self.lost = 0
        self._times = deque([time.monotonic()], maxlen=RECENT)

    def add(self, record: TrialRecord) -> None:
        """Count one finished or lost trial."""
        self.ran += 1
        self.successes += record.success
        self.lost += record.end == "infrastructure"
        self._times.append(time.monotonic())

    @property
    def done(self) -> int:
        """Trials with a record."""
        return self.already + self.ran

    @property
    def left(self) -> int:
        """Trials still to run."""
        return self.total - self.done

    @property
    def rate(self) -> float:
        """Trials a second over the last ones; falls while none comes in."""
        return (len(self._times) - 1) / max(time.monotonic() - self._times[0], 1e-9)

    def text(self, seconds_left: float | None = None) -> str:
        """Success so far, speed and time left."""
        scored = self.ran - self.lost
        parts = [f"success {rate_text(self.successes, scored)}" if scored else "no result yet"]
        if self.ran:
            parts.append(f"{60 * self.rate:.1f} trials/min")
        if self.left and seconds_left is not None:
            parts.append(f"{clock_text(seconds_left)} left")
        if self.lost:
            parts.append(f"{self.lost} lost")
        return ", ".join(parts)


def rate_text(successes: int, trials: int) -> str:
    """`25.0 % [7.1, 59.1]`: a rate with its 95 % interval, as if all trials were of one kind."""
    found = wilson(successes, trials)
    return percent_text(found.value, found.low, found.high).replace(" [", " % [")


class Progress:
    """Shows a `Tally` and the latest `Status`; use as a context manager."""

    def __init__(self, total: int, already: int = 0, stream: TextIO | None = None) -> None:
        self.tally = Tally(total, already)
        self._stream = stream or sys.stderr
        self._screen: Screen | None = None
        self._status: Status | None = None
        self._films_began: float | None = None
        self._shown = self._line = self._detail = self._began = float("-inf")

    def __enter__(self) -> Progress:
        self._began = time.monotonic()
        self._detail = self._began - DETAILS + 2 * EVERY
        if in_notebook():
            self._screen = NotebookScreen(self._picture())
        elif self._stream.isatty():
            self._screen = TerminalScreen(self._stream, self._picture())
        else:
            self.note(f"{self.tally.left} trials to run, {self.tally.already} already done")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._screen is not None:
            self._screen.update(self._picture(films=""))
            self._screen.stop()
            self._screen = None

    def add(self, record: TrialRecord) -> None:
        """Count one trial."""
        self.tally.add(record)

    def show(self, status: Status | None = None) -> None:
        """Show the counts and `status`, but not more often than anybody can read.

        Without a status the time left follows from the trials so far.
        """
        self._status = status
        now = time.monotonic()
        if self._screen is not None:
            if now - self._shown >= REFRESH or self.tally.left == 0:
                self._shown = now
                self._screen.update(self._picture())
        elif self._is_due(now):
            self._line = self._began = now
            self.note(f"{self.tally.done}/{self.tally.total} trials, {self._counts()}")
            if status is not None and now - self._detail >= DETAILS and self.tally.left:
                self._detail = now
                for text in details(status):
                    self.note(f"  {text}")

    def _is_due(self, now: float) -> bool:
        """Whether it is time for a plain line: at once for the first results and for the last."""
        if not self.tally.ran:
            return now - self._began >= EVERY
        return now - self._line >= EVERY or self.tally.left == 0

    def note(self, text: str) -> None:
        """One line of news."""
        if self._screen is not None:
            self._screen.note(text)
        else:
            print(text, file=self._stream, flush=True)

    def show_films(self, made: int, owed: int) -> None:
        """Show that all trials are done, and how many films since then, as often as `show`."""
        now = time.monotonic()
        if self._films_began is None:
            self._films_began = now
        left = owed * (now - self._films_began) / made if made else None
        text = f"films: {made} made, {owed} to make"
        text += f", {clock_text(left)} left" if left is not None and owed else ""
        if self._screen is not None and now - self._shown >= REFRESH:
            self._shown = now
            self._screen.update(self._picture(text))
        elif self._screen is None and owed and now - self._line >= EVERY:
            self._line = now
            self.note(text)

    def _counts(self) -> str:
        """The counts in words."""
        if self.tally.ran:
            films = self._status.films if self._status is not None else 0
            more = f", {films} films to make" if films else ""
            return self.tally.text(self._seconds_left()) + more
        return "starting" if self._status is None else self._status.first_words

    def _seconds_left(self) -> float | None:
        if self._status is not None:
            return self._status.left
        return self.tally.left / self.tally.rate if self.tally.ran else None

    def _picture(self, films: str | None = None) -> RenderableType:
        """What a terminal shows: bar, counts, where the time goes, servers, the bottleneck; after
        the last trial the counts, and what is said of `films`."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        status, tally = self._status, self.tally
        head = Table.grid(padding=(0, 1))
        bar = ProgressBar(total=max(tally.total, 1), completed=tally.done, width=28)
        head.add_row(bar, f"{tally.done}/{tally.total}", Text(self._counts()))
        if films is not None:
            return Group(head, Text(films)) if films else head
        if status is None:
            return head
        shares = shares_text(status.shares)
        workers = f"{status.workers_text}; {shares}" if shares else status.workers_text
        lines: list[RenderableType] = [head, Text(workers, style="dim")]
        if status.servers:
            lines.append(_table(status))
        if status.bottleneck:
            lines.append(Text(status.bottleneck, style="bold"))
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
    lines += [f"{s.target}: {s.trials} trials, {server_text(s, status.now)}" for s in used]
    return [*lines, status.bottleneck] if status.bottleneck else lines


def summary(shares: Mapping[str, float], status: Status) -> list[str]:
    """The same about a whole run, for its end."""
    lines = [f"time: {shares_text(shares)}, with {status.workers} workers on {status.cores} cores"]
    used = [s for s in _busiest(status.servers) if s.trials]
    many = len(used) > 1
    lines += [f"{s.target}: {f'{s.trials} trials, ' if many else ''}{server_text(s, status.now)}"
              for s in used if s.means]  # fmt: skip
    return lines if shares else []
