"""The process between the driver of a run and a Ray cluster: the only one here that loads Ray.

Ray ends the process that uses it when its cluster goes away, and prints as it likes. Here it may:
its output goes to a file, and if this process ends the driver says so and keeps what it has.

From the driver: ("log", path), ("hire", name), ("send", name, message), ("kill", name), ("stop",).
To the driver: ("connected", nodes) or ("trouble", text) first; then ("room", count),
("placed", name), ("waiting", name), ("said", name, Heard), ("gone", name, text), ("news", text),
("trouble", text).
"""

from __future__ import annotations

import contextlib
import importlib
import os
import queue
import signal
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from robospa.harness.running.executor import Message
from robospa.harness.running.ray_messages import pack_order, unpack_heard
from robospa.harness.running.ray_node import actor_class, versions
from robospa.harness.running.worker import die_with_driver
from robospa.protocol.errors import DecodeError

LOOK_SECONDS = 1.0
"""How often the nodes are counted."""
HEAR_SECONDS = 5.0
"""A worker with nothing of weight to say is heard this often."""
NODES_SECONDS = 600.0
"""How long a run waits for a node if it has lost them all."""
BUSY_SECONDS = 60.0
"""A worker that Ray gives no CPUs for so long is worth a line."""
BAD_STARTS = 3
"""After so many failed starts on it a node is left out."""


@dataclass(frozen=True)
class RaySettings:
    """Where the cluster is and what a worker takes of it: `address` is auto, local, host:port or
    ray://host:port; at most `workers` workers, 0 for as many as fit."""

    address: str = "auto"
    workers: int = 0
    cpus: float = 1.0
    gpus: float = 0.0


@dataclass
class _Place:
    """One worker's actor."""

    name: str
    node: str
    actor: Any
    since: float
    begun: bool = False
    """Whether Ray has started it."""
    heard: bool = False
    """Whether its worker has been ready."""


