"""Declared latencies, how they are written, drawn and frozen; and how chunks follow each other."""

import json
import math
import threading
import time
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clock_fakes import TargetWorld, Walker
from command_line import robospa
from hypothesis import given
from hypothesis import strategies as st
from run_fakes import LIMIT, FakePolicy, parts
from wire_helpers import SPEC, Recall

from robospa.clients import connect
from robospa.harness import server_checks as module
from robospa.harness.clock.policy_clock import (
    ClockError,
    Latency,
    PolicyClock,
    Switching,
    Timing,
    declared_latency,
    frozen_timing,
    latency_json,
    of_samples,
    parse_latency,
    parse_switching,
    read_latency,
)
from robospa.harness.clock.real_time import DECAY, ENTRY, Chunk, Remaining
from robospa.harness.replay import replay
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.server_checks import measure
from robospa.harness.trial import run_trial
from robospa.protocol.errors import WireError
from robospa.protocol.policy import PolicySpec
from robospa.protocol.server import ServerThread
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey


@pytest.mark.parametrize(
    ("text", "milliseconds"), [("0", 0.0), ("200ms", 200.0), ("0.2s", 200.0), ("12.5ms", 12.5)]
)
def test_a_constant_is_written_with_its_unit(text: str, milliseconds: float) -> None:
    latency = parse_latency(text)
    assert latency.constant == milliseconds
    assert list(islice(latency.draws(1), 3)) == [milliseconds] * 3


def test_between_percentiles_it_is_linear_and_beyond_them_constant() -> None:
    latency = parse_latency("p10=100ms,p50=200ms,p90=0.4s")
    assert [latency.at(share) for share in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)] == pytest.approx(
        [100, 100, 150, 200, 300, 400, 400]
    )
    assert latency.constant is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("200", "write 200ms"),
        ("p50=120", "'120' is no time"),
        ("p50=120ms,300ms", "'300ms' is no percentile"),
        ("p99=100ms,p50=120ms", "grow"),
        ("p50=120ms,p99=100ms", "do not fall"),
        ("p101=1ms", "0 to 100"),
        ("61s", "60000 ms"),
        ("nowhere.json", "cannot be read"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(text: str, says: str) -> None:
    with pytest.raises(ClockError, match=says):
        parse_latency(text)


@given(
    st.lists(st.integers(0, 60_000_000), min_size=1, max_size=20),
    st.lists(st.integers(0, 100), min_size=20, max_size=20, unique=True),
)
def test_what_is_written_is_read_again_to_the_bit(values: list[int], places: list[int]) -> None:
    points = zip(sorted(places)[: len(values)], sorted(values), strict=True)
    latency = Latency(tuple((float(p), v / 1000.0) for p, v in points))
    again = parse_latency(str(latency))
    assert [again.at(u) for u in (0.0, 0.3, 1.0)] == [latency.at(u) for u in (0.0, 0.3, 1.0)]


def test_draws_follow_from_the_policy_seed_alone() -> None:
    latency = parse_latency("p0=0ms,p100=1s")
    first, again = (list(islice(latency.draws(7), 50)) for _ in range(2))
    assert first == again
    assert first != list(islice(latency.draws(8), 50))
    assert len(set(first)) == 50


def test_a_file_of_samples_becomes_their_percentiles(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    samples = np.random.default_rng(1).gamma(4.0, 40.0, 5000).tolist()
    file.write_text(json.dumps({"latency_ms": samples}))
    latency = read_latency(file)
    assert len(latency.points) == 101
    assert latency.at(0.5) == pytest.approx(np.median(samples), abs=0.01)
    assert latency.at(1.0) == pytest.approx(max(samples), abs=0.01)


def test_a_clock_is_frozen_with_what_its_file_holds(tmp_path: Path) -> None:
    file = tmp_path / "server.json"
    file.write_text(json.dumps(latency_json(of_samples([80.0, 120.0, 400.0]))))
    timing = frozen_timing(Timing(clock=f"real:{file}"))
    file.write_text("{}")
    assert timing.clock == "real:p0=80ms,p50=120ms,p100=400ms"
    assert frozen_timing(timing) == timing
    assert frozen_timing(Timing()) == Timing()
    for held in ([1.0, 2, 3, 4], {"p33.3333333": 1.23456789, "p50": 2}):
        file.write_text(json.dumps({"latency_ms": held}))
        exact = Timing(clock=f"real:{file}")
        frozen = declared_latency(frozen_timing(exact).clock)
        assert frozen == declared_latency(exact.clock)


@pytest.mark.parametrize("text", ["{", "[]", '{"latency_ms": "soon"}', '{"latency_ms": [null]}',
    f'{{"latency_ms": [1{"0" * 400}]}}'])  # fmt: skip
def test_a_file_that_is_no_latency_is_named(tmp_path: Path, text: str) -> None:
    file = tmp_path / "broken.json"
    file.write_text(text)
    with pytest.raises(ClockError, match=r"broken\.json"):
        read_latency(file)


CLOCKS = ("real", "real:", "fast", "paused:200ms")
RULES = ("", "after", "after:0", "wait:2", "arrival:2", "blend", "rtc:-1")


@pytest.mark.parametrize(
    ("read", "text", "known"),
    [
        *((declared_latency, text, "real:200ms") for text in CLOCKS),
        *((parse_switching, text, "after:K") for text in RULES),
    ],
)
def test_others_are_refused_with_those_there_are(read: Any, text: str, known: str) -> None:
    with pytest.raises(ClockError, match=known):
        read(text)


def chunk(first: float, length: int = 4) -> np.ndarray:
    """Actions first, first + 1, ..."""
    return (first + np.arange(length))[:, None].astype(np.float32) * np.ones(2, np.float32)


def taken(remaining: Remaining) -> float | None:
    found = remaining.take()
    return None if found is None else float(found[0][0])


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("wait", Switching()),
        ("arrival", Switching("arrival", 1)),
        ("after:8", Switching("after", 8)),
        ("ensemble", Switching("ensemble", 1)),
        ("ensemble:3", Switching("ensemble", 3)),
        ("rtc:5", Switching("rtc", 5)),
    ],
)
def test_rules_are_read(text: str, rule: Switching) -> None:
    assert parse_switching(text) == rule
    assert parse_switching(str(rule)) == rule


