"""Pointing: how long 12,090 questions take on this machine, with a model that answers in 1 ms.

    python benchmarks/pointing.py [--trials 62] [--json]

39 spatial and basic tasks at five levels, `trials` each. Driver, workers, wire and server are the
real ones; the model sleeps for a millisecond and points at the middle of the picture. Wall time
depends on what else the machine does; processor time, of all workers and the driver, does not, and
half of it is what two idle cores need at least.
"""

from __future__ import annotations

import os
import resource
import tempfile
import time
from pathlib import Path

from frame import Figure, Result, main

import robospa
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.server import ServerThread

BAR = 360.0
"""[s] for 12,000 questions."""


class QuickModel:
    """Points at the middle after a millisecond."""

    spec = PolicySpec("quick", cameras=(CameraSpec("head"),), state="none", action="point")

    def reset(self, trial: TrialInfo) -> None:
        """Nothing depends on the trial."""

    def infer(self, observation: Observation) -> list[dict[str, object]]:
        """The same point for every question."""
        time.sleep(0.001)
        return [{"skill": "point", "at": [0.5, 0.5]}]


def used() -> float:
    """Processor time [s] of this process and those that have ended."""
    found = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in found)


def measure(trials: int = 62) -> Result:
    """A whole run."""
    load, before, start = os.getloadavg()[0], used(), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, ServerThread(policy_factory=QuickModel) as server:
        run = robospa.evaluate(
            server.url, tasks="spatial,basic", trials=trials, workers=2, out=Path(folder) / "run"
        )
        count = len(run.records)
    wall, busy = time.perf_counter() - start, used() - before
    scale = 12_000 / count
    note = f"{count} questions, load {load:.1f} before and {os.getloadavg()[0]:.1f} after"
    return Result(
        "Pointing",
        [
            Figure("12,000 questions, wall time", round(wall * scale), "s", at_most=BAR, note=note),
            Figure("12,000 questions, processor time / 2", round(busy * scale / 2), "s"),
            Figure("processor time of a question", round(1e3 * busy / count, 1), "ms"),
        ],
        text="""\
For every question a scene is drawn from its seed, brought to rest and rendered twice: as the model
sees it, and with the number of each pixel's object. The figures include the layouts of a variant's
scenes, which are made once in a process.""",
    )


if __name__ == "__main__":
    main(pointing=measure)
