"""The synchronous client: a `Policy` whose model runs behind a WebSocket.

`connect(url)` speaks `robospa.v1`; `robospa.clients.connect` also reaches servers of other
dialects, each by a `WireClient` of its own. Requests are answered one by one; an answer with the
wrong id ends the connection, because from then on every action could belong to another observation.
There is no reconnect inside a trial: `reset` and the harness `reconnect()` between trials, which
refuses a server that is another one meanwhile (`Identity`). Errors: see
`robospa.protocol.errors`.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import re
import ssl as ssl_module
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar, cast

from robospa.observation import Observation
from robospa.protocol import errors, messages
from robospa.protocol.calls import check_calls
from robospa.protocol.codec import DEFAULT_LIMITS, Limits, encode_images
from robospa.protocol.policy import (
    CALLED,
    PolicyAnswer,
    PolicySpec,
    TrialInfo,
    check_chunk,
    check_size,
)
from robospa.protocol.transport import Address, Timeouts, Transport

if TYPE_CHECKING:
    from typing_extensions import Self

log = logging.getLogger("robospa.client")
NOT_OF_THE_SERVER = ("warnings", "redirected_to")
"""Entries of a greeting that our client adds."""
DECLARED = ("dialect", "version", "server", "spec", "options")
"""Entries with a fixed meaning; all others are a server's own, and may hold anything."""
TRANSIENT = re.compile(
    r"uptime|time|timestamp|now|clock|started|boot|pid|uuid|nonce|device|gpu|port|ip|address|node"
    r"|host(name)?|(session|connection|client|request)s?"
)
"""Words in the name of an entry that may change while a server stays the same."""
CHECKPOINT = re.compile(
    r"checkpoints?|ckpt|weights|path|revision|commit|sha(256)?|hash|digest|fingerprint"
)
"""Words in the name of an entry that tells one checkpoint from another."""
SHOWN = 100
"""Characters of a value in a message."""


