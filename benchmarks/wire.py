"""Time of a round trip: bare `websockets`, ours and the peers', side by side in one run.

    python benchmarks/wire.py [--requests 300] [--rounds 6] [--json]

One request is a full observation (three 240x320x3 uint8 frames, 14 + 16 float32, 20 words: about
691 KB), one answer a 50x14 float32 chunk. Every side has processes of its own on loopback, peers in
their own environments (`peers.py`), and sides take turns in random order: request by request with
one client, in blocks of about a second with eight. `wire_sides.py` says what each side does.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import time

import numpy as np
from common import Json, Metric, Result, argument_parser, finish
from peers import Peer, environment
from sides import Sides, line_of, peer_of, peers_for, sides, tell, versions_of

CLIENTS = ("bare", "robospa", "openpi", "vla-eval raw", "vla-eval", "xpolicylab")
NAMES = {
    "bare": "bare websockets",
    "robospa": "ours",
    "openpi": "openpi-client, server of openpi's form",
    "vla-eval raw": "vla-eval, raw images",
    "vla-eval": "vla-eval as shipped (PNG)",
    "xpolicylab": "XPolicyLab's wire form",
}
WARM_UP = 10
SLOW_MS = 40.0
"""A side slower than this takes part in every tenth request only."""
MANY = 8
TEXT = """\
One request is a full observation: three 240x320x3 frames, 30 floats, 20 words; the answer is 50x14
float32. Times are the client's own clock. Bare websockets moves the same bytes and reads nothing.

vla-eval's default encodes every frame as PNG; raw images exist only as a Python call in its
benchmark process. XPolicyLab's client and server are on GitHub only, in no package (what pip says
is noted): its row is a client and a server written here that send what its own send, with the same
libraries and websockets' defaults, compression included; its own checks come on top."""


def one_client(running: Sides, servers: dict[str, str], requests: int) -> dict[str, list[float]]:
    """Milliseconds of every round trip of every side, one client each."""
    clients = {kind: running.clients(kind, url, 1)[0] for kind, url in servers.items()}
    for client in clients.values():
        tell(client, str(WARM_UP))
    warm = {kind: json.loads(line_of(client)) for kind, client in clients.items()}
    slow = {kind for kind, times in warm.items() if statistics.median(times) > SLOW_MS}
    times: dict[str, list[float]] = {kind: [] for kind in clients}
    order, rng = list(clients), np.random.default_rng(0)
    for number in range(requests):
        rng.shuffle(order)
        for kind in order:
            if kind not in slow or number % 10 == 0:
                tell(clients[kind], "1")
                times[kind] += json.loads(line_of(clients[kind]))
    return times


def block(clients: list[subprocess.Popen[str]], count: int) -> tuple[list[float], float]:
    """`count` round trips of all clients at once; their milliseconds, and the wall time [s]."""
    began = time.perf_counter()
    for client in clients:
        tell(client, str(count))
    found = [json.loads(line_of(client)) for client in clients]
    return [ms for times in found for ms in times], time.perf_counter() - began


def many_clients(
    running: Sides, servers: dict[str, str], alone: dict[str, float], rounds: int
) -> dict[str, tuple[list[float], float]]:
    """Milliseconds, and round trips per second, of every side with MANY clients at once."""
    clients = {kind: running.clients(kind, url, MANY) for kind, url in servers.items()}
    counts = {kind: int(np.clip(1000 / (MANY * ms), 2, 60)) for kind, ms in alone.items()}
    times: dict[str, list[float]] = {kind: [] for kind in clients}
    walls = dict.fromkeys(clients, 0.0)
    order, rng = list(clients), np.random.default_rng(1)
    for _ in range(rounds):
        rng.shuffle(order)
        for kind in order:
            spent, wall = block(clients[kind], counts[kind])
            times[kind] += spent
            walls[kind] += wall
    return {kind: (times[kind], len(times[kind]) / walls[kind]) for kind in clients}


def rows_of(name: str, times: dict[str, list[float]], peers: dict[str, Peer]) -> list[Metric]:
    """Medians, and ours beside the limit and every peer."""
    medians = {kind: statistics.median(values) for kind, values in times.items()}
    rows = []
    for kind in CLIENTS:
        what = f"{NAMES[kind]}, {name}: median"
        if kind not in medians:
            rows.append(Metric(what, None, "ms", note=peers[peer_of(kind)].problem))
            continue
        p10, p99 = (float(np.percentile(times[kind], p)) for p in (10, 99))
        note = f"fastest tenth {p10:.2f}, p99 {p99:.1f}, {len(times[kind])} round trips"
        rows.append(Metric(what, round(medians[kind], 3), "ms", note=note))
    for kind in [kind for kind in CLIENTS if kind != "robospa"]:
        what = f"round trip beside {NAMES[kind]}, {name}"
        bar = 1.25 if kind == "bare" else 1.0
        if kind in medians:
            ratio = round(medians["robospa"] / medians[kind], 3)
            rows.append(Metric(what, ratio, "x", at_most=bar))
        else:
            rows.append(Metric(what, None, "x", at_most=bar, note=peers[peer_of(kind)].problem))
    return rows


def measure(requests: int, rounds: int) -> Result:
    """All figures of one run."""
    peers = peers_for(list(CLIENTS))
    usable = [k for k in CLIENTS if not peer_of(k) or peers[peer_of(k)].python]
    with sides() as running:
        urls = {kind: running.serve(kind.removesuffix(" raw")) for kind in usable}
        single = one_client(running, urls, requests)
        alone = {kind: statistics.median(values) for kind, values in single.items()}
        crowd = many_clients(running, urls, alone, rounds)
        size, source = len(running.message), running.source
    rows = rows_of("1 client", single, peers)
    rows += rows_of(f"{MANY} clients", {k: v[0] for k, v in crowd.items()}, peers)
    rows += [
        Metric(f"{NAMES[kind]}, {MANY} clients: throughput", round(rate, 1), "round trips/s")
        for kind, (_, rate) in crowd.items()
    ]
    missing = environment("xpolicylab")
    rows.append(
        Metric("XPolicyLab's own client", None, "ms", note=missing.problem or "has a package now")
    )
    data: Json = {"message_bytes": size, "frames": source}
    return Result(
        "wire",
        "What a round trip costs",
        tuple(rows),
        text=TEXT,
        circumstances=f"{source}; sides take turns",
        data=data,
        versions=versions_of({**peers, "xpolicylab": missing}),
    )


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--requests", type=int, default=300)
    parser.add_argument("--rounds", type=int, default=6)
    options = parser.parse_args()
    finish(measure(options.requests, options.rounds), options)


if __name__ == "__main__":
    main()
