"""Is this server fit to be evaluated? The specification as checks that run against any server.

`check(url)` talks to the server as a harness would, plus the ways in which harnesses and servers
are known to fail each other: a wrong version, a request out of turn, an error followed by a reset,
two trials at once, a connection that goes away and comes back. It costs the server some forty calls
of its model. A server that speaks openpi's dialect gets the checks that make sense there.
"""

import ssl as ssl_module
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

import numpy as np

from robospa.action_space import ActionSpace
from robospa.observation import WIDTH, Observation
from robospa.protocol.client import RemotePolicy, connect
from robospa.protocol.codec import DEFAULT_LIMITS, encode
from robospa.protocol.errors import TransportError, WireError
from robospa.protocol.messages import (
    VERSION,
    Actions,
    Calls,
    Error,
    Hello,
    Infer,
    Message,
    Ready,
    Reset,
    pack,
    unpack,
)
from robospa.protocol.policy import CALLED, PolicyAnswer, PolicySpec, TrialInfo, joints_of, robot_of
from robospa.protocol.transport import Address, Timeouts, Transport
from robospa.text import counted
from robospa.trial import REFERENCE, TrialKey

KEY = TrialKey("Pick_Blocks_Size", 1, 100_000)
"""A real task: a server may load a checkpoint by its name."""
TRIAL = TrialInfo(
    KEY.task, REFERENCE, "Pick up the red block.", policy_seed=7, id="b1d0c4e2a7935f68"
)
POSE = np.array([0, 0, 1, 1, 0, 0, 0, 1], np.float32)
"""An end effector 1 m up, not turned, open."""


def trial_for(spec: PolicySpec) -> TrialInfo:
    """The trial of the checks, of a robot that `spec` drives, with a key if it asks for one."""
    robot = robot_of(spec)
    trial = replace(TRIAL, embodiment=robot, joints=joints_of(spec))
    return replace(trial, key=replace(KEY, embodiment=robot)) if spec.needs_trial_key else trial


def synthetic_observation(spec: PolicySpec, step: int = 0, seed: int = 0) -> Observation:
    """An observation of the form that `spec` asks for, filled with reproducible noise."""
    rng = np.random.default_rng(seed)
    width = ActionSpace("joint", joints_of(spec)).width

    def view() -> Observation:
        images = {
            c.name: rng.integers(0, 256, (c.height, c.width, 3), np.uint8) for c in spec.cameras
        }
        seen: Observation = {"images": images, "ee": np.tile(POSE, (2, 1))}
        if spec.state != "none":
            seen["state"] = np.zeros(width, np.float32)
        return seen

    observation = view()
    observation["instruction"], observation["step"] = TRIAL.instruction, step
    if spec.history:
        observation["history"] = {offset: view() for offset in spec.history}
    if spec.action in CALLED:
        observation["calls"] = []
    if spec.privileged:
        observation["privileged"] = {}
    if spec.environment_state:
        observation["environment_state"] = np.zeros(WIDTH, np.float32)
    return observation


@dataclass(frozen=True)
class CheckResult:
    """One check: what it is, whether it passed (None: does not apply), and what was seen; `hint`:
    nothing failed, but a person should look at it."""

    name: str
    passed: bool | None
    detail: str
    hint: bool = False


class _Skip(Exception):
    """The check does not apply to this server."""


class _Hint(Exception):
    """What was seen may be right or wrong."""


OURS = "robospa.v1"
EXACT = "the policy needs the exact state, which only a simulator can give"
AT_ONCE = "concurrent sessions"
ASKED = ("actions", "latency", AT_ONCE, "determinism", "real-time chunking")
"""Checks that ask for actions."""
SHARED = "its model keeps one state for all connections: one trial at a time"
REQUESTS, SESSIONS = 6, 4
CLOSE = 1e-2
"""How far actions of a seeded policy may be off in another batch: half precision."""