@dataclass(frozen=True)
class Identity:
    """Which policy a server serves: all that its greeting says of it and that a second one repeats.

    A URL names a machine and not a checkpoint. So a run keeps who answered at its start, and every
    later connection is compared with that. Left out is what changes while a server stays the same:
    names that say so (an uptime, a process, the machine), flags that are on or off, and whatever
    differs between two greetings of one server (`repeated_in`).

    `parts`: JSON values by dotted name, such as `spec.horizon`; `volatile`: names of those left out
    because they were found to change.
    """

    parts: Mapping[str, object]
    volatile: frozenset[str] = frozenset()

    @property
    def hash(self) -> str:
        """16 hexadecimal digits that are equal for equal parts."""
        text = json.dumps(dict(self.parts), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def checkpoint(self) -> str:
        """What the server says of its checkpoint; empty if nothing names one."""
        return next((str(value)[:SHOWN] for _, value in self.checkpoints()), "")

    def checkpoints(self) -> Iterator[tuple[str, object]]:
        """The parts that name its checkpoint, as its spec does or by a name of its own."""
        spec = ("spec.checkpoint", self.parts.get("spec.checkpoint"))
        for name, value in (spec, *self.own_parts()):
            if isinstance(value, (str, int)) and value != "" and _speaks_of(CHECKPOINT, name):
                yield name, value

    def own_parts(self) -> Iterator[tuple[str, object]]:
        """The parts that are a server's own, by name."""
        return (
            (name, value)
            for name, value in self.parts.items()
            if name.partition(".")[0] not in DECLARED
        )

    def repeated_in(self, again: Identity) -> Identity:
        """This identity without what differs in a second greeting of the same server; a spec never
        may."""
        names = {n for n in (*self.parts, *again.parts) if not n.startswith("spec.")}
        changed = {n for n in names if self.parts.get(n) != again.parts.get(n)}
        kept = {name: value for name, value in self.parts.items() if name not in changed}
        return Identity(kept, self.volatile | changed)

    def changes(self, now: Identity) -> list[str]:
        """One phrase per part that is another one in `now`; empty if it is the same policy."""
        ignored = self.volatile | now.volatile
        names = [n for n in {**self.parts, **now.parts} if n not in ignored]
        pairs = [(n, self.parts.get(n), now.parts.get(n)) for n in names]
        return [
            f"{name.removeprefix('spec.')} was {_shown(old)} and is {_shown(new)}"
            for name, old, new in pairs
            if old != new
        ]


def identity_of(hello: Mapping[str, object], volatile: Collection[str] = ()) -> Identity:
    """The identity in a greeting (JSON values), without the parts named in `volatile`."""
    said = {name: value for name, value in hello.items() if name not in NOT_OF_THE_SERVER}
    parts = {name: value for name, value in _flat(said) if name not in volatile}
    kept = {
        name: value
        for name, value in parts.items()
        if name.partition(".")[0] in DECLARED
        or not (isinstance(value, bool) or _speaks_of(TRANSIENT, name))
    }
    return Identity(kept, frozenset(volatile))


def _flat(value: Mapping[str, object], path: str = "") -> Iterator[tuple[str, object]]:
    """All values that are no maps, by dotted name."""
    for name, inner in value.items():
        if isinstance(inner, Mapping):
            yield from _flat(inner, f"{path}{name}.")
        else:
            yield f"{path}{name}", list(inner) if isinstance(inner, tuple) else inner


def _speaks_of(words: re.Pattern[str], name: str) -> bool:
    """Whether a dotted name has one of `words`; camelCase has words as well."""
    found = re.findall(r"[A-Z]?[a-z0-9]+|[A-Z0-9]+", name)
    return any(words.fullmatch(word.lower()) for word in found)


def _shown(value: object) -> str:
    text = "unset" if value is None else repr(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."


M = TypeVar("M", bound=messages.Message)
T = TypeVar("T")
FIRST_PAUSE, LONGEST_PAUSE = 0.02, 1.0
"""[s] between two requests to a server that is busy."""


class WireClient(Protocol):
    """One connection in one dialect: pure translation, no retries, errors of `protocol.errors`.

    `hello` has at least `dialect` and `spec`, and `options` and `warnings` where the dialect has
    any; all are JSON values. `infer` returns the chunk as the dialect's server meant it (checked
    against the spec by the caller) and times in ms. `id` grows with every request. `per_trial`:
    whether every trial needs a connection of its own.
    """

    per_trial: bool
    spec: PolicySpec
    hello: dict[str, object]

    def reset(self, id: int, trial: TrialInfo) -> None: ...

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]: ...

    def end(self, id: int, outcome: Mapping[str, object]) -> None: ...

    def close(self) -> None: ...


class RemotePolicy:
    """A policy behind a server; made by `connect`. Not thread-safe: one per worker.

    `open_session` makes a connection, now and at every `reconnect`; `expect` is the identity that
    the server must have, by default that of its first greeting. `spec` is what the server wants.
    `hello` is the server's greeting as JSON values, for records. `last_timing` holds the last
    answer's times [ms]: `round_trip_ms`, and what the server reported (`queue_ms`, `infer_ms`,
    `batch`).
    """

    def __init__(
        self,
        url: str,
        open_session: Callable[[], WireClient],
        timeouts: Timeouts,
        expect: Identity | None = None,
    ) -> None:
        self.url, self.timeouts = url, timeouts
        self.last_timing: dict[str, float] = {}
        self._open = open_session
        self._next_id = 1
        self._task: str | None = None
        self._warm = self._answered = False
        self._expected = expect
        self._session = self._open_expected()
        self.spec: PolicySpec = self._session.spec

    @property
    def hello(self) -> dict[str, object]:
        """Dialect, version, server name, spec and what else it says of itself as JSON values."""
        return self._session.hello

    @property
    def dialect(self) -> str:
        """`robospa.v1`, or the name of another dialect in `robospa.clients`."""
        return str(self._session.hello["dialect"])

    def reset(self, trial: TrialInfo) -> None:
        """Begin a trial; returns when the server is ready. A connection that was good before and is
        found cut is made anew: no trial is lost."""
        self._warm = self._warm and trial.task == self._task
        self._task = trial.task

        def begin() -> None:
            self._when_free(lambda: self._session.reset(self._id(), trial), self.timeouts.reset)

        if self._answered and self._session.per_trial:
            self.reconnect()
        try:
            begin()
        except errors.ConnectionLost as error:
            if not self._answered:
                raise
            log.warning("%s; connected again", error)
            self.reconnect()
            begin()

    def infer(self, observation: Observation) -> PolicyAnswer:
        """The action chunk, float32 (T, D), finite, T >= 1 and at most a declared horizon; calls of
        a policy of the space "skill"."""
        if self.spec.image_codec == "jpeg":
            # what is sent has bytes for images; nothing else looks at them
            observation = cast("Observation", encode_images(observation))
        timeout = self.timeouts.infer if self._warm else self.timeouts.first_infer
        start = time.perf_counter()
        try:
            answer, timing = self._when_free(
                lambda: self._session.infer(self._id(), observation, timeout), timeout
            )
        except errors.PolicyError as error:
            self.last_timing = _finite(error.timing)
            raise
        round_trip = (time.perf_counter() - start) * 1e3
        self.last_timing = {**_finite(timing), "round_trip_ms": round_trip}
        self._warm = self._answered = True
        if self.spec.action in CALLED:
            return check_calls(answer, self.spec)
        options = self.hello.get("options")
        names = options if isinstance(options, Mapping) else ()
        return check_chunk(answer, self.spec, names, exact=True)

    def _when_free(self, request: Callable[[], T], timeout: float) -> T:
        """The answer to `request`. While the server is busy it is repeated, with growing pauses,
        for `timeout` seconds: the trial goes on, and the simulator waits for the model. A server
        that is busy for longer has missed the deadline, as one that does not answer."""
        give_up, pause = time.monotonic() + timeout, FIRST_PAUSE
        while True:
            try:
                return request()
            except errors.ServerError as error:
                if error.code != messages.BUSY:
                    raise
                if time.monotonic() + pause > give_up:
                    raise errors.CallTimeout(
                        f"{self.url} was busy for {timeout:g} s ({error.message}); use fewer "
                        "workers, or allow more time"
                    ) from error
            time.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    def end(self, outcome: Mapping[str, object] | None = None) -> None:
        """Tell the server how the trial ended (JSON values); optional."""
        self._session.end(self._id(), outcome or {})

    def reconnect(self) -> None:
        """A new connection, between trials only. Raises SpecMismatch if another policy answers."""
        self.close()
        self._session, self._warm, self._answered = self._open_expected(), False, False

    def _open_expected(self) -> WireClient:
        """A connection to the same policy as ever; raises SpecMismatch."""
        session = self._open()
        found = identity_of(session.hello)
        changes = self._expected.changes(found) if self._expected is not None else []
        if changes:
            session.close()
            raise errors.SpecMismatch(
                f"the server at {self.url} is another one than before: {'; '.join(changes)}; "
                "start the first one again, or a new run for this one"
            )
        self._expected = self._expected or found
        return session

    def close(self) -> None:
        """Close the connection; harmless when closed already."""
        self._session.close()

    def _id(self) -> int:
        self._next_id += 1
        return self._next_id

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _finite(timing: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in timing.items() if math.isfinite(value)}


class _RobospaClient:
    """One connection in `robospa.v1`."""

    per_trial = False

    def __init__(self, transport: Transport, timeouts: Timeouts, limits: Limits) -> None:
        self._transport, self._timeouts, self._limits = transport, timeouts, limits
        hello = self._receive(messages.Hello, 0, timeouts.hello)
        self.spec = hello.spec
        check_size(hello.spec, limits, transport.url)
        self.hello: dict[str, object] = {
            "dialect": "robospa.v1",
            "version": hello.version,
            "server": hello.server,
            "spec": hello.spec.to_json(),
        }

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._call(messages.Reset(id, trial), messages.Ready, self._timeouts.reset)

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]:
        sent = {name: value for name, value in observation.items() if name != "executed"}
        request = messages.Infer(id, sent)
        if self.spec.action in CALLED:
            said = self._call(request, messages.Calls, timeout)
            return said.calls, said.timing
        actions = self._call(request, messages.Actions, timeout)
        return actions.chunk, actions.timing

    def end(self, id: int, outcome: Mapping[str, object]) -> None:
        self._call(messages.End(id, outcome), messages.Ended, self._timeouts.end)

    def close(self) -> None:
        self._transport.close()

    def _call(self, request: messages.Message, answer: type[M], timeout: float) -> M:
        self._transport.send(messages.pack(request, self._limits))
        return self._receive(answer, request.id, timeout)

    def _receive(self, expected: type[M], id: int, timeout: float) -> M:
        data = self._transport.receive(timeout, expected.type)
        if isinstance(data, str):
            text = errors.printable(data, 200)
            raise self._violation(f"a text frame came instead of {expected.type}: {text!r}")
        try:
            message = messages.unpack(data, self._limits)
        except errors.DecodeError as error:
            raise self._violation(f"the answer cannot be read: {error}") from error
        if isinstance(message, messages.Error) and message.id in (id, 0):
            if message.id == 0:
                self.close()
                reason = errors.printable(message.message)
                raise errors.ConnectionLost(
                    f"{self._transport.url} gave up the connection: {reason}"
                )
            raise self._refused(message)
        if message.id != id:
            raise self._violation(f"answer {message.id} came to request {id}")
        if not isinstance(message, expected):
            raise self._violation(f"{message.type} came where {expected.type} was expected")
        return message

    def _refused(self, message: messages.Error) -> errors.PolicyError:
        error: errors.PolicyError = errors.ServerError(
            message.code, message.message, message.retriable, self._transport.url
        )
        if message.code == messages.BAD_ANSWER:
            error = errors.PolicyAnswerError(errors.printable(message.message))
        error.timing = message.timing
        return error

    def _violation(self, reason: str) -> errors.TransportError:
        self.close()
        return violation(self._transport.url, reason)


