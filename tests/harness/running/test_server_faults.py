"""A run against fifty faulty servers at once: every fault ends as it should.

Two runs with real worker processes and real sockets, one server and three trials for every fault;
then what stops a run, each by itself.
"""

import re
import struct
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fault_server as do
import msgpack
import numpy as np
import pytest
from fault_server import ALWAYS, ONCE, ONES, SOUND, Fault, FaultyServer
from run_fakes import KEYED, SPEC, FakePolicy, FakeWorld, fake_config, parts

from robospa.harness.running.executor import RunAborted
from robospa.harness.running.policy_probe import probe
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.trial import run_trial
from robospa.protocol.codec import encode
from robospa.protocol.errors import WireError
from robospa.protocol.messages import Error, Hello, Ready
from robospa.protocol.transport import Timeouts
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

REPEATED = "repeated, then missing"
POLICY = "policy error"
CLIPPED = "clipped, and counted"
STOPS = "the run stops"
UNHARMED = "no trial is touched"
WAITED = "waited for, then missing"
HEAD = {"name": "head"}
HUGE = {"name": "head", "width": 10**9, "height": 1}
LARGE = {"name": "head", "width": 8192, "height": 8192}


@dataclass(frozen=True)
class Case:
    """One fault. `point`: see `fault_server`. `words` are in what the user is told. `hasty`: the
    deadlines are short."""

    name: str
    point: str
    fault: Fault
    end: str
    words: str = ""
    hasty: bool = False

    @property
    def seeds(self) -> tuple[int, ...]:
        """Sound trials, and one or two that the fault strikes."""
        once = self.hasty or self.point == "hello" or self.fault is do.restart
        return (SOUND, ONCE) if once else (SOUND, ONCE, ALWAYS)


def hello(**changes: Any) -> bytes:
    """A greeting whose spec says something else than was agreed."""
    greeting = {"type": "hello", "id": 0, "version": "1.1", "server": "faulty"}
    spec = {**KEYED.to_json(), "cameras": [], **changes}
    return encode({**greeting, "spec": spec})


def array(**changes: Any) -> Fault:
    """An answer whose chunk is an array that cannot be, as bytes that our own codec refuses."""
    good = {"__ndarray__": True, "data": bytes(112), "dtype": "<f4", "shape": [2, 14]}
    binary = {key.encode(): value for key, value in {**good, **changes}.items()}

    def fault(talk: do.Talk, id: int) -> None:
        message = {"type": "actions", "id": id, "chunk": binary, "timing": {}}
        talk.say(msgpack.packb(message))

    return fault


def spoiled(value: float) -> Fault:
    answer = ONES.copy()
    answer[1, 3] = value
    return do.chunk(answer)


def other(shape: tuple[int, ...], dtype: Any = np.float32) -> Fault:
    return do.chunk(np.ones(shape, dtype))


def back_as(name: str, greeting: bytes | Hello, words: str) -> Case:
    """A server that comes back as another."""
    return Case(name, "first", do.come_back_as(greeting), STOPS, words)