@dataclass
class _Target:
    """How to reach the server under test, and what its hello contains."""

    url: str
    token: str | None
    timeouts: Timeouts
    ssl: ssl_module.SSLContext | None
    connect: Callable[[], RemotePolicy]
    dialect: str = ""
    spec: PolicySpec = field(default_factory=lambda: PolicySpec("unknown"))

    @contextmanager
    def raw(self) -> Iterator[Transport]:
        """A connection in `robospa.v1`, past its hello."""
        if self.dialect != OURS:
            raise _Skip(f"the dialect {self.dialect} has nothing like it")
        transport = Transport(Address(self.url, self.token, self.ssl), self.timeouts)
        try:
            assert isinstance(unpack(_bytes(transport, self.timeouts.hello)), Hello)
            yield transport
        finally:
            transport.close()


def check(
    url: str,
    token: str | None = None,
    *,
    timeouts: Timeouts | None = None,
    ssl: ssl_module.SSLContext | None = None,
    connector: Callable[[], RemotePolicy] | None = None,
    shared_state: bool = False,
    sign: Callable[[str], str] = lambda dialect: "",
) -> list[CheckResult]:
    """Run every check against the server at a ws:// or wss:// URL, or against the one that
    `connector` reaches in another dialect; `shared_state` as its dialect says; `sign` gives that by
    which a dialect is known. Raises nothing of the server's making: what goes wrong becomes a
    failed check. Stops after a failed handshake."""
    limits = timeouts or Timeouts()
    ours = partial(connect, url, token, limits, ssl=ssl)
    target = _Target(url, token, limits, ssl, connector or ours)
    results = []
    for name, function in CHECKS.items():
        if name == AT_ONCE and shared_state:
            result = CheckResult(name, None, SHARED)
        else:
            result = _run(name, function, target)
        if name == "handshake":
            if not result.passed:
                return [result]
            if because := sign(target.dialect):
                result = replace(result, detail=f"{result.detail}, because {because}")
        results.append(result)
    return results


def _run(name: str, function: Callable[[_Target], str], target: _Target) -> CheckResult:
    if name in ASKED and target.spec.privileged:
        return CheckResult(name, None, EXACT)
    try:
        return CheckResult(name, True, function(target))
    except _Skip as reason:
        return CheckResult(name, None, str(reason))
    except _Hint as seen:
        return CheckResult(name, None, str(seen), hint=True)
    except (WireError, AssertionError) as error:
        return CheckResult(name, False, str(error) or type(error).__name__)


# ---------------------------------------------------------------- the checks


def _handshake(target: _Target) -> str:
    with target.connect() as policy:
        target.dialect, target.spec = policy.dialect, policy.spec
        hello = policy.hello
        if policy.dialect != OURS:
            server = f", {hello['server']!r}" if hello.get("server") else ""
            return f"speaks the dialect {policy.dialect}{server}"
        return f"robospa.v1, version {hello['version']} (ours {VERSION}), {hello['server']!r}"


def _spec(target: _Target) -> str:
    spec = target.spec
    again = PolicySpec.from_json(spec.to_json())
    assert again == spec, "the spec does not survive JSON"
    if target.dialect != OURS:
        raise _Skip(
            f"the dialect {target.dialect} has no spec: the one chosen at this side is used"
        )
    cameras = ", ".join(f"{c.name} {c.width}x{c.height}" for c in spec.cameras) or "none"
    if spec.action in CALLED:
        return f"{spec.name}: calls of skills, cameras {cameras}"
    length = "any length" if spec.horizon is None else f"at most {spec.horizon}"
    return f"{spec.name}: {spec.action} actions, chunks of {length}, cameras {cameras}"


def _subprotocol(target: _Target) -> str:
    if target.dialect != OURS:
        raise _Skip(f"the dialect {target.dialect} has no versions of ours")
    try:
        transport = Transport(
            Address(target.url, target.token, target.ssl),
            replace(target.timeouts, wait=0.0),
            subprotocol="robospa.v999",
        )
    except WireError as error:
        return f"refused: {error}"
    chosen = transport.subprotocol
    transport.close()
    assert chosen is None, "the server accepted a version that does not exist"
    raise AssertionError("a client that offers only robospa.v999 must be refused")


def _infer(target: _Target) -> str:
    with target.connect() as policy:
        policy.reset(trial_for(target.spec))
        chunk = policy.infer(synthetic_observation(target.spec))
        policy.infer(synthetic_observation(target.spec, step=len(chunk)))
        policy.end({"success": False, "end": "step_limit"})
    if isinstance(chunk, list):
        return f"{counted(len(chunk), 'call')}, the first one {chunk[0]['skill']}"
    return f"float32 {chunk.shape}, finite, numbers from {chunk.min():.3g} to {chunk.max():.3g}"


