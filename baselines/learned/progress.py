"""How a training gets on: a line now and then, a file with every line, and a picture of it."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path

LOSSES, PICTURE = "loss.csv", "loss.png"


class TrainingLog:
    """Notes the losses of a training of `total` steps in `folder`, and tells of them.

    `done` steps were made before: what an earlier training noted after them is dropped, since those
    steps are made again.
    """

    def __init__(
        self,
        folder: Path,
        total: int,
        done: int = 0,
        say: Callable[[str], None] = print,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._total, self._begun = folder / LOSSES, total, done
        self._say, self._clock, self._start = say, clock, clock()
        kept = [row for row in read_losses(folder) if row["step"] <= done]
        if self._path.exists():
            self._path.unlink()
        self._names: list[str] = []
        for row in kept:
            self._write(row)

    def note(self, step: int, values: Mapping[str, float]) -> None:
        """Note the `values` (losses, errors) after `step`."""
        self._write({"step": step, **values})
        spent = self._clock() - self._start
        rate = (step - self._begun) / spent if spent > 0 else 0.0
        left = f", {duration((self._total - step) / rate)} left" if rate > 0 else ""
        shown = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
        self._say(f"step {step:,} of {self._total:,}: {shown}; {rate:.1f} steps/s{left}")

    def _write(self, row: Mapping[str, float]) -> None:
        new = not self._names
        self._names = self._names or list(row)
        with self._path.open("a", newline="") as file:
            writer = csv.writer(file)
            if new:
                writer.writerow(self._names)
            writer.writerow([_plain(name, row.get(name, math.nan)) for name in self._names])


def _plain(name: str, value: float) -> str:
    return str(int(value)) if name == "step" else f"{value:.6g}"


def duration(seconds: float) -> str:
    """`1:02:03` or `2:03`, rounded to seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def read_losses(folder: Path) -> list[dict[str, float]]:
    """The noted lines of the training in `folder`, by column; none if there is no file. A line that
    was cut short is dropped."""
    path = folder / LOSSES
    if not path.exists():
        return []
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    names = rows[0] if rows else []
    found = []
    for row in rows[1:]:
        try:
            found.append({name: float(v) for name, v in zip(names, row, strict=True)})
        except ValueError:
            continue
    return found


def draw_losses(folder: Path) -> Path | None:
    """A picture of the noted losses, beside them; None where Matplotlib is not installed."""
    try:
        from robospa.results.figures.curves import draw_losses
    except ImportError:
        return None
    rows = read_losses(folder)
    if not rows:
        return None
    path = folder / PICTURE
    try:
        draw_losses(rows, path)
    except ImportError:
        return None
    return path