def test_a_chunk_that_comes_too_late_changes_nothing() -> None:
    remaining = Remaining(parse_switching("after:1"))
    remaining.arrive(Chunk(0, 0, chunk(10, 8)))
    for _ in range(5):
        taken(remaining)
    remaining.arrive(Chunk(1, 1, chunk(20, 3)))
    assert (remaining.left, taken(remaining)) == (3, 15)


def test_an_ensemble_weighs_chunks_by_their_age_as_act_does() -> None:
    remaining = Remaining(parse_switching("ensemble"))
    remaining.arrive(Chunk(0, 0, chunk(0)))
    taken(remaining)
    remaining.arrive(Chunk(1, 1, chunk(101)))
    action, query = remaining.take() or (None, None)
    old, new = 1.0, 101.0
    expected = (old + new * math.exp(-DECAY)) / (1 + math.exp(-DECAY))
    assert action is not None and action[0] == pytest.approx(expected, abs=2e-5)
    assert query == 1
    remaining.arrive(Chunk(2, 2, chunk(202, 2)))
    weights = [1.0, math.exp(-DECAY), math.exp(-2 * DECAY)]
    expected = float(np.average([2.0, 102.0, 202.0], weights=weights))
    assert taken(remaining) == pytest.approx(expected, abs=2e-5)


# --------- A trial in real time: what is executed while the policy thinks, and what the record says


KEY = TrialKey("Pick_Fake", 2, 100004)
"""Its goal is ten actions of the walker away."""


def real(latency: str, switching: str = "wait", **more: Any) -> PolicyClock:
    """A clock with periods of 60 ms."""
    return PolicyClock(parse_latency(latency), parse_switching(switching), **more)


def play(
    policy: FakePolicy, clock: PolicyClock | None, key: TrialKey = KEY, seed: int = 7, **more: Any
) -> TrialRecord:
    return run_trial(TargetWorld(), policy, key, policy_seed=seed, parts=parts, clock=clock, **more)


def without_times(record: TrialRecord) -> TrialRecord:
    """What has to be equal to the bit."""
    rest = {name: value for name, value in record.diagnostics.items() if name != ENTRY}
    return replace(record, wall_time=0.0, latency={}, timing={}, diagnostics=rest)