def _latency(target: _Target) -> str:
    with target.connect() as policy:
        policy.reset(trial_for(target.spec))
        round_trips, model = [], []
        for step in range(REQUESTS):
            policy.infer(synthetic_observation(target.spec, step))
            round_trips.append(policy.last_timing["round_trip_ms"])
            model.append(policy.last_timing.get("infer_ms", float("nan")))
    share = ""
    if np.isfinite(model).all():
        share = f", {np.median(model[1:]):.1f} ms of it in the model"
    later = f"then {np.median(round_trips[1:]):.1f} ms (at most {max(round_trips[1:]):.1f})"
    return f"first answer {round_trips[0]:.1f} ms, {later}{share}"


def _order(target: _Target) -> str:
    with target.raw() as transport:
        answer = _ask(transport, Infer(1, synthetic_observation(target.spec)), target.timeouts)
        assert isinstance(answer, Error), f"infer before reset was answered with {answer.type}"
        answer = _ask(transport, Reset(2, trial_for(target.spec)), target.timeouts)
        assert isinstance(answer, Ready), f"reset was then answered with {answer.type}"
        return "infer before reset is refused, and the reset after it works"


def _bad_observation(target: _Target) -> str:
    with target.raw() as transport:
        _ask(transport, Reset(1, trial_for(target.spec)), target.timeouts)
        broken = {**synthetic_observation(target.spec), "images": None, "instruction": None}
        answer = _ask(transport, Infer(2, broken), target.timeouts)
        assert isinstance(answer, Error), "an observation without text and images was accepted"
        assert answer.message, "the error has no message"
        answer = _ask(transport, Reset(3, trial_for(target.spec)), target.timeouts)
        assert isinstance(answer, Ready), "the reset after an error failed"
        if target.spec.privileged:
            return "refused, and the next reset works"
        answer = _ask(transport, Infer(4, synthetic_observation(target.spec)), target.timeouts)
        assert isinstance(answer, Actions | Calls), f"infer after the error gave {answer.type}"
        return "refused, and the next trial gets its own answers"


def _unknown_fields(target: _Target) -> str:
    with target.raw() as transport:
        trial = trial_for(target.spec).to_json()
        transport.send(encode({"type": "reset", "id": 1, "trial": trial, "field_of_1_9": [1, 2]}))
        answer = unpack(_bytes(transport, target.timeouts.reset))
        assert isinstance(answer, Ready), f"a reset with an unknown field gave {answer.type}"
        return "fields of later minor versions are ignored"


def _determinism(target: _Target) -> str:
    """One trial four times, twice on each of two connections."""
    trials: list[list[PolicyAnswer]] = []
    for _ in range(2):
        with target.connect() as policy:
            for _ in range(2):
                policy.reset(trial_for(target.spec))
                seen = (synthetic_observation(target.spec, step) for step in range(2))
                trials.append([policy.infer(one) for one in seen])
    second, fresh, _ = (
        max(_off(a, b) for a, b in zip(trials[0], again, strict=True)) for again in trials[1:]
    )
    if second == fresh == 0:
        return "equal trials are answered alike, after another and on a connection of their own"
    if fresh == 0:
        text = "the first trial of a connection is answered otherwise than a later, equal one"
        assert not target.spec.seeded, f"{text}, though its policy seed is the same"
        raise _Hint(
            f"{text}: the policy seems to keep state over trials, and results would depend on "
            "their order; where the client has the option, connection=trial begins each anew"
        )
    assert not target.spec.seeded, "the same policy seed and observations gave other actions"
    raise _Skip(
        "equal trials are answered differently: its noise cannot be seeded, or it keeps state over "
        "trials, which cannot be told from here"
    )


