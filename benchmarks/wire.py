"""What a round trip costs: bare `websockets`, ours, and openpi's client, side by side in one run.

One request is a full observation (three 240x320x3 uint8 frames, 14 + 16 float32, 20 words: about
691 KB), one answer a 50x14 float32 chunk. Every variant has a client and a server process of its
own on loopback, and they take turns request by request in random order, so that caches and other
load on the machine hit all alike. On a busy machine the wall time measures the scheduler as well;
`process_cpu_s` (client, server; with their start) does not.

    bare          sync client and asyncio server of `websockets`, compression off, same bytes
    robospa       our client and server, robospa.v1
    openpi        openpi-client and a server of openpi's form (only if openpi-client is installed)
    robospa+openpi  our client against that server

    python benchmarks/wire.py [--requests 1000] [--out wire.json]
    python benchmarks/wire.py --fill     how full batches get: 8 clients, a 50 ms model
"""

from __future__ import annotations

import argparse
import asyncio
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.clients import connect
from robospa.protocol.codec import encode
from robospa.protocol.messages import Infer, pack
from robospa.protocol.openpi import OpenPiOptions, to_openpi
from robospa.protocol.policy import Observation, PolicySpec, TrialInfo
from robospa.protocol.server import ServerOptions, ServerThread, serve

WARM_UP = 20
TRIAL = TrialInfo("wire", 1, 100_000, "aloha-agilex", "clean", "heldout", "nothing")


def observation() -> dict[str, Any]:
    """A full observation with reproducible noise."""
    rng = np.random.default_rng(0)
    cameras = ("head", "left_wrist", "right_wrist")
    return {
        "images": {c: rng.integers(0, 256, (240, 320, 3), dtype=np.uint8) for c in cameras},
        "state": rng.random(14, dtype=np.float32),
        "ee": rng.random((2, 8), dtype=np.float32),
        "instruction": " ".join(["word"] * 20),
        "step": 0,
    }


class Echo:
    """Answers the same chunk at once."""

    spec = PolicySpec("echo", action_dim=14)

    def __init__(self) -> None:
        self.chunk = np.zeros((50, 14), np.float32)

    def reset(self, trial: TrialInfo) -> None:
        return None

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        return self.chunk


class Slow(Echo):
    """A model that takes 50 ms for up to eight observations; counts its batches."""

    spec = PolicySpec("slow", action_dim=14, batch=8)

    def __init__(self) -> None:
        super().__init__()
        self.sizes: list[int] = []

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[NDArray[np.float32]]:
        self.sizes.append(len(observations))
        time.sleep(0.05)
        return [self.chunk] * len(observations)


# ---------------------------------------------------------------- servers, one process each


async def _plain_server(handler: Any) -> None:
    from websockets.asyncio.server import serve as listen

    async with listen(handler, "127.0.0.1", 0, compression=None, max_size=None) as server:
        print(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}", flush=True)
        await server.serve_forever()


async def _bare(socket: Any) -> None:
    answer = bytes(50 * 14 * 4)
    async for _ in socket:
        await socket.send(answer)


async def _openpi(socket: Any) -> None:
    from openpi_client import msgpack_numpy

    packer, chunk = msgpack_numpy.Packer(), np.zeros((50, 14), np.float32)
    await socket.send(packer.pack({"reset_pose": [0.0] * 6}))
    async for data in socket:
        start = time.monotonic()
        msgpack_numpy.unpackb(data)
        timing = {"infer_ms": (time.monotonic() - start) * 1e3}
        await socket.send(packer.pack({"actions": chunk, "server_timing": timing}))


def _serve(kind: str) -> None:
    if kind == "robospa":
        serve(policy_factory=Echo, port=0, on_ready=lambda url: print(url, flush=True))
    else:
        asyncio.run(_plain_server({"bare": _bare, "openpi": _openpi}[kind]))


# ---------------------------------------------------------------- clients: one call, one round trip


def _bare_client(url: str) -> Callable[[], Any]:
    from websockets.sync.client import connect as open_socket

    socket = open_socket(url, compression=None, max_size=None).__enter__()
    message = pack(Infer(1, observation()))

    def call() -> None:
        socket.send(message)
        socket.recv()

    return call


def _our_client(url: str) -> Callable[[], Any]:
    policy, seen = connect(url), observation()
    policy.reset(TRIAL)
    return lambda: policy.infer(seen)


def _openpi_client(url: str) -> Callable[[], Any]:
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    policy, sent = WebsocketClientPolicy(url), to_openpi(observation(), OpenPiOptions())
    sent["images"] = {name: np.ascontiguousarray(x) for name, x in sent["images"].items()}
    return lambda: policy.infer(sent)


VARIANTS: dict[str, tuple[str, Callable[[str], Callable[[], Any]]]] = {
    "bare": ("bare", _bare_client),
    "robospa": ("robospa", _our_client),
    "openpi": ("openpi", _openpi_client),
    "robospa+openpi": ("openpi", _our_client),
}


