"""What the user sees while episodes are made.

Episodes of one task take twenty times as long as those of another, so the time left follows from
frames, not from episodes.
"""

from __future__ import annotations

import time
from collections import Counter
from typing import TextIO

from robospa.harness.datasets.jobs import EpisodeAttempt
from robospa.harness.datasets.settings import size_text
from robospa.harness.progress import Bar
from robospa.text import clock_text


class CollectionProgress(Bar):
    """Counts what comes in and shows it. `work` is that of all episodes and `done_work` what was
    done before, in frames; so are `total` and `done` in episodes."""

    def __init__(
        self,
        total: int,
        done: int,
        work: float,
        done_work: float,
        stream: TextIO | None = None,
    ) -> None:
        super().__init__("episodes", total, done, stream)
        self.replaced = self.frames = self.bytes = self.made = 0
        self.times: Counter[str] = Counter()
        self._left = work - done_work
        self._worked = 0.0
        self._began = time.monotonic()

    def add(self, made: EpisodeAttempt, work: float) -> None:
        """Count what came of a seed; an episode like it has `work` frames."""
        self.times.update(made.times)
        if made.accepted:
            self.done += 1
            self.made += 1
            self.frames += made.frames
            self.bytes += len(made.data)
            self._worked += work
        else:
            self.replaced += 1
        self.show(self.text())

    def give_up(self, episodes: int, work: float) -> None:
        """Expect so many episodes less, of `work` frames together."""
        self.total -= episodes
        self._left -= work

    def text(self) -> str:
        """Rate, time left, size so far, seeds that were replaced."""
        passed = max(time.monotonic() - self._began, 1e-9)
        parts = [f"{3600 * self.made / passed:.0f} an hour"]
        if self._worked and self.done < self.total:
            parts.append(f"{clock_text((self._left - self._worked) * passed / self._worked)} left")
        parts.append(size_text(self.bytes))
        if self.replaced:
            parts.append(f"{self.replaced} seeds replaced")
        return ", ".join(parts)

    def cost_text(self) -> str:
        """Where the processor time of an episode went; empty if none was made."""
        if not self.made:
            return ""
        total = sum(self.times.values())
        parts = [f"{name} {100 * spent / max(total, 1e-9):.0f} %" for name, spent in
                 self.times.most_common()]  # fmt: skip
        return (
            f"{total / self.made:.1f} s of processor time and {size_text(self.bytes / self.made)} "
            f"an episode of {self.frames / self.made:.0f} frames: {', '.join(parts)}"
        )
