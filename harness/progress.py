"""What the user sees while a run goes on: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, TextIO

from robospa.results.records import TrialKey, TrialRecord

EVERY = 15.0
"""Seconds between two plain lines."""


class Tally:
    """Counts of what has come in, and the text that sums them up."""

    def __init__(self, total: int, already: int, work: Mapping[TrialKey, float] | None) -> None:
        """`work` is how much each trial still to run is expected to cost; None if all alike."""
        self.total = total
        self.already = already
        self._work = work
        self._whole = sum(work.values()) if work else float(total - already)
        self._done = 0.0
        self.ran = 0
        self.successes = 0
        self.lost = 0
        self.begun = time.monotonic()

    def add(self, record: TrialRecord) -> None:
        """Count one finished or lost trial."""
        self.ran += 1
        self._done += self._work.get(record.key, 0.0) if self._work else 1.0
        self.successes += record.success
        self.lost += record.end == "infrastructure"

    @property
    def left(self) -> int:
        """Trials still to run."""
        return self.total - self.already - self.ran

    @property
    def rate(self) -> float:
        """Trials a second so far."""
        return self.ran / max(time.monotonic() - self.begun, 1e-9)

    @property
    def seconds_left(self) -> float:
        """Estimate from the work that is done and left: the longest trials come first."""
        spent = time.monotonic() - self.begun
        return spent * (self._whole - self._done) / max(self._done, 1e-9)

    def text(self) -> str:
        """Success so far, speed and time left."""
        scored = self.ran - self.lost
        parts = [f"success {100 * self.successes / scored:.1f} %" if scored else "no result yet"]
        if self.ran:
            parts.append(f"{60 * self.rate:.1f} trials/min")
            parts.append(f"{clock(self.seconds_left)} left")
        if self.lost:
            parts.append(f"{self.lost} lost")
        return ", ".join(parts)


def clock(seconds: float) -> str:
    """`seconds` as 1:02:03 or 2:03."""
    hours, rest = divmod(round(seconds), 3600)
    minutes, secs = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{secs:02d}" if hours else f"{minutes}:{secs:02d}"


class Progress:
    """Shows a `Tally`; use as a context manager."""

    def __init__(
        self,
        total: int,
        already: int = 0,
        stream: TextIO | None = None,
        work: Mapping[TrialKey, float] | None = None,
    ) -> None:
        self.tally = Tally(total, already, work)
        self._stream = stream or sys.stderr
        self._bar: Any = None
        self._task: Any = None
        self._last = 0.0

    def __enter__(self) -> Progress:
        if self._stream.isatty():
            self._start_bar()
        else:
            self.note(f"{self.tally.left} trials to run, {self.tally.already} already done")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _start_bar(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (BarColumn(bar_width=28), MofNCompleteColumn(), TextColumn("{task.description}"))
        self._bar = Bar(*columns, console=Console(file=self._stream))
        self._task = self._bar.add_task("starting", total=self.tally.total)
        self._bar.update(self._task, completed=self.tally.already)
        self._bar.start()

    def add(self, record: TrialRecord) -> None:
        """Count one trial and show it."""
        self.tally.add(record)
        done = self.tally.already + self.tally.ran
        if self._bar is not None:
            self._bar.update(self._task, completed=done, description=self.tally.text())
            return
        now = time.monotonic()
        if self.tally.left == 0 or now - self._last >= EVERY:
            self._last = now
            self.note(f"{done}/{self.tally.total} trials, {self.tally.text()}")

    def note(self, text: str) -> None:
        """One line of news."""
        if self._bar is not None:
            self._bar.console.print(text, style="yellow", highlight=False)
        else:
            print(text, file=self._stream, flush=True)