def _concurrent(target: _Target) -> str:
    """Several sessions at once get what each would get alone."""
    with ExitStack() as stack:
        policies = [stack.enter_context(target.connect())]
        try:
            policies += [stack.enter_context(target.connect()) for _ in range(SESSIONS - 1)]
        except TransportError as error:
            raise _Skip(f"one connection at a time: {error}") from error
        alone = [_episode(policy, target.spec, n) for n, policy in enumerate(policies)]
        pool = stack.enter_context(ThreadPoolExecutor(SESSIONS))
        jobs = [pool.submit(_episode, p, target.spec, n) for n, p in enumerate(policies)]
        together = [job.result() for job in jobs]
        batch = max(policy.last_timing.get("batch", 1.0) for policy in policies)
    text = f"{SESSIONS} trials at once are answered, up to {batch:g} in one call"
    if not target.spec.seeded:
        return text
    pairs = list(zip(alone, together, strict=True))
    off = max(_off(a, b) for a, b in pairs)
    assert off < np.inf, "concurrent chunks have other lengths"
    assert off <= CLOSE, f"concurrent actions are {off:.3g} off: are sessions mixed up?"
    same = "the same to the bit" if off == 0 else f"the same but for {off:.1g}"
    return f"{text}; {same} as alone"


def _off(a: PolicyAnswer, b: PolicyAnswer) -> float:
    """How far two answers are off; infinite for chunks of other lengths and for other calls."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) and a.shape == b.shape:
        return float(np.abs(a - b).max())
    return 0.0 if isinstance(a, list) and a == b else np.inf


def _episode(policy: RemotePolicy, spec: PolicySpec, number: int) -> PolicyAnswer:
    """The answers of a short trial of its own, one after the other."""
    policy.reset(replace(trial_for(spec), id=f"trial-{number}", policy_seed=number))
    seen = [synthetic_observation(spec, step, seed=10 * number + step) for step in range(3)]
    answers = [policy.infer(one) for one in seen]
    calls = [call for answer in answers if isinstance(answer, list) for call in answer]
    chunks = [one for one in answers if isinstance(one, np.ndarray)]
    widths = sorted({chunk.shape[1] for chunk in chunks})
    assert len(widths) < 2, f"actions of {' and '.join(map(str, widths))} numbers in one trial"
    return calls or np.concatenate(chunks)


def _real_time_chunking(target: _Target) -> str:
    spec = target.spec
    if not spec.committed_actions:
        raise _Skip("it reads no committed actions (spec.committed_actions is false)")
    with target.connect() as policy:
        policy.reset(trial_for(spec))
        first = policy.infer(synthetic_observation(spec))
        if isinstance(first, list):
            raise _Skip("it answers calls of skills")
        sent = {**synthetic_observation(spec, step=1), "committed": first[1:], "delay": 1}
        policy.infer(cast(Observation, sent))
        sent = {**synthetic_observation(spec, step=2), "committed": first[:0], "delay": 0}
        policy.infer(cast(Observation, sent))
        policy.infer(synthetic_observation(spec, step=3))
    return "answers with committed actions, with none left, and without word of them"


def _garbage(target: _Target) -> str:
    with target.raw() as transport, suppress(TransportError):
        transport.send(b"\xc1 no message")
        answer = unpack(_bytes(transport, target.timeouts.end))
        assert isinstance(answer, Error), f"garbage was answered with {answer.type}"
    with target.connect() as policy:
        policy.reset(trial_for(target.spec))
    return "garbage is refused and the server lives on"


CHECKS: dict[str, Callable[[_Target], str]] = {
    "handshake": _handshake,
    "spec": _spec,
    "foreign version refused": _subprotocol,
    "actions": _infer,
    "latency": _latency,
    "requests in order": _order,
    "error, then recovery": _bad_observation,
    "unknown fields": _unknown_fields,
    AT_ONCE: _concurrent,
    "determinism": _determinism,
    "real-time chunking": _real_time_chunking,
    "garbage": _garbage,
}


def _ask(transport: Transport, request: Message, timeouts: Timeouts) -> Message:
    transport.send(pack(request))
    answer = unpack(_bytes(transport, timeouts.first_infer))
    assert answer.id == request.id, f"answer {answer.id} came to request {request.id}"
    return answer


def _bytes(transport: Transport, timeout: float) -> bytes:
    data = transport.receive(timeout, "an answer")
    assert not isinstance(data, str), "a text frame came in robospa.v1"
    assert len(data) <= DEFAULT_LIMITS.message
    return data
