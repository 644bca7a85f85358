"""Declared latencies: how they are written, drawn and frozen."""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robospa.harness.clock.policy_clock import (
    ClockError,
    Latency,
    LatencyError,
    declared_latency,
    frozen,
    latency_json,
    of_samples,
    parse_latency,
    read_latency,
)


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
    with pytest.raises(LatencyError, match=says):
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
    with pytest.raises(LatencyError, match=r"broken\.json"):
        read_latency(file)


@pytest.mark.parametrize("text", ["real", "real:", "fast", "paused:200ms"])
def test_a_clock_that_does_not_exist_is_refused(text: str) -> None:
    with pytest.raises(ClockError, match="real:200ms"):
        declared_latency(text)