def violation(url: str, reason: str) -> errors.TransportError:
    """The error for something that the protocol does not allow."""
    return errors.ProtocolViolation(
        f"{url} broke the protocol: {reason}; robospa check lists what else it gets wrong"
    )


def connect(
    url: str,
    token: str | None = None,
    timeouts: Timeouts | None = None,
    *,
    limits: Limits = DEFAULT_LIMITS,
    ssl: ssl_module.SSLContext | None = None,
) -> RemotePolicy:
    """Connect to a `robospa.v1` server at a ws:// or wss:// URL and check that both ends fit.

    Raises ConnectFailed, HandshakeError and its children, ProtocolViolation; ValueError for a wrong
    URL.
    """
    allowed = timeouts or Timeouts()
    address = Address(url, token, ssl)
    return RemotePolicy(url, lambda: open_wire(address, allowed, limits), allowed)


def open_wire(
    address: Address,
    timeouts: Timeouts,
    limits: Limits,
    other: Callable[[Transport], WireClient] | None = None,
) -> WireClient:
    """A connection in `robospa.v1`; `other` makes one with a server that does not select it.

    Without `other` such a server is a HandshakeError.
    """
    transport = Transport(address, timeouts, limits, messages.SUBPROTOCOL)
    try:
        if transport.subprotocol is not None:
            return _RobospaClient(transport, timeouts, limits)
        if other is not None:
            return other(transport)
        raise errors.HandshakeError(
            f"{address.url} does not speak {messages.SUBPROTOCOL}: if it is the server of another "
            "project, connect with robospa.connect and the scheme of its dialect"
        )
    except BaseException:
        transport.close()
        raise