SHAPE = "not (T, D) with T from 1 to its horizon 4"
DROPPED = "closed without a reason"
CASES = (
    Case("open", "open", do.silence, WAITED, "finish the handshake", True),
    Case("greeting", "hello", do.silence, REPEATED, "did not send hello", True),
    Case("reset", "reset", do.silence, REPEATED, "did not send ready", True),
    Case("infer", "first", do.silence, REPEATED, "did not send actions", True),
    Case("late", "later", do.silence, REPEATED, "did not send actions", True),
    Case("drip", "first", do.drip, REPEATED, "did not send actions", True),
    Case("close", "later", do.hang_up, REPEATED, "1001: going down for maintenance"),
    Case("crash", "first", do.cut, REPEATED, DROPPED),
    Case("half", "first", do.cut_in_message, REPEATED, DROPPED),
    Case("restart", "later", do.restart, REPEATED, DROPPED),
    Case("between", "end", do.restart, UNHARMED),
    Case("nan", "first", spoiled(np.nan), POLICY, "nan in action 1, dimension 3"),
    Case("infinite", "later", spoiled(-np.inf), POLICY, "-inf in action 1, dimension 3"),
    Case("many", "first", other((5, 14)), POLICY, SHAPE),
    Case("million", "first", other((10**6, 14)), POLICY, SHAPE),
    Case("none", "first", other((0, 14)), POLICY, SHAPE),
    Case("flat", "first", other((14,)), POLICY, SHAPE),
    Case("narrow", "first", other((2, 7)), POLICY, "7 numbers per action"),
    Case("double", "first", other((2, 14), np.float64), POLICY, "float64"),
    Case("whole", "first", other((2, 14), np.int64), POLICY, "int64"),
    Case("far", "first", do.chunk(np.full((2, 14), 3.4e38, np.float32)), CLIPPED, "its limit 10"),
    Case("times", "first", do.chunk(ONES, infer_ms=np.nan, queue_ms=np.inf), UNHARMED),
    Case("object", "first", array(dtype="|O"), REPEATED, "dtype '|O' is no plain number"),
    Case("string", "first", array(dtype="<U4"), REPEATED, "dtype '<U4' is no plain number"),
    Case("claimed", "first", array(shape=[40_000_000, 14]), REPEATED, "112 bytes, not 2240000000"),
    Case("frame", "first", do.raw(struct.pack(">BBQ", 0x82, 127, 2**31)), REPEATED, "67108864"),
    Case("text", "first", do.instead("Traceback:\n\x1b[31mboom"), REPEATED, "a text frame came"),
    Case("truncated", "first", do.truncated, REPEATED, "112 bytes announced, 100 left"),
    Case("deep", "first", do.instead(b"\x91" * 100_000 + b"\xc0"), REPEATED, "nested deeper"),
    Case("noise", "first", do.raw(b"\xf2\x05noise"), REPEATED, "rules of WebSocket"),
    Case("id", "later", do.of_other_id(-1), REPEATED, "came to request"),
    Case("twice", "first", do.twice, REPEATED, "came to request"),
    Case("unasked", "first", do.unasked, REPEATED, "answer 1000000 came to request"),
    Case("type", "later", do.of_other_type, REPEATED, "ready came where actions was expected"),
    Case("again", "first", do.error("policy_failed", "CUDA error", True), POLICY, "CUDA error"),
    Case("never", "reset", do.error("policy_failed", "no checkpoint"), POLICY, "no checkpoint"),
    Case(
        "long",
        "first",
        do.error("policy_failed", "\x1b[31mCUDA\x07 error\r\n" + 10**6 * "A", True),
        POLICY,
        f"CUDA error {286 * 'A'}...; its traceback",
    ),
    Case("answer", "first", do.error("bad_answer", "answered a list"), POLICY, "answered a list"),
    Case("goodbye", "first", do.instead(Error(0, "going", "pre-empted")), REPEATED, "pre-empted"),
    Case("garbage", "hello", do.instead(b"\xc1"), REPEATED, "type 0xc1 does not exist"),
    Case("first-words", "hello", do.instead(Ready(0)), REPEATED, "where hello was expected"),
    Case("horizon", "hello", do.instead(hello(horizon=-5)), REPEATED, "'spec.horizon' must be"),
    Case("cameras", "hello", do.instead(hello(cameras=[HEAD] * 10_000)), REPEATED, "camera twice"),
    Case("pixels", "hello", do.instead(hello(cameras=[HUGE])), REPEATED, "cameras[0].width' must"),
    Case("name", "hello", do.instead(hello(name="\x1b[2Jbest")), REPEATED, "'\\x1b[2Jbest'"),
    back_as("too-large", hello(cameras=[LARGE]), "201 MB of images"),
    back_as("other", hello(horizon=9), "horizon was 4 and is 9"),
    back_as("checkpoint", hello(checkpoint="step 2000"), "checkpoint was '' and is 'step 2000'"),
    back_as("version", Hello(0, "2.0", "", SPEC), "protocol 2.0 and this is 1.1"),
)
RUN = [case for case in CASES if case.end != STOPS]
STOPPING = [case for case in CASES if case.end == STOPS]


@dataclass
class Seen:
    """What came of a run over several faulty servers."""

    records: dict[TrialKey, TrialRecord] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    urls: dict[str, str] = field(default_factory=dict)
    stopped: str = ""

    def of(self, case: Case, seed: int) -> TrialRecord:
        return self.records[TrialKey(case.name, 1, seed)]

    def told(self, case: Case) -> list[str]:
        """What the user was told of the trials of `case`."""
        return [note for note in self.notes if note.startswith(f"{case.name}-L1-")]


