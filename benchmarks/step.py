"""Time of a step without its physics, when the policy answers chunks of 50.

    python benchmarks/step.py [--rounds 6] [--json]

Ours is a trial through `run_trial` against a policy server over the wire, with a world that does
nothing: what is measured from the end of one `World.step` to the begin of the next is the harness.
A buffered step is one before which nothing was asked. vla-eval keeps the chunk on its server, so
every step is a round trip with a full observation; openpi's chunk broker is on the client's side.
Sides take turns in blocks of steps.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import wire
from frame import Figure, Result, main
from numpy.typing import NDArray
from run_fakes import FakeWorld, SumTracker, parts

from robospa.clients import connect
from robospa.harness.trial import TrialSetup, run_trial
from robospa.harness.world import Poll, StepResult
from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

STEPS = 500
KEY = TrialKey("Nothing", 1, 100_000)
PEERS = {
    "openpi steps": "openpi's chunk broker",
    "vla-eval raw steps": "vla-eval, raw images",
    "vla-eval steps": "vla-eval as shipped (PNG)",
}


def endless_trial(key: TrialKey, steps: int = STEPS) -> TrialSetup:
    """A trial of `steps` policy actions whose goal is never met."""
    found = parts(key)
    levels = {key.level: replace(found.task.levels[key.level], steps=steps)}
    return replace(found, task=replace(found.task, levels=levels), tracker=SumTracker(math.inf, 1))


class TimedWorld(FakeWorld):
    """A world without physics that measures the time between two of its steps [ms].

    `buffered` are the steps before which nothing was observed, `asked` the others.
    """

    def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
        super().__init__()
        self._view: Observation = {
            "images": dict(zip(wire.CAMERAS, images, strict=True)),
            "state": np.zeros(14, np.float32),
            "ee": np.zeros((2, 8), np.float32),
        }
        self.views = 0
        self._left, self._views_then = 0.0, 0
        self.buffered: list[float] = []
        self.asked: list[float] = []

    def load(self, scene: Scene, contacts: bool = False) -> None:
        self._left = 0.0

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        came = time.perf_counter()
        if self._left:
            kind = self.buffered if self.views == self._views_then else self.asked
            kind.append((came - self._left) * 1e3)
        self._views_then = self.views
        self._left = time.perf_counter()
        return StepResult(50, False)

    def observe(self, spec: PolicySpec) -> Observation:
        self.views += 1
        return self._view.copy()


def measure(rounds: int = 6) -> Result:
    """Blocks of STEPS steps of every side in turns."""
    times: dict[str, list[float]] = {kind: [] for kind in PEERS}
    with wire.sides() as running:
        world = TimedWorld(np.load(running.frames))
        policy = connect(running.serve("robospa"))
        clients = {}
        for kind in (kind for kind in PEERS if not wire.problem_of(kind)):
            broker = kind == "openpi steps"
            url = running.serve("openpi" if broker else "vla-eval steps")
            clients[kind] = running.clients(kind if broker else kind[: -len(" steps")], url, 1)
        for client in clients.values():  # the call that warmed it up was a chunk's first
            wire.ask(client, "49")
        queries = 0
        for _ in range(rounds):
            found = run_trial(world, policy, KEY, policy_seed=0, parts=endless_trial)
            queries += found.policy_calls
            for kind, client in clients.items():
                times[kind] += wire.ask(client, "50" if kind == "vla-eval steps" else str(STEPS))
        policy.close()
    steps = len(world.buffered) + len(world.asked)
    mean = (sum(world.buffered) + sum(world.asked)) / steps
    p99 = float(np.percentile(world.buffered, 99))
    figures = [
        Figure("a buffered step, mean", round(statistics.fmean(world.buffered), 4), "ms", 0.1,
            note=f"median {statistics.median(world.buffered):.4f}, p99 {p99:.4f}, {steps} steps"),
        Figure("observations beyond one a query", world.views - queries, at_most=0,
            note=f"{queries} queries in {steps + rounds} steps"),
    ]  # fmt: skip
    for kind, name in PEERS.items():
        theirs = statistics.fmean(times[kind]) if times[kind] else None
        note = f"{mean:.4g} and {theirs:.4g} ms, means" if theirs else wire.problem_of(kind)
        ratio = theirs and round(mean / theirs, 4)
        figures.append(Figure(f"our step, queries included, beside {name}", ratio, "x", note=note))
    return Result(
        "What a step costs beside its physics",
        figures,
        text="""\
With chunks of 50 actions the harness queries and renders once in 50 steps. A buffered step is
everything between two calls of the simulator. vla-eval keeps chunks on its server, so every step
renders, encodes, sends and waits.""",
        circumstances=f"{running.source}; sides take turns",
        versions=wire.versions(PEERS),
    )


if __name__ == "__main__":
    main(step=measure)
