"""How full batches get, and what it costs, with clients of many kinds. In virtual time."""

from __future__ import annotations

import numpy as np
import pytest
from arrivals import Never, Pattern, between, play

QUICK = between(0.005, 0.015)
FULL = {
    "in step": (Pattern(between(0.01, 0.01)), 0.99),
    "jittered": (Pattern(QUICK), 0.98),
    "two": (Pattern(between(0.02, 0.03), clients=2), 0.95),
    "a slower one": (Pattern(lambda r, i, t: 0.04 if i == 0 else QUICK(r, i, t)), 0.9),
    "a straggler": (Pattern(lambda r, i, t: 0.12 if i == 0 else QUICK(r, i, t)), 0.85),
    "calls of many lengths": (Pattern(QUICK, vary=(0.6, 1.8)), 0.95),
    "half as many places": (Pattern(QUICK, size=4), 0.95),
    "more than places": (Pattern(QUICK, clients=12), 0.9),
    "a cost per item": (Pattern(between(0.02, 0.06), fixed=0.1, each=0.002), 0.9),
}
"""Pattern and the least fill that is wanted of it."""
ALL = {
    **{name: pattern for name, (pattern, _) in FULL.items()},
    "any pause": Pattern(lambda r, i, t: r.exponential(0.05)),
    "a simulation between": Pattern(between(1, 3), seconds=30),
    "now and then a long pause": Pattern(
        lambda r, i, t: 0.5 if r.random() < 0.1 else QUICK(r, i, t)
    ),
    "bursts": Pattern(lambda r, i, t: (np.ceil((t + 1e-6) / 0.2) * 0.2 - t) + r.uniform(0, 0.01)),
    "coming and going": Pattern(QUICK, rest=20),
    "nothing gained by batches": Pattern(QUICK, fixed=0.0, each=0.01),
    "a quick model": Pattern(between(0.01, 0.03), fixed=0.005, seconds=3),
    "as long as the call": Pattern(between(0.08, 0.12), fixed=0.1, each=0.002),
}


@pytest.mark.parametrize("name", FULL)
def test_batches_are_full(name: str) -> None:
    pattern, wanted = FULL[name]
    assert play(pattern).fill >= wanted


@pytest.mark.parametrize("name", ALL)
def test_waiting_never_costs_what_it_should_gain(name: str) -> None:
    pattern = ALL[name]
    ours, never = play(pattern), play(pattern, Never)
    assert ours.rate >= 0.98 * never.rate
    assert ours.latency <= 1.04 * never.latency


def test_eight_quick_clients_get_the_models_limit() -> None:
    seen = play(Pattern(QUICK, fixed=0.1, each=0.002))
    # the limit of such clients in step: the slowest of eight pauses, then the call
    assert seen.rate >= 0.95 * 8 / (0.116 + 0.015)


def test_a_lone_client_never_waits() -> None:
    assert play(Pattern(QUICK, clients=1)).longest_wait == 0


def test_nobody_waits_longer_than_two_calls() -> None:
    seen = play(Pattern(lambda r, i, t: r.exponential(0.03)))
    assert seen.longest_wait <= 0.101


def test_the_same_arrivals_give_the_same_batches() -> None:
    pattern = Pattern(lambda r, i, t: r.exponential(0.02), seconds=4)
    assert play(pattern) == play(pattern)
