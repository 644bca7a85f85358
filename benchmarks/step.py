"""Time of a step without its physics, when the policy answers chunks of 50.

    python benchmarks/step.py [--rounds 6] [--json]

Ours is a trial through `run_trial` against a policy server over the wire, with a world that does
nothing: what is measured from the end of one `World.step` to the begin of the next is the harness.
A buffered step is one before which nothing was asked. vla-eval keeps the chunk on its server, so
every step is a round trip with a full observation; openpi's chunk broker is on the client's side.
Sides take turns in blocks of steps; medians are over steps, means over everything.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Sequence

import numpy as np
from common import Metric, Result, argument_parser, finish
from idle_world import IdleWorld, endless_trial
from numpy.typing import NDArray
from peers import Peer
from sides import line_of, peer_of, peers_for, sides, tell, versions_of
from wire_sides import CAMERAS, frames

from robospa.clients import connect
from robospa.harness.trial import TrialParts, run_trial
from robospa.harness.world import Poll, StepResult
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import Policy, PolicySpec
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

STEPS = 500
KEY = TrialKey("Nothing", 1, 100_000)
TEXT = """\
With chunks of 50 actions the harness asks once in 50 steps and renders only then. A buffered step
is everything between two calls of the simulator: choosing the action, keeping it for the record,
counting, the clocks. vla-eval keeps chunks on its server: every step renders, encodes, sends and
waits."""
NAMES = {
    "openpi steps": "openpi's chunk broker",
    "vla-eval raw steps": "vla-eval, raw images",
    "vla-eval steps": "vla-eval as shipped (PNG)",
}


class TimedWorld(IdleWorld):
    """An idle world that measures the time between two of its steps [ms].

    `buffered` are the steps before which nothing was observed, `asked` the others.
    """

    def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
        super().__init__()
        self._images = dict(zip(CAMERAS, images, strict=True))
        self._view: Observation = {
            "images": self._images,
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

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        return self._images[camera.name]


def parts(key: TrialKey) -> TrialParts:
    """A trial of STEPS steps."""
    return endless_trial(key, STEPS)


def our_block(world: TimedWorld, policy: Policy) -> int:
    """One trial of STEPS steps; how often the policy was asked."""
    return run_trial(world, policy, KEY, policy_seed=0, parts=parts).policy_calls


def peer_rows(kind: str, spent: list[float], peer: Peer) -> list[Metric]:
    """Mean and median of a peer's steps."""
    what = f"{NAMES[kind]}: a step, mean"
    if not spent:
        return [Metric(what, None, "ms", note=peer.problem)]
    note = f"median {statistics.median(spent):.3f}, {len(spent)} steps"
    return [Metric(what, round(statistics.fmean(spent), 4), "ms", note=note)]


def measure(rounds: int) -> Result:
    """All figures of one run."""
    peers = peers_for(list(NAMES))
    times: dict[str, list[float]] = {kind: [] for kind in NAMES}
    usable = [kind for kind in NAMES if peers[peer_of(kind)].python]
    with sides() as running:
        world = TimedWorld(frames(str(running.frames)))
        policy = connect(running.serve("robospa"))
        servers = {"openpi steps": "openpi"}
        clients = {}
        for kind in usable:
            url = running.serve(servers.get(kind, "vla-eval steps"))
            name = kind if kind == "openpi steps" else kind.removesuffix(" steps")
            clients[kind] = running.clients(name, url, 1)[0]
        for client in clients.values():  # the call that warmed it up was a chunk's first
            tell(client, "49")
            line_of(client)
        queries = 0
        for _ in range(rounds):
            queries += our_block(world, policy)
            for kind, client in clients.items():
                tell(client, "50" if kind == "vla-eval steps" else str(STEPS))
                times[kind] += json.loads(line_of(client))
        policy.close()
    steps = len(world.buffered) + len(world.asked)
    mean = (sum(world.buffered) + sum(world.asked)) / steps
    p99 = float(np.percentile(world.buffered, 99))
    note = f"median {statistics.median(world.buffered):.4f}, p99 {p99:.4f}, {steps} steps"
    rows = [
        Metric("a buffered step, mean", round(statistics.fmean(world.buffered), 4), "ms",
            at_most=0.1, note=note),
        Metric("observations beyond one a query", world.views - queries, "", at_most=0,
            note=f"{queries} queries in {steps + rounds} steps"),
        Metric("ours: a step, queries included, mean", round(mean, 4), "ms"),
    ]  # fmt: skip
    for kind in NAMES:
        rows += peer_rows(kind, times[kind], peers[peer_of(kind)])
        if times[kind]:
            what = f"our step, queries included, beside {NAMES[kind]}"
            rows.append(Metric(what, round(mean / statistics.fmean(times[kind]), 4), "x"))
    circumstances = f"{running.source}; sides take turns"
    return Result(
        "step",
        "What a step costs beside its physics",
        tuple(rows),
        text=TEXT,
        circumstances=circumstances,
        versions=versions_of(peers),
    )


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--rounds", type=int, default=6)
    options = parser.parse_args()
    finish(measure(options.rounds), options)


if __name__ == "__main__":
    main()