@pytest.mark.parametrize(
    ("switching", "execute"),
    [("wait", None), ("wait", 3), ("after:3", 3), ("arrival", 1), ("rtc:2", 2)],
)
def test_without_latency_it_is_the_paused_clock_at_the_same_rate(
    switching: str, execute: int | None
) -> None:
    clocks = (None, real("0", switching))
    paused, timed = (without_times(play(Walker(execute=execute), clock)) for clock in clocks)
    assert timed == paused and paused.success


def test_waiting_holds_for_every_answer() -> None:
    record = play(Walker(), real("120ms"))
    found = record.diagnostics[ENTRY]
    assert (record.success, record.steps, record.policy_calls) == (True, 16, 3)
    assert (found["held"], found["blind"], found["seams"]) == (6, 0, 2)
    assert found["held_spans"] == [[0, 2], [6, 8], [12, 14]]
    assert (found["asked"], found["arrived"]) == ([0, 6, 12], [2, 8, 14])


def test_an_answer_counts_in_whole_periods() -> None:
    assert [real("0").delay(ms) for ms in (0.0, 0.5, 60.0, 60.1, 200.0)] == [0, 1, 1, 2, 4]


def test_replacing_on_arrival_goes_on_blindly_and_never_holds_again() -> None:
    policy = Walker()
    record = play(policy, real("120ms", "arrival"))
    found = record.diagnostics[ENTRY]
    assert (record.success, record.steps) == (True, 12)
    assert found["held_spans"] == [[0, 2]]
    assert found["asked"] == [0, 3, 5, 7, 9, 11]
    assert found["arrived"] == [2, 5, 7, 9, 11]
    assert found["blind"] == 9
    assert [seen["step"] for seen in policy.seen] == found["asked"]
    assert [seen["state"][0] for seen in policy.seen] == [0.0, 0.5, 1.5, 2.5, 3.5, 4.5]
    assert [seen["executed"] for seen in policy.seen] == [0, 1, 3, 5, 7, 9]


def test_the_time_that_a_step_limit_takes_is_the_time_limit() -> None:
    record = play(Walker(), real("300ms"))
    assert (record.end, record.success, record.steps) == ("time_limit", False, LIMIT)
    assert record.physics_steps == 15 * LIMIT
    assert record.diagnostics[ENTRY]["held"] == 5 + 5 + 2


def test_a_longer_time_limit_leaves_the_limit_of_actions() -> None:
    assert play(Walker(), real("300ms", seconds=60.0)).success
    far = replace(KEY, seed=100009)
    record = play(Walker(length=1), real("60ms", seconds=60.0), far)
    assert record.success  # exactly as many actions as the limit has
    assert (record.steps, record.diagnostics[ENTRY]["held"]) == (2 * LIMIT, LIMIT)
    slow = Walker()
    slow.infer = lambda seen: np.asarray(seen["state"], np.float32)[None]  # type: ignore[method-assign]
    record = play(slow, real("60ms", seconds=60.0), far)
    assert (record.end, record.steps) == ("step_limit", 2 * LIMIT)


def test_latencies_of_a_trial_do_not_depend_on_what_ran_before() -> None:
    clock = real("p0=0ms,p100=400ms", "arrival")
    alone = play(Walker(), clock)
    play(Walker(), clock, replace(KEY, level=1, seed=100007), seed=8)
    assert without_times(play(Walker(), clock)) == without_times(alone)
    assert alone.diagnostics[ENTRY]["max_latency_ms"] <= 400


def test_another_policy_waits_equally_long() -> None:
    clock = real("p0=0ms,p100=400ms")
    one, two = (play(Walker(length=n), clock).diagnostics[ENTRY] for n in (4, 3))
    waits = [
        [then - asked for asked, then in zip(x["asked"], x["arrived"], strict=False)][:3]
        for x in (one, two)
    ]
    assert waits[0] == waits[1]


def test_the_recorded_actions_give_the_trial_again_without_a_clock() -> None:
    recorder = ActionRecorder()
    record = play(Walker(), real("120ms"), recorder=recorder)
    again = replay(TargetWorld(), KEY, recorder.actions, "joint", policy_seed=7, parts=parts)
    assert (again.digest, again.actions_digest) == (record.digest, record.actions_digest)