def round_trips(requests: int) -> dict[str, Any]:
    """Medians and tails [ms] per variant, and ratios to bare."""
    usable = importlib.util.find_spec("openpi_client") is not None
    variants = {k: v for k, v in VARIANTS.items() if usable or v[0] != "openpi"}
    servers = {name: _start("--serve", kind) for name, (kind, _) in variants.items()}
    urls = {name: _line(server) for name, server in servers.items()}
    clients = {name: _start("--call", name, urls[name]) for name in variants}
    try:
        times = _measure(clients, requests)
        cpu = {n: (_cpu_seconds(clients[n].pid), _cpu_seconds(servers[n].pid)) for n in variants}
    finally:
        for process in (*servers.values(), *clients.values()):  # in this order without noise
            process.terminate()
            process.wait()
    medians = {name: statistics.median(values) for name, values in times.items()}
    return {
        "message_bytes": len(pack(Infer(1, observation()))),
        "openpi_message_bytes": len(encode(to_openpi(observation(), OpenPiOptions()))),
        "median_ms": {name: round(value, 3) for name, value in medians.items()},
        "p10_ms": {n: round(float(np.percentile(v, 10)), 3) for n, v in times.items()},
        "p99_ms": {n: round(float(np.percentile(v, 99)), 3) for n, v in times.items()},
        "process_cpu_s": {n: [round(x, 3) for x in value] for n, value in cpu.items()},
        "ratio_to_bare": {n: round(value / medians["bare"], 3) for n, value in medians.items()},
    }


def _start(*words: str) -> subprocess.Popen[str]:
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, __file__, *words], stdin=pipe, stdout=pipe, text=True)


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def _measure(clients: dict[str, subprocess.Popen[str]], requests: int) -> dict[str, list[float]]:
    times: dict[str, list[float]] = {name: [] for name in clients}
    order, rng = list(clients), np.random.default_rng(0)
    for number in range(requests + WARM_UP):
        rng.shuffle(order)
        for name in order:
            stdin = clients[name].stdin
            assert stdin is not None
            stdin.write("go\n")
            stdin.flush()
            spent = float(_line(clients[name]))
            if number >= WARM_UP:
                times[name].append(spent)
    return times


def _call(name: str, url: str) -> None:
    """A client process: one round trip per line of input, its milliseconds as output."""
    call = VARIANTS[name][1](url)
    for _ in sys.stdin:
        start = time.perf_counter()
        call()
        print((time.perf_counter() - start) * 1e3, flush=True)


def _cpu_seconds(pid: int) -> float:
    """Processor time of a process and its threads so far (Linux; 0 elsewhere)."""
    files = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(file.read_text().split()[0]) for file in files) / 1e9


def batch_fill(clients: int = 8, requests: int = 40) -> dict[str, Any]:
    """How full the batches of a 50 ms model get, with clients that pause 5 to 15 ms."""
    policy = Slow()

    def drive(url: str, number: int) -> None:
        rng, remote, seen = np.random.default_rng(number), connect(url), observation()
        remote.reset(TRIAL)
        for _ in range(requests):
            remote.infer(seen)
            time.sleep(rng.uniform(0.005, 0.015))
        remote.end()
        remote.close()

    with ServerThread(policy, options=ServerOptions()) as server:
        threads = [threading.Thread(target=drive, args=(server.url, n)) for n in range(clients)]
        start = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        wall = time.perf_counter() - start
    return {
        "clients": clients,
        "calls": len(policy.sizes),
        "mean_batch": round(statistics.fmean(policy.sizes), 2),
        "fill": round(statistics.fmean(policy.sizes) / clients, 3),
        "requests_per_s": round(clients * requests / wall, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--serve", choices=("bare", "robospa", "openpi"), help=argparse.SUPPRESS)
    parser.add_argument("--requests", type=int, default=1000)
    parser.add_argument("--call", nargs=2, metavar=("NAME", "URL"), help=argparse.SUPPRESS)
    parser.add_argument("--fill", action="store_true")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    if arguments.serve:
        return _serve(arguments.serve)
    if arguments.call:
        return _call(*arguments.call)
    result: dict[str, Any] = {
        "machine": {"cpus": os.cpu_count(), "load": os.getloadavg()[0], "cpu": platform.machine()},
        "versions": {"python": platform.python_version(), "websockets": version("websockets")},
        "requests": arguments.requests,
    }
    if arguments.fill:
        result["batching"] = batch_fill()
    else:
        result.update(round_trips(arguments.requests))
    text = json.dumps(result, indent=2)
    print(text)
    if arguments.out:
        arguments.out.write_text(text + "\n", encoding="utf-8")
    return None


if __name__ == "__main__":
    main()