class Bridge:
    """All state lives in the main thread; Ray's threads only put answers into a queue.
    `config` is that of the workers, packed."""

    def __init__(self, pipe: Connection, ray: Any, config: bytes, wish: RaySettings) -> None:
        self._pipe = pipe
        self._ray = ray
        self._config = config
        self._wish = wish
        self._wanted = versions()
        self._class = ray.remote(actor_class())
        self._affinity = importlib.import_module("ray.util.scheduling_strategies")
        self._answers: queue.SimpleQueue[tuple[_Place, str, Any]] = queue.SimpleQueue()
        self._ear, self._bell = Pipe(duplex=False)
        self._places: dict[str, _Place] = {}
        self._homeless: deque[str] = deque()
        self._nodes: dict[str, str] = {}
        self._slots: dict[str, int] = {}
        self._bad: Counter[str] = Counter()
        self._unfit: dict[str, str] = {}
        self._room = -1
        self._bare_since: float | None = None
        self._busy = False
        self._looked = 0.0

    def run(self) -> None:
        """Until the driver says stop."""
        self._look()
        if not any(self._slots.values()):
            self._pipe.send(("trouble", self._too_small()))
            return
        self._pipe.send(("connected", sorted(set(self._nodes.values()))))
        while self.step(LOOK_SECONDS):
            pass

    def step(self, seconds: float) -> bool:
        """Do what has come up, or comes up within `seconds`; False once the driver says stop."""
        wait([self._pipe, self._ear], timeout=seconds)
        while self._pipe.poll():
            message = self._pipe.recv()
            if message[0] == "stop":
                return False
            self._obey(message)
        while self._ear.poll():
            self._ear.recv_bytes()
            self._answered(*self._answers.get())
        if time.monotonic() - self._looked >= LOOK_SECONDS:
            self._look()
        self._settle_in()
        return True

    def close(self) -> None:
        """End all actors that are left."""
        for place in self._places.values():
            self._end(place)

    # --- nodes ------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Count the nodes and what fits on them."""
        self._looked = time.monotonic()
        alive = [node for node in self._ray.nodes() if node["Alive"]]
        self._nodes = {node["NodeID"]: node["NodeManagerAddress"] for node in alive}
        self._slots = {
            node["NodeID"]: 0 if node["NodeID"] in self._unfit else self._fits(node["Resources"])
            for node in alive
        }
        room = sum(self._slots.values())
        if self._wish.workers:
            room = min(room, self._wish.workers)
        if room != self._room:
            self._room = room
            self._pipe.send(("room", room))
        self._endure()
        self._mind_others()

    def _fits(self, resources: Mapping[str, float]) -> int:
        """How many workers a node with `resources` holds."""
        shares = [(resources.get("CPU", 0.0), self._wish.cpus)]
        shares.append((resources.get("GPU", 0.0), self._wish.gpus))
        return int(min(has / takes + 1e-6 for has, takes in shares if takes > 0))

    def _endure(self) -> None:
        """Having no node is borne for a while, having only unfit ones is not."""
        if self._room or self._places:
            self._bare_since = None
            return
        now = time.monotonic()
        unfit = [text for node, text in self._unfit.items() if node in self._nodes]
        if unfit:
            self._pipe.send(("trouble", unfit[0]))
        elif self._bare_since is None:
            self._bare_since = now
            if self._homeless:
                self._pipe.send(("news", "no node of the Ray cluster is left; waiting for one"))
        elif now - self._bare_since > NODES_SECONDS:
            text = f"for {NODES_SECONDS:g} s no node of the Ray cluster has had room for a worker"
            self._pipe.send(("trouble", text))

    def _mind_others(self) -> None:
        """Say once if other users of the cluster have the CPUs."""
        late = time.monotonic() - BUSY_SECONDS
        stuck = [p for p in self._places.values() if not p.begun and p.since < late]
        if stuck and not self._busy:
            text = f"{len(stuck)} workers wait for CPUs that other jobs of the Ray cluster use"
            self._pipe.send(("news", text))
        self._busy = bool(stuck)

    def _too_small(self) -> str:
        asked = f"{self._wish.cpus:g} CPUs"
        asked += f" and {self._wish.gpus:g} GPUs" if self._wish.gpus else ""
        most = max(
            (node["Resources"].get("CPU", 0.0) for node in self._ray.nodes() if node["Alive"]),
            default=0.0,
        )
        return (
            f"no node of the Ray cluster at {self._wish.address} has the {asked} that a worker "
            f"takes (the largest has {most:g} CPUs); lower --cpus-per-worker or --gpus-per-worker, "
            "or start larger nodes"
        )

    # --- workers ----------------------------------------------------------------------------------

    def _obey(self, message: Message) -> None:
        what, *rest = message
        if what == "log":
            _print_to(Path(rest[0]))
        elif what == "hire":
            self._homeless.append(rest[0])
        elif what == "send":
            place = self._places.get(rest[0])
            if place is not None:
                place.actor.send.remote(pack_order(rest[1]))
        elif what == "kill":
            with contextlib.suppress(ValueError):
                self._homeless.remove(rest[0])
            place = self._places.pop(rest[0], None)
            if place is not None:
                self._end(place)

    def _settle_in(self) -> None:
        """Give workers without a place one on the node that is emptiest."""
        while self._homeless:
            used = Counter(place.node for place in self._places.values())
            free = {node: slots - used[node] for node, slots in self._slots.items()}
            node = max(free, key=lambda n: free[n], default="")
            if not node or free[node] <= 0:
                return
            self._place(self._homeless.popleft(), node)

    def _place(self, name: str, node: str) -> None:
        there = self._affinity.NodeAffinitySchedulingStrategy(node, soft=False)
        actor = self._class.options(
            num_cpus=self._wish.cpus,
            num_gpus=self._wish.gpus,
            max_restarts=0,
            max_concurrency=4,
            scheduling_strategy=there,
        ).remote()
        place = self._places[name] = _Place(name, node, actor, time.monotonic())
        self._await(place, "begun", actor.begin.remote(self._wanted, self._config, name))

    def _await(self, place: _Place, what: str, reference: Any) -> None:
        def answered(future: Any) -> None:
            self._answers.put((place, what, future.exception() or future.result()))
            self._bell.send_bytes(b".")

        reference.future().add_done_callback(answered)

    def _answered(self, place: _Place, what: str, answer: Any) -> None:
        if self._places.get(place.name) is not place:
            return  # it was killed meanwhile
        if isinstance(answer, BaseException):
            self._lost(place, answer)
        elif what == "begun":
            self._begun(place, answer)
        else:
            self._heard(place, answer)

    def _begun(self, place: _Place, answer: object) -> None:
        place.begun = True
        match answer:
            case ["placed"]:
                self._pipe.send(("placed", place.name))
                self._await(place, "heard", place.actor.hear.remote(HEAR_SECONDS))
            case ["unfit", str(text)]:
                self._leave_out(place.node, text)
                self._again(place)
            case ["failed", str(text)]:
                self._lost(place, RuntimeError(text))
            case _:
                self._lost(place, DecodeError(f"it answered {answer!r:.100}"))

    def _heard(self, place: _Place, packed: bytes) -> None:
        try:
            heard = unpack_heard(packed)
        except DecodeError as error:
            self._lost(place, error)
            return
        place.heard = place.heard or any(message[0] == "ready" for message, _ in heard.said)
        self._pipe.send(("said", place.name, heard))
        if heard.gone is None:
            self._await(place, "heard", place.actor.hear.remote(HEAR_SECONDS))
            return
        self._pipe.send(("gone", place.name, heard.gone))
        del self._places[place.name]
        self._end(place)

    def _lost(self, place: _Place, error: BaseException) -> None:
        """The actor itself is gone, most often with its node, or says what cannot be read."""
        print(f"{place.name} on {self._where(place.node)}: {error!r}", file=sys.stderr, flush=True)
        if place.heard:
            del self._places[place.name]
            self._end(place)
            text = f"Ray lost it on {self._where(place.node)}"
            if isinstance(error, DecodeError):
                text = f"{self._where(place.node)} sent what cannot be read: {_line(error)}"
            self._pipe.send(("gone", place.name, text))
            return
        self._bad[place.node] += 1
        if self._bad[place.node] >= BAD_STARTS:
            self._leave_out(place.node, f"workers do not start there ({_line(error)})")
        self._again(place)

    def _again(self, place: _Place) -> None:
        """A worker that never was ready gets another place; no trial is lost."""
        del self._places[place.name]
        self._end(place)
        self._homeless.append(place.name)
        self._pipe.send(("waiting", place.name))

    def _leave_out(self, node: str, text: str) -> None:
        if node in self._unfit:
            return
        self._unfit[node] = (
            f"the Ray node {self._where(node)} cannot be used: {text}; "
            "install on all nodes what this machine has"
        )
        self._slots[node] = 0
        self._pipe.send(("news", self._unfit[node]))

    def _where(self, node: str) -> str:
        return self._nodes.get(node, "a node that is gone")

    def _end(self, place: _Place) -> None:
        with contextlib.suppress(Exception):
            self._ray.kill(place.actor, no_restart=True)


