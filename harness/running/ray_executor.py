"""Workers on a Ray cluster, as the driver of a run sees them.

One actor a worker; their records, actions and videos come back over Ray and are written here, by
one writer, so a trial is recorded once wherever it ran. What a worker says after it was given up
is not heard. The cluster is behind a process of its own (`harness.ray_bridge`).
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path
from urllib.parse import urlsplit

from robospa.harness.running.executor import Hand, Message, RunAborted
from robospa.harness.running.local_workers import deaf
from robospa.harness.running.ray_bridge import RaySettings, main
from robospa.harness.running.ray_messages import Heard, pack_config
from robospa.harness.running.store import RecordWriter, replace_file
from robospa.harness.running.worker import LOGS, WorkerConfig
from robospa.protocol.errors import EncodeError
from robospa.results.records.trial_record import TrialRecord

CONNECT_SECONDS = 60.0
KNOCK_SECONDS = 5.0
CLOSE_SECONDS = 15.0
NONE_HERE = (
    "no Ray cluster runs on this machine; `ray start --head` starts one, "
    "--address local makes one for this run only"
)


class NoCluster(Exception):
    """There is no Ray, or no Ray cluster that can be used."""


class RayHand:
    """One worker somewhere in the cluster."""

    def __init__(self, name: str, executor: RayExecutor) -> None:
        self.name = name
        self.placed = False
        self.inbox: list[Message] = []
        self.end: str | None = None
        self._executor = executor

    def send(self, message: Message) -> None:
        """Tell it something; nothing happens if it is gone."""
        if self.end is None:
            self._executor.tell(("send", self.name, message))

    def messages(self) -> list[Message]:
        """What it has said since the last call."""
        heard, self.inbox = self.inbox, []
        return heard

    def gone(self) -> str | None:
        """How it ended; None while it lives."""
        return self.end

    def waiting(self) -> bool:
        """Whether it has no node yet."""
        return not self.placed

    def kill(self) -> None:
        """End it now. What it says from now on is not heard."""
        self._executor.tell(("kill", self.name))
        self.end, self.inbox = self.end or "killed", []
        self._executor.forget(self)

    def join(self, seconds: float) -> None:
        """Wait until it has gone, `seconds` at most."""
        until = time.monotonic() + seconds
        while self.end is None and self.placed and time.monotonic() < until:
            self._executor.wait([self], until - time.monotonic())

    def close(self) -> None:
        """Nothing is left of it."""
        self._executor.forget(self)


class RayExecutor:
    """As many workers as the cluster of `wish` has room for, at most `wish.workers`."""

    def __init__(self, config: WorkerConfig, wish: RaySettings) -> None:
        """Join the cluster; raises NoCluster."""
        self._folder = config.folder
        self._wish = wish
        self._hands: dict[str, RayHand] = {}
        self._room = 0
        self._news: list[str] = []
        self._writer: RecordWriter | None = None
        self._logging = False
        self.nodes: list[str] = []
        """Addresses of the nodes at the start."""
        check_address(wish.address)
        try:
            packed = pack_config(config)
        except EncodeError as error:
            raise NoCluster(
                f"this run's settings cannot be sent to its workers: {error}"
            ) from error
        spawn = multiprocessing.get_context("spawn")
        self._pipe, theirs = spawn.Pipe()
        self._bridge = spawn.Process(
            target=main, args=(theirs, packed, wish), name="ray-bridge", daemon=True
        )
        with deaf():
            self._bridge.start()
        theirs.close()
        try:
            self._join()
        except BaseException:
            self.close()
            raise

    def _join(self) -> None:
        until = time.monotonic() + CONNECT_SECONDS
        while not self.nodes:
            if not self._pipe.poll(max(0.0, until - time.monotonic())):
                raise NoCluster(
                    f"the Ray cluster at {self._wish.address} did not answer within "
                    f"{CONNECT_SECONDS:g} s; is this machine one of its nodes? If not, use "
                    "ray://HOST:10001"
                )
            try:
                what, *rest = self._pipe.recv()
            except (EOFError, OSError):
                self._bridge.join()
                raise NoCluster(
                    f"Ray ended while joining the cluster at {self._wish.address} "
                    f"(exit code {self._bridge.exitcode})"
                ) from None
            if what == "trouble":
                raise NoCluster(_explained(rest[0]))
            if what == "room":
                self._room = rest[0]
            elif what == "connected":
                self.nodes = rest[0]

    def room(self) -> int:
        """How many workers fit into the cluster now."""
        return self._room

    def hire(self, name: str) -> RayHand:
        """One more actor; it waits if its node has just gone."""
        if not self._logging:
            self._logging = True
            self.tell(("log", str((self._folder / LOGS / "ray.log").resolve())))
        hand = self._hands[name] = RayHand(name, self)
        self.tell(("hire", name))
        return hand

    def tell(self, message: Message) -> None:
        """Send `message` to the bridge; if that has ended, `wait` says so."""
        with suppress(OSError):
            self._pipe.send(message)

    def forget(self, hand: RayHand) -> None:
        """Hear no more of `hand`."""
        if self._hands.get(hand.name) is hand:
            del self._hands[hand.name]

    def wait(self, hands: Sequence[Hand], seconds: float) -> None:
        """Return as soon as something was heard, after `seconds` at most."""
        if any(isinstance(hand, RayHand) and hand.inbox for hand in hands):
            seconds = 0.0
        wait([self._pipe, self._bridge.sentinel], timeout=seconds)
        try:
            while self._pipe.poll():
                self._hear(self._pipe.recv())
        except (EOFError, OSError) as error:
            raise RunAborted(
                "the connection to the Ray cluster broke; Ray's last words are in "
                f"{self._folder / LOGS / 'ray.log'}"
            ) from error

    def _hear(self, message: Message) -> None:
        what, *rest = message
        if what == "trouble":
            raise RunAborted(rest[0])
        if what == "room":
            self._room = rest[0]
        elif what == "news":
            self._news.append(rest[0])
        elif hand := self._hands.get(rest[0]):
            if what == "said":
                self._listen(hand, rest[1])
            elif what == "gone":
                hand.end = rest[1]
            else:
                hand.placed = what == "placed"

    def _listen(self, hand: RayHand, heard: Heard) -> None:
        """Put what came with a message on disk, then pass the message on."""
        if heard.output:
            path = self._folder / LOGS / f"{hand.name}.log"
            with suppress(OSError), path.open("ab") as file:
                file.write(heard.output)
        for message, files in heard.said:
            if message[0] == "done":
                self._keep(message[1], files)
            hand.inbox.append(message)

    def _keep(self, record: TrialRecord, files: Mapping[str, bytes]) -> None:
        """Files first: a record promises that they are there. Raises StorageError."""
        for name, data in files.items():
            replace_file(self._folder / name, data)
        if self._writer is None:
            self._writer = RecordWriter(self._folder)
        self._writer.write(record)

    def news(self) -> list[str]:
        """Lines about nodes that were left out or are missing."""
        told, self._news = self._news, []
        return told

    def close(self) -> None:
        """Leave the cluster, or end the one that was started; may be called twice."""
        if self._pipe.closed:
            return
        self.tell(("stop",))
        self._bridge.join(CLOSE_SECONDS)
        if self._bridge.is_alive():
            self._bridge.kill()
            self._bridge.join()
        self._pipe.close()
        if self._writer is not None:
            self._writer.close()
            self._writer = None


@contextmanager
def joined(
    wish: RaySettings | None, config: WorkerConfig, renders: bool
) -> Iterator[RayExecutor | None]:
    """The cluster of `wish`, None for this machine. GPUs are only taken by a run that `renders`."""
    if wish is None:
        yield None
        return
    executor = RayExecutor(config, wish if renders else replace(wish, gpus=0.0))
    try:
        yield executor
    finally:
        executor.close()


def far_away(executor: RayExecutor | None, config: WorkerConfig) -> list[str]:
    """A warning for every server that each node of the cluster would look for on itself."""
    if executor is None or len(executor.nodes) < 2:
        return []
    here = ("localhost", "127.0.0.1", "::1")
    return [
        f"{url} means another machine on every node of the Ray cluster; name the server's own"
        for url in config.expects
        if urlsplit(url).hostname in here
    ]


def check_address(address: str) -> None:
    """Raises NoCluster if Ray is not installed or nothing listens at `address`."""
    if importlib.util.find_spec("ray") is None:
        raise NoCluster("Ray is not installed; `pip install 'robospa[ray]'` adds it")
    if address == "local":
        return
    if address == "auto":
        last = _last_cluster()
        if last and (why := _deaf_at(last)):
            raise NoCluster(f"{NONE_HERE} (the last one was at {last}: {why})")
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        raise NoCluster(
            f"--address {address!r} is none of auto, local, HOST:PORT and ray://HOST:PORT"
        )
    if why := _deaf_at(address):
        raise NoCluster(
            f"no Ray cluster answers at {address} ({why}); `ray start --head` starts one"
        )


def _last_cluster() -> str:
    """Where `auto` looks: Ray writes it down here and waits for minutes if that is outdated."""
    written = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
    try:
        return os.environ.get("RAY_ADDRESS") or written.read_text().strip()
    except OSError:
        return ""


def _deaf_at(address: str) -> str:
    """Why nobody can be reached at `address`; empty if somebody listens, or it is none."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return ""
    try:
        socket.create_connection((host, int(port)), timeout=KNOCK_SECONDS).close()
    except (OSError, OverflowError) as error:
        return str(error)
    return ""


def _explained(text: str) -> str:
    """What Ray says, with what helps."""
    if "Could not find any running Ray instance" in text:
        return NONE_HERE
    if any(hint in text for hint in ("uthenticat", "Failed to connect", "connection timeout")):
        text += "; if the cluster asks for a token, set RAY_AUTH_MODE=token here"
    return text
