"""Round trips of a full observation, and batches of a model: ours, bare websockets, the peers.

    python benchmarks/wire.py wire [--requests 300] [--rounds 6] [--json]
    python benchmarks/wire.py batching [--requests 120] [--rounds 2] [--json]

One request is a full observation (three 240x320x3 uint8 frames, 14 + 16 float32, 20 words: about
691 KB), one answer a 50x14 float32 chunk. Every side has processes of its own on loopback, peers in
environments of their own (.venv-peers, made from PyPI), and `wire_sides.py` says what each does. In
`wire` sides take turns in random order: request by request with one client, in blocks of about a
second with eight. In `batching` the model takes 50 ms for up to eight observations, and each of
eight clients pauses 5 to 15 ms between an answer and its next request, as a simulator would at its
fastest; the first and the last batches of a round count as well.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from frame import Figure, Result, main
from wire_sides import CAMERAS, observation

from robospa.protocol.messages import Infer, pack

SCRIPT = Path(__file__).with_name("wire_sides.py")
PEERS = Path(__file__).resolve().parents[1] / ".venv-peers"
REQUIREMENTS: Mapping[str, tuple[str, ...]] = {
    "vla-eval": ("vla-eval",),
    "openpi-client": ("openpi-client", "typing_extensions"),  # imports it, does not ask for it
    "xpolicylab's wire": ("msgpack-numpy", "msgpack", "websockets", "numpy"),
}
"""What pip is asked for. XPolicyLab's own code is not on PyPI."""
SIDES = {
    "bare": "bare websockets",
    "robospa": "ours",
    "openpi": "openpi-client, openpi-like server",
    "vla-eval raw": "vla-eval, raw images",
    "vla-eval": "vla-eval as shipped (PNG)",
    "xpolicylab": "XPolicyLab's wire form",
}
WARM_UP = 10
SLOW_MS = 40.0
"""A side slower than this takes part in every tenth request only."""
MANY = 8
Times = dict[str, list[float]]
"""Milliseconds of every round trip, by side."""


@dataclass(frozen=True)
class Peer:
    """An environment: its interpreter and version, or why there is none."""

    python: Path | None
    version: str = ""
    problem: str = ""


@cache
def peer(name: str) -> Peer:
    """The peer's environment, made if it is missing."""
    folder = PEERS / name.replace(" ", "_").replace("'", "")
    python, mark, wanted = folder / "bin" / "python", folder / "installed.txt", REQUIREMENTS[name]
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted]
    if not (mark.exists() and mark.read_text(encoding="utf-8") == " ".join(wanted)):
        for command in ([sys.executable, "-m", "venv", "--clear", str(folder)], pip):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                shutil.rmtree(folder, ignore_errors=True)
                errors = [x for x in done.stderr.splitlines() if x.startswith("ERROR")]
                why = (errors or [done.stderr.strip()])[-1]
                return Peer(None, problem=f"pip install {wanted[0]}: {why}")
        mark.write_text(" ".join(wanted), encoding="utf-8")
    code = f"from importlib.metadata import version; print(version({wanted[0]!r}))"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True)
    return Peer(python, done.stdout.strip())


def peer_of(kind: str) -> str:
    """The entry of `REQUIREMENTS` that a kind of server or client needs; "" for ours."""
    if kind.startswith("vla-eval"):
        return "vla-eval"
    if kind.startswith("xpolicylab"):
        return "xpolicylab's wire"
    return "openpi-client" if kind.startswith("openpi") else ""


def problem_of(kind: str) -> str:
    """Why a kind cannot be measured, "" if it can."""
    return peer(name).problem if (name := peer_of(kind)) else ""


def versions(kinds: Iterable[str]) -> dict[str, str]:
    """For the result: what was measured, and what was not."""
    names = dict.fromkeys(name for kind in kinds if (name := peer_of(kind)))
    return {name: peer(name).version or "not installed" for name in names}