def _line(error: BaseException) -> str:
    """What was raised on the node, or the first sentence or so of what Ray says."""
    cause = getattr(error, "cause", None)
    text = " ".join((f"{type(cause).__name__}: {cause}" if cause else str(error)).split())
    return text if len(text) <= 300 else f"{text[:300]} ..."


def _print_to(path: Path) -> None:
    """Send what Ray prints to `path`, with what it has printed before."""
    path.parent.mkdir(parents=True, exist_ok=True)
    before = Path(f"/proc/self/fd/{sys.stderr.fileno()}").read_bytes()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.write(file, before)
    os.dup2(file, sys.stdout.fileno())
    os.dup2(file, sys.stderr.fileno())
    os.close(file)


def connect(wish: RaySettings) -> Any:
    """Ray, connected to the cluster or having started one; raises what Ray raises."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray: Any = importlib.import_module("ray")
    options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if wish.address == "local":
        options.update(
            num_cpus=len(os.sched_getaffinity(0)),
            include_dashboard=False,
            object_store_memory=128 * 2**20,
            _node_ip_address="127.0.0.1",
        )
    elif wish.address.startswith("ray://"):
        options = {"log_to_driver": False}
    ray.init(address=wish.address, **options)
    return ray


def main(pipe: Connection, config: bytes, wish: RaySettings) -> None:
    """Entry point of the process; `config` is packed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    die_with_driver()
    with tempfile.TemporaryFile() as quiet:
        os.dup2(quiet.fileno(), sys.stdout.fileno())
        os.dup2(quiet.fileno(), sys.stderr.fileno())
    try:
        ray = connect(wish)
    except Exception as error:
        pipe.send(("trouble", f"cannot join the Ray cluster at {wish.address}: {_line(error)}"))
        return
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    bridge = Bridge(pipe, ray, config, wish)
    try:
        bridge.run()
    except (EOFError, BrokenPipeError):
        pass
    finally:
        bridge.close()
        ray.shutdown()
