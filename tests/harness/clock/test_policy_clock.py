"""Declared latencies, how they are written, drawn and frozen; and how chunks follow each other."""

from __future__ import annotations

import json
import math
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.harness.clock.policy_clock import (
    ClockError,
    Latency,
    Switching,
    declared_latency,
    frozen,
    latency_json,
    of_samples,
    parse_latency,
    parse_switching,
    read_latency,
)
from robospa.harness.clock.real_time import DECAY, Remaining


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


def test_draws_have_the_declared_distribution() -> None:
    latency = parse_latency("p0=50ms,p50=100ms,p95=300ms,p100=900ms")
    drawn = list(islice(latency.draws(3), 20_000))
    assert np.percentile(drawn, [50, 95]) == pytest.approx([100, 300], rel=0.03)
    assert min(drawn) >= 50 and max(drawn) <= 900


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
    clock = frozen(f"real:{file}")
    file.write_text("{}")
    assert clock == "real:p0=80ms,p50=120ms,p100=400ms"
    assert frozen(clock) == clock
    assert frozen("paused") == "paused"


@pytest.mark.parametrize("text", ["{", "[]", '{"latency_ms": "soon"}', '{"latency_ms": [null]}'])
def test_a_file_that_is_no_latency_is_named(tmp_path: Path, text: str) -> None:
    file = tmp_path / "broken.json"
    file.write_text(text)
    with pytest.raises(ClockError, match=r"broken\.json"):
        read_latency(file)


@pytest.mark.parametrize("text", ["real", "real:", "fast", "paused:200ms"])
def test_a_clock_that_does_not_exist_is_refused(text: str) -> None:
    with pytest.raises(ClockError, match="real:200ms"):
        declared_latency(text)


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


@pytest.mark.parametrize("text", ["", "after", "after:0", "wait:2", "arrival:2", "blend", "rtc:-1"])
def test_others_are_refused_with_those_there_are(text: str) -> None:
    with pytest.raises(ClockError, match="after:K"):
        parse_switching(text)


def test_waiting_executes_a_chunk_to_its_end_and_no_further_than_the_spec_says() -> None:
    remaining = Remaining(parse_switching("wait"), execute=3)
    assert remaining.wants_query
    remaining.arrive(0, 0, chunk(10))
    assert not remaining.wants_query
    assert [taken(remaining) for _ in range(4)] == [10, 11, 12, None]
    assert remaining.wants_query and remaining.executed == 3


def test_what_was_executed_meanwhile_is_left_out_of_a_chunk_that_arrives() -> None:
    remaining = Remaining(parse_switching("after:2"), execute=2)
    remaining.arrive(0, 0, chunk(10))
    assert [taken(remaining), remaining.wants_query] == [10, False]
    assert [taken(remaining), remaining.wants_query] == [11, True]
    taken(remaining)  # blind
    remaining.arrive(1, 2, chunk(20))
    assert taken(remaining) == 21


def test_a_time_in_which_the_robot_held_leaves_out_nothing() -> None:
    remaining = Remaining(parse_switching("arrival"))
    assert [taken(remaining), taken(remaining)] == [None, None]
    remaining.arrive(0, 0, chunk(10))
    assert taken(remaining) == 10


def test_a_chunk_that_comes_too_late_changes_nothing() -> None:
    remaining = Remaining(parse_switching("after:1"))
    remaining.arrive(0, 0, chunk(10, 8))
    for _ in range(5):
        taken(remaining)
    remaining.arrive(1, 1, chunk(20, 3))
    assert (remaining.left, taken(remaining)) == (3, 15)


def test_an_ensemble_weighs_chunks_by_their_age_as_act_does() -> None:
    remaining = Remaining(parse_switching("ensemble"))
    remaining.arrive(0, 0, chunk(0))
    taken(remaining)
    remaining.arrive(1, 1, chunk(101))
    action, query = remaining.take() or (None, None)
    old, new = 1.0, 101.0
    expected = (old + new * math.exp(-DECAY)) / (1 + math.exp(-DECAY))
    assert action is not None and action[0] == pytest.approx(expected, abs=2e-5)
    assert query == 1
    remaining.arrive(2, 2, chunk(202, 2))
    weights = [1.0, math.exp(-DECAY), math.exp(-2 * DECAY)]
    expected = float(np.average([2.0, 102.0, 202.0], weights=weights))
    assert taken(remaining) == pytest.approx(expected, abs=2e-5)


def test_committed_are_the_actions_that_are_left() -> None:
    remaining = Remaining(parse_switching("rtc"))
    assert remaining.committed().shape == (0, 0)
    remaining.arrive(0, 0, chunk(10))
    taken(remaining)
    assert remaining.committed()[:, 0].tolist() == [11, 12, 13]