def run(cases: Iterable[Case], folder: Path, hasty: bool = False, workers: int = 2) -> Seen:
    """One run over the servers of all `cases`; a stall of this machine costs only an attempt."""
    limit, attempts = (0.4, 10) if hasty else (60.0, 3)
    deadlines = Timeouts(30, limit, limit, limit, limit, limit, limit, 0.2)
    seen = Seen()
    with ExitStack() as stack:
        for case in cases:
            seen.urls[case.name] = stack.enter_context(FaultyServer(case.point, case.fault))
        config = fake_config(folder, "", options={"timeouts": deadlines}, policies=seen.urls)
        keys = [TrialKey(case.name, 1, seed) for case in cases for seed in case.seeds]
        options = RunOptions(workers, attempts, backoff=0.01, give_up=len(keys))

        def keep(record: TrialRecord) -> None:
            seen.records[record.key] = record

        try:
            Runner(config, keys, options, keep, seen.notes.append).run()
        except RunAborted as error:
            seen.stopped = str(error)
    return seen


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """The two runs as one."""
    patient = run([c for c in RUN if not c.hasty], tmp_path_factory.mktemp("patient"))
    hasty = run([c for c in RUN if c.hasty], tmp_path_factory.mktemp("hasty"), True)
    assert not patient.stopped and not hasty.stopped
    both = patient.records | hasty.records
    return Seen(both, patient.notes + hasty.notes, patient.urls | hasty.urls)


@pytest.mark.parametrize("case", RUN, ids=lambda case: case.name)
def test_a_fault_ends_as_it_should(case: Case, seen: Seen) -> None:
    told, struck = seen.told(case), seen.of(case, ONCE)
    if case.end == POLICY:
        assert (struck.end, struck.success, struck.attempts) == ("policy_error", False, 1)
        assert case.words in struck.message
        assert seen.of(case, ALWAYS).message == struck.message
        assert told == []
    elif case.end == CLIPPED:
        assert struck.end == "success"
        assert struck.diagnostics["clipped_joints"] == struck.diagnostics["clipped_grippers"] > 0
        assert case.words in str(struck.diagnostics["first_clipped_joint"])
        assert told == []
    elif case.end == UNHARMED:
        assert struck.end == "success"
    elif case.end == WAITED:
        assert struck.end == "success"
        assert any(case.words in n and seen.urls[case.name] in n for n in seen.notes)
    else:
        assert case.end == REPEATED
        assert struck.end == "success"
        assert any(case.words in text and "trying again in 0.01 s" in text for text in told)
        if ALWAYS in case.seeds:
            lost = seen.of(case, ALWAYS)
            assert (lost.end, lost.attempts, lost.success) == ("infrastructure", 3, False)
            assert lost.candidates == 2
            assert case.words in lost.message


@pytest.mark.parametrize("case", RUN, ids=lambda case: case.name)
def test_no_other_trial_is_harmed(case: Case, seen: Seen) -> None:
    """Repeated or beside a fault: the same record as in a run without faults."""
    for seed in case.seeds:
        record = seen.of(case, seed)
        if seed == SOUND or (record.success and case.end != CLIPPED):
            policy, key = FakePolicy(SPEC), TrialKey(case.name, 1, seed)
            alone = run_trial(FakeWorld(), policy, key, policy_seed=0, parts=parts)
            assert record.success
            assert (record.digest, record.actions_digest) == (alone.digest, alone.actions_digest)


def test_every_sentence_is_one_line_of_printable_text(seen: Seen) -> None:
    said = [*seen.notes, *(record.message for record in seen.records.values())]
    assert all(text.isprintable() and len(text) < 600 for text in said)


@pytest.mark.parametrize("case", STOPPING, ids=lambda case: case.name)
def test_a_server_that_comes_back_as_another_stops_the_run(case: Case, tmp_path: Path) -> None:
    seen = run([case], tmp_path, workers=1)
    assert case.words in seen.stopped
    assert all(record.end == "success" for record in seen.records.values())


@pytest.mark.parametrize(
    "case", [c for c in RUN if c.point == "hello" and not c.hasty], ids=lambda case: case.name
)
def test_at_the_start_a_run_is_refused(case: Case) -> None:
    with (
        FaultyServer(case.point, case.fault) as url,
        pytest.raises(WireError, match=re.escape(case.words)),
    ):
        probe(url, {})