def picture_frames() -> tuple[Any, str]:
    """Three frames (3, 240, 320, 3) uint8, and where they come from: their encoders mind."""
    try:
        from physics import table_of_blocks

        from robospa.harness.sim.sapien_world import SapienWorld
        from robospa.protocol.policy import PolicySpec

        world = SapienWorld(render=True)
        world.load(table_of_blocks(8))
        images = world.observe(PolicySpec("frames"))["images"]
        world.close()
        return np.stack([images[name] for name in CAMERAS]), "rendered frames"
    except (ImportError, RuntimeError):  # no simulator, or nothing to draw with
        noise = np.random.default_rng(0).integers(0, 256, (3, 240, 320, 3), dtype=np.uint8)
        return noise, "frames of noise, because nothing could be rendered here"


class Sides:
    """Processes of one run; `frames` is the file with the pictures."""

    def __init__(self, folder: Path) -> None:
        self.frames, self.fill = folder / "frames.npy", folder / "fill.txt"
        images, self.source = picture_frames()
        np.save(self.frames, images)
        message = folder / "message.bin"
        message.write_bytes(pack(Infer(1, observation(str(self.frames)))))
        self._environ = {**os.environ, "FILL": str(self.fill), "MESSAGE": str(message)}
        self._running: list[subprocess.Popen[str]] = []

    def start(self, *words: str) -> subprocess.Popen[str]:
        """A process of `wire_sides.py` in the environment of its kind."""
        name = peer_of(words[1])
        python = peer(name).python if name else sys.executable
        process = subprocess.Popen(
            [str(python), str(SCRIPT), *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=self._environ,
        )
        self._running.append(process)
        return process

    def serve(self, kind: str) -> str:
        """Start a server; its URL."""
        return line_of(self.start("serve", kind))

    def clients(self, kind: str, url: str, count: int) -> list[subprocess.Popen[str]]:
        """Start clients, connected and warm."""
        started = [self.start("call", kind, url, str(self.frames)) for _ in range(count)]
        for client in started:
            if line_of(client) != "ready":
                raise RuntimeError(f"a client of {kind} did not start")
        return started

    def close(self) -> None:
        """End all processes, clients first."""
        for process in reversed(self._running):
            process.terminate()
        for process in self._running:
            process.wait(10)
        self._running = []


@contextmanager
def sides() -> Iterator[Sides]:
    """Processes that end with the block."""
    with tempfile.TemporaryDirectory() as folder:
        running = Sides(Path(folder))
        try:
            yield running
        finally:
            running.close()


def line_of(process: subprocess.Popen[str]) -> str:
    """The next line that a process prints."""
    assert process.stdout is not None
    return process.stdout.readline().strip()


def ask(processes: list[subprocess.Popen[str]], words: str) -> list[float]:
    """Have clients make round trips, all at once; milliseconds of each."""
    for process in processes:
        assert process.stdin is not None
        process.stdin.write(words + "\n")
        process.stdin.flush()
    return [ms for process in processes for ms in json.loads(line_of(process))]


def one_client(running: Sides, servers: dict[str, str], requests: int) -> Times:
    """Round trips of every side, one client each."""
    clients = {kind: running.clients(kind, url, 1) for kind, url in servers.items()}
    warm = {kind: ask(client, str(WARM_UP)) for kind, client in clients.items()}
    slow = {kind for kind, times in warm.items() if statistics.median(times) > SLOW_MS}
    times: Times = {kind: [] for kind in clients}
    order, rng = list(clients), np.random.default_rng(0)
    for number in range(requests):
        rng.shuffle(order)
        for kind in order:
            if kind not in slow or number % 10 == 0:
                times[kind] += ask(clients[kind], "1")
    return times


def many_clients(
    running: Sides, servers: dict[str, str], alone: dict[str, float], rounds: int
) -> tuple[Times, dict[str, float]]:
    """Round trips, and how many a second, of every side with MANY clients at once."""
    clients = {kind: running.clients(kind, url, MANY) for kind, url in servers.items()}
    counts = {kind: int(np.clip(1000 / (MANY * ms), 2, 60)) for kind, ms in alone.items()}
    times: Times = {kind: [] for kind in clients}
    walls = dict.fromkeys(clients, 0.0)
    order, rng = list(clients), np.random.default_rng(1)
    for _ in range(rounds):
        rng.shuffle(order)
        for kind in order:
            began = time.perf_counter()
            times[kind] += ask(clients[kind], str(counts[kind]))
            walls[kind] += time.perf_counter() - began
    return times, {kind: len(times[kind]) / walls[kind] for kind in clients}


def beside_peers(name: str, times: Times, rates: Mapping[str, float]) -> Iterator[Figure]:
    """Ours beside the limit and every peer."""
    median, p99 = (
        {kind: float(np.percentile(values, p)) for kind, values in times.items()} for p in (50, 99)
    )
    for kind in (kind for kind in SIDES if kind != "robospa"):
        what, bar = f"beside {SIDES[kind]}, {name}", 1.25 if kind == "bare" else 1.0
        if kind not in median:
            yield Figure(what, None, "x", at_most=bar, note=problem_of(kind))
            continue
        note = f"{median['robospa']:.4g} and {median[kind]:.4g} ms, p99 {p99['robospa']:.1f} and "
        note += f"{p99[kind]:.1f}"
        if rates:
            note += f"; {rates['robospa']:.1f} and {rates[kind]:.1f} a second"
        yield Figure(what, round(median["robospa"] / median[kind], 3), "x", bar, note=note)


def round_trips(requests: int = 300, rounds: int = 6) -> Result:
    """One client, then eight."""
    with sides() as running:
        urls = {k: running.serve(k.removesuffix(" raw")) for k in SIDES if not problem_of(k)}
        single = one_client(running, urls, requests)
        alone = {kind: statistics.median(values) for kind, values in single.items()}
        crowd, rates = many_clients(running, urls, alone, rounds)
    crowded = beside_peers(f"{MANY} clients", crowd, rates)
    return Result(
        "What a round trip costs",
        [*beside_peers("1 client", single, {}), *crowded],
        text="""\
A request is a full observation: three 240x320x3 frames, 30 floats and 20 words; the answer is 50x14
float32. The figure is our median over the peer's; notes have both medians. Bare websockets moves
the same bytes and reads nothing. vla-eval encodes every frame as PNG by default; raw images exist
only as a Python call in its benchmark process. XPolicyLab's client and server are in no package: a
client and a server of ours send the same messages with the same libraries and compression.""",
        circumstances=f"{running.source}; sides take turns",
        versions=versions(SIDES),
    )


def batching(requests: int = 120, rounds: int = 2) -> Result:
    """Batch sizes of a model: our server and vla-eval's, side by side, nothing tuned."""
    kinds = {"robospa": "robospa batch", "vla-eval raw": "vla-eval batch"}
    sizes: dict[str, list[int]] = {kind: [] for kind in kinds}
    times: Times = {kind: [] for kind in kinds}
    seconds = dict.fromkeys(kinds, 0.0)
    usable = [kind for kind in kinds if not problem_of(kind)]
    with sides() as running:
        for kind in usable * rounds:
            url = running.serve(kinds[kind])
            clients = running.clients(kind, url, MANY)
            running.fill.write_text("", encoding="utf-8")  # forget the batches that warmed it up
            began = time.perf_counter()
            times[kind] += ask(clients, f"{requests} pause")
            seconds[kind] += time.perf_counter() - began
            sizes[kind] += [int(x) for x in running.fill.read_text(encoding="utf-8").split()]
            running.close()
    figures = []
    for kind in kinds:
        what = f"{SIDES[kind]}: share of a full batch"
        if kind not in usable:
            figures.append(Figure(what, None, note=problem_of(kind)))
            continue
        count = len(times[kind])
        figures += [
            Figure(what, round(statistics.fmean(sizes[kind]) / MANY, 3),
                at_least=0.9 if kind == "robospa" else None,
                note=f"{len(sizes[kind])} calls of the model for {count} requests"),
            Figure(f"{SIDES[kind]}: throughput", round(count / seconds[kind], 1), "requests/s",
                note=f"of {MANY / 0.05:g}"),
            Figure(f"{SIDES[kind]}: median latency", round(statistics.median(times[kind]), 1),
                "ms"),
        ]  # fmt: skip
    return Result(
        "How full batches get",
        figures,
        text="""\
Eight clients ask a model that takes 50 ms, so the limit is 160 requests/s. A server that starts
early runs batches that are not full; one that waits too long leaves the model idle.""",
        circumstances=f"{running.source}; {rounds} rounds, sides take turns",
        versions=versions(kinds.values()),
    )


if __name__ == "__main__":
    main(wire=round_trips, batching=batching)
