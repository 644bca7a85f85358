"""How chunks follow each other: what is left, what is taken, when the next one is asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robospa.harness.clock.policy_clock import Switching, SwitchingError, parse_switching
from robospa.harness.clock.real_time import DECAY, Remaining


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
    with pytest.raises(SwitchingError, match="after:K"):
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
