"""Starting the servers and clients of `wire_sides.py`, each in its own environment and process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from peers import Peer, environment
from wire_sides import CAMERAS, observation

from robospa.protocol.messages import Infer, pack

SCRIPT = Path(__file__).with_name("wire_sides.py")
OURS = ("bare", "robospa")


def peer_of(kind: str) -> str:
    """The entry of `peers.REQUIREMENTS` that a kind of server or client needs; "" for ours."""
    if kind.startswith("vla-eval"):
        return "vla-eval"
    if kind.startswith("xpolicylab"):
        return "xpolicylab's wire"
    return "openpi-client" if kind.startswith("openpi") else ""


def peers_for(kinds: list[str]) -> dict[str, Peer]:
    """The peers that these kinds need, installed or with the reason why not."""
    return {name: environment(name) for name in dict.fromkeys(map(peer_of, kinds)) if name}


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
        self.message = pack(Infer(1, observation(str(self.frames))))
        message.write_bytes(self.message)
        self._environ = {**os.environ, "FILL": str(self.fill), "MESSAGE": str(message)}
        self._running: list[subprocess.Popen[str]] = []

    def start(self, *words: str) -> subprocess.Popen[str]:
        """A process of `wire_sides.py` in the environment of its kind."""
        peer = peer_of(words[1])
        python = environment(peer).python if peer else Path(sys.executable)
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
        """End all processes."""
        for process in reversed(self._running):  # clients first
            process.terminate()
        for process in self._running:
            process.wait(10)
        self._running = []


def line_of(process: subprocess.Popen[str]) -> str:
    """The next line that a process prints."""
    assert process.stdout is not None
    return process.stdout.readline().strip()


def tell(process: subprocess.Popen[str], words: str) -> None:
    """Write a line to a process."""
    assert process.stdin is not None
    process.stdin.write(words + "\n")
    process.stdin.flush()


def cpu_seconds(process: subprocess.Popen[str]) -> float:
    """Processor time of a process and its threads so far (Linux; 0 elsewhere)."""
    files = Path(f"/proc/{process.pid}/task").glob("*/schedstat")
    return sum(int(file.read_text().split()[0]) for file in files) / 1e9


@contextmanager
def sides() -> Iterator[Sides]:
    """Processes that end with the block."""
    with tempfile.TemporaryDirectory() as folder:
        running = Sides(Path(folder))
        try:
            yield running
        finally:
            running.close()


def versions_of(peers: Mapping[str, Peer]) -> dict[str, str]:
    """For the result: what was measured, and what was not."""
    return {name: peer.version or "not installed" for name, peer in peers.items()}