def test_real_time_chunking_sends_what_is_left_and_how_much_of_it_will_pass() -> None:
    policy = Walker(length=6)
    record = play(policy, real("120ms", "rtc:3"))
    assert record.success
    sent = [(len(seen["committed"]), seen["delay"]) for seen in policy.seen]
    assert sent[:3] == [(0, 0), (3, 2), (3, 2)]
    assert policy.seen[0]["committed"].shape == (0, 14)
    assert policy.seen[1]["committed"][:, 0].tolist() == [2.0, 2.5, 3.0]
    plain = Walker(length=6)
    play(plain, real("120ms", "after:3"))
    assert all("committed" not in seen for seen in plain.seen)


def test_the_delay_is_foretold_from_the_last_answers() -> None:
    policy = Walker(length=8)
    record = play(policy, real("p0=0ms,p100=300ms", "rtc:2"))
    found = record.diagnostics[ENTRY]
    waits = [then - asked for asked, then in zip(found["asked"], found["arrived"], strict=False)]
    for n, seen in enumerate(policy.seen[1:], 1):
        assert seen["delay"] == min(max(waits[:n]), len(seen["committed"]))


def test_history_counts_periods() -> None:
    policy = Walker(length=2)
    policy.spec = replace(policy.spec, history=(-3,))
    play(policy, real("120ms", "after:1"))
    for seen in policy.seen[2:]:
        assert seen["history"][-3]["state"].shape == (14,)


@pytest.mark.parametrize("space", ["ee", "delta_ee"])
def test_a_robot_that_is_told_poses_holds_before_its_first_action(space: str) -> None:
    class Poses(FakePolicy):
        def infer(self, observation: Any) -> np.ndarray:
            self.seen.append(dict(observation))
            row = np.zeros((2, 8), np.float32)
            row[:, 3] = 1.0
            return np.tile(row.reshape(-1), (3, 1))

    class Posed(TargetWorld):
        def observe(self, spec: PolicySpec) -> dict[str, Any]:
            poses = [[side, -0.1, 0.9, 1.0, 0.0, 0.0, 0.0, 1.0] for side in (-0.3, 0.3)]
            return {**super().observe(spec), "ee": np.array(poses, np.float32)}

    policy = Poses(replace(Poses().spec, action=space, action_dim=16))
    record = run_trial(Posed(), policy, KEY, policy_seed=7, parts=parts, clock=real("60ms"))
    assert record.end == "time_limit"
    assert record.diagnostics[ENTRY]["held"] == LIMIT // 4


# ----------- A server's latency under one, four and eight clients, and the clock that stands for it


class Slow(Recall):
    """Takes ten milliseconds, one request at a time."""

    busy = threading.Lock()

    def infer(self, observation: Any) -> np.ndarray:
        with Slow.busy:
            time.sleep(0.01)
        return super().infer(observation)


def test_each_number_of_clients_asks_as_often_and_more_of_them_wait_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "QUERIES", 6)
    with ServerThread(policy_factory=lambda: Slow(SPEC)) as server:
        one, four = measure(lambda: connect(server.url), 30.0, (1, 4))
    assert (one.clients, len(one.latencies)) == (1, 6)
    assert (four.clients, len(four.latencies)) == (4, 24)
    assert min(one.latencies) >= 10.0
    # One model for four: whoever asks while another is served waits for its turn.
    assert four.latency.at(1.0) >= 20.0
    assert list(four.latencies) == sorted(four.latencies)


def test_a_server_that_goes_away_is_an_error_and_nobody_waits_for_ever() -> None:
    class Gone(Recall):
        def infer(self, observation: Any) -> np.ndarray:
            raise RuntimeError("out of memory")

    with (
        ServerThread(policy_factory=lambda: Gone(SPEC)) as server,
        pytest.raises(WireError, match="out of memory"),
    ):
        measure(lambda: connect(server.url), 1.0, (3,))


def test_check_prints_the_clock_that_stands_for_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "QUERIES", 3)
    with ServerThread(policy_factory=lambda: Recall(SPEC)) as server:
        done = robospa("check", server.url, "--trials", "0")
    lines = [line.strip() for line in done.out.splitlines()]
    clocks = [line for line in lines if line.startswith("--clock real:")]
    assert len(clocks) == 3, "for one, four and eight robots"
    assert declared_latency(clocks[0].split()[1]) is not None
