"""Batch sizes of a model: our server and vla-eval's, side by side.

    python benchmarks/batching.py [--requests 120] [--rounds 2] [--json]

The model takes 50 ms for up to eight observations. Eight clients, each a process of its own, send a
full observation (691 KB), wait for the answer, pause 5 to 15 ms as a simulator would between
two queries at its fastest, and ask again. Nothing is tuned on either side: our server has no knob,
vla-eval's keeps its default wait of 10 ms. Sides take turns; the first batches of a round, while
clients arrive one by one, and the last, when some have finished, count as well.
"""

from __future__ import annotations

import json
import statistics
import time
from dataclasses import dataclass, field

from common import Metric, Result, argument_parser, finish
from sides import Sides, line_of, peer_of, peers_for, sides, tell, versions_of

CLIENTS = 8
IDEAL = CLIENTS / 0.05
"""Requests per second of a model that is always busy with full batches."""
KINDS = {"robospa": "robospa batch", "vla-eval raw": "vla-eval batch"}
NAMES = {"robospa": "ours", "vla-eval raw": "vla-eval, raw images"}
TEXT = """\
The limit is 160 requests/s: eight every 50 ms. Clients pause between an answer and their next
request, and moving eight observations takes the two cores some milliseconds: a server that starts
too early runs batches that are not full, one that waits too long leaves the model idle."""


@dataclass
class SideResult:
    """Batch sizes, requests, seconds and latencies [s] of one side."""

    sizes: list[int] = field(default_factory=list)
    requests: int = 0
    seconds: float = 0.0
    latencies: list[float] = field(default_factory=list)


def measure_side(
    running: Sides, client: str, server: str, found: SideResult, requests: int
) -> None:
    """One round."""
    url = running.serve(server)
    clients = running.clients(client, url, CLIENTS)
    running.fill.write_text("", encoding="utf-8")  # forget the batches that warmed it up
    began = time.perf_counter()
    for process in clients:
        tell(process, f"{requests} pause")
    for process in clients:
        found.latencies += json.loads(line_of(process))
    found.seconds += time.perf_counter() - began
    found.requests += CLIENTS * requests
    found.sizes += [int(x) for x in running.fill.read_text(encoding="utf-8").split()]
    running.close()


def measure(requests: int, rounds: int) -> Result:
    """All figures of one run."""
    peers = peers_for(list(KINDS.values()))
    found = {k: SideResult() for k in KINDS if not peer_of(k) or peers[peer_of(k)].python}
    with sides() as running:
        for _ in range(rounds):
            for kind, side in found.items():
                measure_side(running, kind, KINDS[kind], side, requests)
        source = running.source
    rows: list[Metric] = []
    for kind, name in NAMES.items():
        bar = 0.9 if kind == "robospa" else None
        what = f"{name}: share of a full batch, {CLIENTS} clients, a 50 ms model"
        if kind not in found:
            rows.append(Metric(what, None, note=peers[peer_of(kind)].problem))
            continue
        side = found[kind]
        fill = statistics.fmean(side.sizes) / CLIENTS
        note = f"{len(side.sizes)} calls of the model for {side.requests} requests"
        rows.append(Metric(what, round(fill, 3), at_least=bar, note=note))
        rate = side.requests / side.seconds
        rows.append(
            Metric(f"{name}: throughput", round(rate, 1), "requests/s", note=f"of {IDEAL:g}")
        )
        middle = statistics.median(side.latencies)
        rows.append(Metric(f"{name}: median latency", round(middle, 1), "ms"))
    return Result(
        "batching",
        "How full batches get",
        tuple(rows),
        text=TEXT,
        circumstances=f"{source}; {rounds} rounds, sides take turns",
        versions=versions_of(peers),
    )


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--requests", type=int, default=120)
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    finish(measure(options.requests, options.rounds), options)


if __name__ == "__main__":
    main()
