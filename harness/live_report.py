"""A run's report as a page that stays up to date while the run goes on.

The page is made again when records change, but takes a sixth of one core at most; nothing is
written into the run's folder. `harness.report_server` shows it in a browser.
"""

from __future__ import annotations

import hashlib
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from robospa.results.figures.series import Drawing
from robospa.results.records.films import VIDEOS
from robospa.results.records.manifest import MANIFEST, RunError
from robospa.results.records.run_io import TRIALS, Run, read_run
from robospa.results.report.page import FIGURES, page
from robospa.results.report.report import draw_figures, make_report

FORMATS = ("svg",)
PAUSE_FACTOR = 5.0
"""After the page was made it is not made again for so many times as long as that took."""
FIGURES_SECONDS = 60.0
"""The figures are drawn no more often than that while the run goes on."""
Inputs = tuple[tuple[str, int, int], ...]
"""Names, sizes [bytes] and times [ns] of the files that the page is made from."""


class LiveReport:
    """The page of the run in `folder`, made when it is asked for and something has changed."""

    def __init__(self, folder: Path, published: tuple[str, ...] = (), ci: str = "wilson") -> None:
        """Raises RunError if there is no run in `folder`."""
        self.folder = folder
        self._published, self._ci = published, ci
        self._lock = threading.Lock()
        self._drawn_folder = TemporaryDirectory(prefix="robospa-view-")
        self._inputs: Inputs = ()
        self._page, self._tag = b"", ""
        self._earliest = 0.0
        self._drawings: list[Drawing] = []
        self._drawn_at = -FIGURES_SECONDS
        self.read()

    def close(self) -> None:
        """Remove the drawn figures."""
        self._drawn_folder.cleanup()

    def read(self) -> tuple[bytes, str]:
        """The page as it is now, and a tag that changes with it; raises RunError."""
        with self._lock:
            inputs = self._list_inputs()
            if inputs != self._inputs and time.monotonic() >= self._earliest:
                started = time.monotonic()
                self._page = self._make(read_run(self.folder)).encode()
                self._tag = f'"{hashlib.sha256(self._page).hexdigest()[:24]}"'
                self._inputs = inputs
                self._earliest = time.monotonic() + PAUSE_FACTOR * (time.monotonic() - started)
            return self._page, self._tag

    def _list_inputs(self) -> Inputs:
        found = []
        trials = sorted((self.folder / TRIALS).glob("*.jsonl"))
        for path in (self.folder / MANIFEST, self.folder / VIDEOS, *trials):
            try:
                status = path.stat()
            except FileNotFoundError:
                continue
            found.append((path.name, status.st_size, status.st_mtime_ns))
        if not found:
            raise RunError(f"{self.folder} is not a run: it has no {MANIFEST}")
        return tuple(found)

    def _make(self, run: Run) -> str:
        report = make_report(run, self._published, self._ci)
        drawn = Path(self._drawn_folder.name)
        if not run.without_result or time.monotonic() >= self._drawn_at + FIGURES_SECONDS:
            (drawn / FIGURES).mkdir(exist_ok=True)
            self._drawings = draw_figures(
                report.runs, report.columns, drawn / FIGURES, FORMATS, report.failures
            )
            self._drawn_at = time.monotonic()
        return page(
            report,
            self._drawings,
            self.folder,
            drawn=drawn,
            formats=(),
            live=True,
        )

    def video(self, name: str) -> Path | None:
        """The run's video of that name; None if there is none."""
        home = (self.folder / VIDEOS).resolve()
        path = (home / name).resolve()
        return path if path.parent == home and path.suffix == ".mp4" and path.is_file() else None
