"""Workers on a Ray cluster, one actor each, as the driver of a run sees them.

Records and actions come back over Ray and are written here, by one writer, so a trial is recorded
once wherever it ran. What a worker sends after it was killed is dropped.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import pickle
import signal
import socket
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from robospa.extras import remedy
from robospa.harness.pool import sigint_blocked
from robospa.harness.running.atomic_file import LOGS, replace_file
from robospa.harness.running.code_hash import code_hash
from robospa.harness.running.executor import (
    Command,
    Executor,
    Heartbeat,
    Message,
    RunAborted,
    TrialDone,
    WorkerHandle,
    WorkerReady,
)
from robospa.harness.running.manifest import package_versions
from robospa.harness.running.record_store import RecordWriter
from robospa.harness.running.status import cores
from robospa.harness.running.worker import LocalExecutor, WorkerConfig
from robospa.harness.settings import Compute
from robospa.results.records.runs import ACTIONS

NODES_SECONDS = 1.0
"""How often the nodes are counted."""
REPORT_SECONDS = 5.0
"""A worker that sends nothing but heartbeats reports this often."""
NO_NODE_SECONDS = 600.0
"""How long a run waits for a node if it has lost them all."""
NO_HEAD_SECONDS = 10.0
"""How long the cluster's head may not answer; Ray ends this process after 60 s."""
CLOSE_SECONDS = 2.0


@dataclass(eq=False)
class RayWorker(WorkerHandle):
    """One worker: an actor, once a node has room for it."""

    name: str
    executor: RayExecutor
    node: str = ""
    actor: Any = None
    call: Any = None
    """The call of the actor whose result is awaited."""
    started: bool = False
    ready: bool = False
    inbox: list[Message] = field(default_factory=list)
    ended: str | None = None

    def send(self, command: Command) -> None:
        if self.ended is None and self.actor is not None:
            self.actor.send.remote(command)

    def messages(self) -> list[Message]:
        received, self.inbox = self.inbox, []
        return received

    def exit_status(self) -> str | None:
        return self.ended

    def pending(self) -> bool:
        return not self.started

    def kill(self) -> None:
        """End it now; what it sends from now on is dropped."""
        self.ended, self.inbox = self.ended or "killed", []
        self.close()

    def join(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while self.ended is None and self.started and time.monotonic() < until:
            self.executor.wait([self], until - time.monotonic())

    def close(self) -> None:
        """Give its place on the node back."""
        self.executor.remove(self)


class RayExecutor(Executor):
    """As many workers as the cluster of `settings` has room for, at most `settings.workers`.

    GPUs are only taken by a run that `renders`.
    """

    def __init__(self, config: WorkerConfig, settings: Compute, renders: bool = True) -> None:
        """Join the cluster; raises NoCluster, also if no node is large enough for a worker."""
        self._folder = config.folder
        self._config = pickle.dumps(config)
        self._settings = settings
        gpus = settings.gpus_per_worker if renders else 0.0
        self._needs = {"CPU": settings.cpus_per_worker, "GPU": gpus}
        self._versions = versions()
        self._workers: list[RayWorker] = []
        self._addresses: dict[str, str] = {}
        self._slots: dict[str, int] = {}
        self._left_out: dict[str, str] = {}
        self._notes: list[str] = []
        self._writer: RecordWriter | None = None
        self._counted = 0.0
        self._no_node_since: float | None = None
        self._gone = False
        self._ray = join_cluster(settings.address)
        try:
            self._head = settings.address or ""
            if not self._head.startswith("ray://"):
                self._head = self._ray.get_runtime_context().gcs_address
            self._actor_class = self._ray.remote(WorkerActor)
            self._affinity = import_module("ray.util.scheduling_strategies")
            self._count_nodes()
            if not self.capacity():
                raise NoCluster(self._too_small())
        except BaseException:
            self.close()
            raise

    def nodes(self) -> list[str]:
        return sorted(set(self._addresses.values()))

    def capacity(self) -> int:
        return min(sum(self._slots.values()), self._settings.workers or sys.maxsize)

    def start(self, name: str) -> RayWorker:
        """One more worker; it is pending until a node has room for it."""
        worker = RayWorker(name, self)
        self._workers.append(worker)
        return worker

    def wait(self, workers: Sequence[WorkerHandle], seconds: float) -> None:
        try:
            self._update_nodes()
            self._place_workers()
            waiting = {worker.call: worker for worker in self._workers if worker.call is not None}
            if not waiting:
                time.sleep(max(0.0, seconds))
                return
            if any(isinstance(worker, RayWorker) and worker.inbox for worker in workers):
                seconds = 0.0
            self._ray.wait(list(waiting), timeout=max(0.0, seconds))
            done, _ = self._ray.wait(list(waiting), num_returns=len(waiting), timeout=0)
        except (OSError, RuntimeError) as error:
            self._gone = True
            raise RunAborted(f"the connection to the Ray cluster broke: {error}") from error
        for call in done:
            self._receive(waiting[call])

    def notes(self) -> list[str]:
        notes, self._notes = self._notes, []
        return notes

    def remove(self, worker: RayWorker) -> None:
        """End the actor of `worker`, if it has one."""
        if worker in self._workers:
            self._workers.remove(worker)
        actor, worker.actor, worker.call = worker.actor, None, None
        if actor is not None and not self._gone:
            with suppress(Exception):  # it may be gone already
                self._ray.wait([actor.close.remote()], timeout=CLOSE_SECONDS)
            with suppress(Exception):
                self._ray.kill(actor)

    def close(self) -> None:
        """Leave the cluster, or end the one that was started; may be called twice."""
        if not self._gone:
            self._gone = True
            self._ray.shutdown()
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    # --- nodes ------------------------------------------------------------------------------------

    def _update_nodes(self) -> None:
        """Count the nodes now and then; raises RunAborted if there will be none."""
        now = time.monotonic()
        if now - self._counted < NODES_SECONDS:
            return
        if reason := unreachable(self._head):
            if now - self._counted > NO_HEAD_SECONDS:
                self._gone = True
                raise RunAborted(f"the head of the Ray cluster does not answer: {reason}")
            return  # Ray would wait for it
        self._count_nodes()
        if self.capacity() or any(worker.actor for worker in self._workers):
            self._no_node_since = None
            return
        for node in self._addresses:
            if node in self._left_out:
                raise RunAborted(self._left_out[node])
        if self._no_node_since is None:
            self._no_node_since = now
            self._notes.append("no node of the Ray cluster is left; waiting for one")
        elif now - self._no_node_since > NO_NODE_SECONDS:
            raise RunAborted(f"for {NO_NODE_SECONDS:g} s no node of the Ray cluster had room")

    def _count_nodes(self) -> None:
        alive = [node for node in self._ray.nodes() if node["Alive"]]
        self._counted = time.monotonic()
        self._addresses = {node["NodeID"]: node["NodeManagerAddress"] for node in alive}
        self._slots = {
            node["NodeID"]: fitting(node["Resources"], self._needs)
            for node in alive
            if node["NodeID"] not in self._left_out
        }

    def _leave_out(self, node: str, reason: str) -> None:
        if node not in self._left_out:
            self._left_out[node] = (
                f"the Ray node {self._address(node)} cannot be used: {reason}; "
                "install on all nodes what this machine has"
            )
            self._notes.append(self._left_out[node])
            self._slots.pop(node, None)

    def _address(self, node: str) -> str:
        return self._addresses.get(node, "a node that is gone")

    def _too_small(self) -> str:
        needs = " and ".join(f"{count:g} {name}s" for name, count in self._needs.items() if count)
        cpus = [node["Resources"].get("CPU", 0.0) for node in self._ray.nodes() if node["Alive"]]
        return (
            f"no node of the Ray cluster at {self._settings.address or 'auto'} has the {needs} "
            f"that a worker takes (the largest has {max(cpus, default=0.0):g} CPUs); lower "
            "--cpus-per-worker or --gpus-per-worker, or start larger nodes"
        )

    # --- workers ----------------------------------------------------------------------------------

    def _place_workers(self) -> None:
        for worker in self._workers:
            if worker.actor is None:
                used = Counter(w.node for w in self._workers if w.actor is not None)
                free = {node: slots - used[node] for node, slots in self._slots.items()}
                worker.node = max(free, key=lambda node: free[node], default="")
                if free.get(worker.node, 0) <= 0:
                    return
                node = self._affinity.NodeAffinitySchedulingStrategy(worker.node, soft=False)
                worker.actor = self._actor_class.options(
                    num_cpus=self._needs["CPU"],
                    num_gpus=self._needs["GPU"],
                    max_concurrency=4,
                    scheduling_strategy=node,
                ).remote()
                worker.call = worker.actor.start.remote(self._versions, self._config, worker.name)

    def _receive(self, worker: RayWorker) -> None:
        """Take the result of a worker's last call and make the next one. Raises StorageError."""
        try:
            result = self._ray.get(worker.call)
        except Exception as error:
            where = self._address(worker.node)
            if worker.ready:
                self.remove(worker)
                worker.ended = f"Ray lost it on {where}"
            else:
                self._start_elsewhere(worker, f"workers do not start there ({error_line(error)})")
            return
        if isinstance(result, WorkerReport):
            self._keep(worker, result)
        elif result:
            self._start_elsewhere(worker, result)
            return
        worker.started = True
        if worker.ended is None:
            worker.call = worker.actor.report.remote(REPORT_SECONDS)
        else:
            self.remove(worker)

    def _start_elsewhere(self, worker: RayWorker, reason: str) -> None:
        """A worker that never was ready gets another node; no trial is lost."""
        self._leave_out(worker.node, reason)
        self.remove(worker)
        worker.started = False
        self._workers.append(worker)

    def _keep(self, worker: RayWorker, report: WorkerReport) -> None:
        """Put what came with a message on disk, then pass the message on.

        Files first, because a record promises that they are there.
        """
        if report.output:
            path = self._folder / LOGS / f"{worker.name}.log"
            with suppress(OSError):
                path.parent.mkdir(exist_ok=True)
                with path.open("ab") as file:
                    file.write(report.output)
        for name, data in report.files.items():
            replace_file(self._folder / name, data, parents=False)
        for message in report.messages:
            worker.ready |= isinstance(message, WorkerReady)
            if isinstance(message, TrialDone):
                self._writer = self._writer or RecordWriter(self._folder)
                self._writer.write(message.record)
        worker.inbox += report.messages
        worker.ended = report.exit_status


def fitting(resources: Mapping[str, float], needs: Mapping[str, float]) -> int:
    """How many workers that need so much fit into `resources`."""
    return int(min(resources.get(name, 0.0) / n + 1e-6 for name, n in needs.items() if n > 0))


def loopback_warnings(executor: Executor | None, config: WorkerConfig) -> list[str]:
    """A warning for every server that each node of the cluster would look for on itself."""
    if not isinstance(executor, RayExecutor) or len(executor.nodes()) < 2:
        return []
    here = ("localhost", "127.0.0.1", "::1")
    return [
        f"{url} means another machine on every node of the Ray cluster; name the server's own"
        for url in config.expects
        if urlsplit(url).hostname in here
    ]


PROBE_SECONDS = 5.0
NONE_HERE = (
    "no Ray cluster runs on this machine; `ray start --head` starts one, "
    "--address local makes one for this run only"
)


class NoCluster(Exception):
    """There is no Ray, or no Ray cluster that can be used."""


def join_cluster(address: str | None) -> Any:
    """The module `ray`, connected to the cluster at `address` (auto, local, host:port or
    ray://host:port; by default auto) or having started one.

    Raises NoCluster. Ray logs nothing into a run's progress, and signals act as before.
    """
    address = address or "auto"
    check_address(address)
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray: Any = importlib.import_module("ray")
    options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if address == "local":
        options.update(
            num_cpus=cores(),
            include_dashboard=False,
            object_store_memory=128 * 2**20,
            _node_ip_address="127.0.0.1",
        )
    elif address.startswith("ray://"):
        options = {"log_to_driver": False}
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    on_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        with sigint_blocked():
            ray.init(address=address, **options)
    except Exception as error:
        text = f"cannot join the Ray cluster at {address}: {error_line(error)}"
        raise NoCluster(_with_advice(text)) from error
    finally:
        with suppress(ValueError):  # not the main thread: then Ray has set none
            signal.signal(signal.SIGTERM, on_sigterm)
    return ray


def check_address(address: str) -> None:
    """Raises NoCluster if Ray is not installed or nothing listens at `address`.

    Ray itself would try for minutes.
    """
    if importlib.util.find_spec("ray") is None:
        raise NoCluster(f"Ray is not installed; {remedy('ray')}")
    if address == "local":
        return
    if address == "auto":
        written = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
        last = os.environ.get("RAY_ADDRESS", "")
        with suppress(OSError):
            last = last or written.read_text().strip()
        if reason := unreachable(last):
            raise NoCluster(f"{NONE_HERE} (the last one was at {last}: {reason})")
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        raise NoCluster(
            f"--address {address!r} is not one of auto, local, HOST:PORT and ray://HOST:PORT"
        )
    if reason := unreachable(address):
        raise NoCluster(
            f"no Ray cluster answers at {address} ({reason}); `ray start --head` starts one"
        )


def unreachable(address: str) -> str:
    """Why nothing can be reached at `address`; empty if something listens, or it is no address."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return ""
    try:
        socket.create_connection((host, int(port)), timeout=PROBE_SECONDS).close()
    except (OSError, OverflowError) as error:
        return str(error)
    return ""


def error_line(error: BaseException) -> str:
    """What was raised on the node, or the first sentence or so of what Ray says."""
    cause = getattr(error, "cause", None)
    text = " ".join((f"{type(cause).__name__}: {cause}" if cause else str(error)).split())
    return text if len(text) <= 300 else f"{text[:300]} ..."


def _with_advice(text: str) -> str:
    if "Could not find any running Ray instance" in text:
        return NONE_HERE
    if any(hint in text for hint in ("uthenticat", "Failed to connect", "connection timeout")):
        text += "; if the cluster asks for a token, set RAY_AUTH_MODE=token here"
    return text


LOG_BYTES = 64_000
"""Most of a worker's output that travels at once."""


@dataclass(frozen=True)
class WorkerReport:
    """What one worker sent since its last report, the `files` of a trial that is done (by path
    within the run's folder), its `output`, and how it ended (None while it runs)."""

    messages: tuple[Message, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    output: bytes = b""
    exit_status: str | None = None


def versions() -> dict[str, str]:
    """What has to be the same on every node for records to be the same."""
    return {**package_versions(), "code": code_hash()}


def version_differences(driver: Mapping[str, str]) -> str:
    """Why this node cannot take part in a run whose driver has the versions `driver`, or empty."""
    here = versions()
    differ = [
        f"{name} {here.get(name)} instead of {version}"
        for name, version in driver.items()
        if here.get(name) != version
    ]
    return f"it has {', '.join(differ)}" if differ else ""


class WorkerActor:
    """The actor: one worker process and its folder."""

    def start(self, driver: Mapping[str, str], config: bytes, name: str) -> str:
        """Start the worker; returns why this node cannot be used, or nothing.

        `driver` holds the driver's versions; `config` is a pickled WorkerConfig, which another
        version could not read.
        """
        if differences := version_differences(driver):
            return differences
        unpickled: WorkerConfig = pickle.loads(config)
        self._folder = tempfile.TemporaryDirectory(prefix="robospa-", ignore_cleanup_errors=True)
        self._path = Path(self._folder.name)
        self._log = self._path / LOGS / f"{name}.log"
        self._read = 0
        self._executor = LocalExecutor(replace(unpickled, folder=self._path), 1)
        self._worker = self._executor.start(name)
        return ""

    def send(self, command: Command) -> None:
        self._worker.send(command)

    def report(self, seconds: float) -> WorkerReport:
        """Wait until the worker sends more than heartbeats or ends, `seconds` at most."""
        until = time.monotonic() + seconds
        beats: list[Message] = []
        others: list[Message] = []
        exit_status: str | None = None
        while exit_status is None and not others and time.monotonic() < until:
            self._executor.wait([self._worker], until - time.monotonic())
            exit_status = self._worker.exit_status()
            for message in self._worker.messages():
                (beats if isinstance(message, Heartbeat) else others).append(message)
        files = self._take_files() if any(isinstance(m, TrialDone) for m in others) else {}
        others = [replace(m, records=None) if isinstance(m, WorkerReady) else m for m in others]
        return WorkerReport((*beats[-1:], *others), files, self._new_output(), exit_status)

    def close(self) -> None:
        self._worker.kill()
        self._folder.cleanup()

    def _take_files(self) -> dict[str, bytes]:
        found: dict[str, bytes] = {}
        for path in sorted((self._path / ACTIONS).glob("[!.]*")):
            found[f"{ACTIONS}/{path.name}"] = path.read_bytes()
            path.unlink()
        return found

    def _new_output(self) -> bytes:
        try:
            with self._log.open("rb") as file:
                file.seek(self._read)
                text = file.read(LOG_BYTES)
        except OSError:
            return b""
        self._read += len(text)
        return text
