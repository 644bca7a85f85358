"""The grid of executed actions: exact, idempotent, and what is recorded is what was executed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from run_fakes import FakePolicy, FakeWorld, parts

from robospa.action_space import STEPS_PER_UNIT, is_quantized, quantize
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.trial import actions_digest, run_trial
from robospa.harness.world import Poll, StepResult
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Blocks_Size", 1, 100000)
FINITE = arrays(np.float32, (4, 3), elements=st.floats(width=32, allow_nan=False,
                                                       allow_infinity=False))  # fmt: skip


@settings(max_examples=100, deadline=None)
@given(FINITE)
def test_rounding_again_changes_no_bit(actions: np.ndarray) -> None:
    once = quantize(actions)
    assert once.dtype == np.float32
    assert quantize(once).tobytes() == once.tobytes()
    assert is_quantized(once)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float32, 5, elements=st.floats(-200, 200, width=32)))
def test_nothing_moves_by_more_than_half_a_step(actions: np.ndarray) -> None:
    moved = np.abs(quantize(actions).astype(float) - actions.astype(float))
    assert moved.max() <= 0.5 / STEPS_PER_UNIT


@pytest.mark.parametrize(
    ("number", "rounded"),
    [(0.1, 6554 / 65536), (1.0, 1.0), (-0.25, -0.25), (1e30, 32767.0), (-1e30, -32767.0)],
)
def test_single_numbers(number: float, rounded: float) -> None:
    assert quantize(np.array([number], np.float32))[0] == rounded


def test_minus_zero_becomes_zero() -> None:
    rounded = quantize(np.array([-0.0, -1e-9], np.float32))
    assert not np.signbit(rounded).any()


@pytest.mark.parametrize("odd", [0.1, -0.0, np.nan, np.inf, 1e30])
def test_what_is_not_on_the_grid_is_noticed(odd: float) -> None:
    assert not is_quantized(np.array([odd], np.float32))


class Watching(FakeWorld):
    """Keeps what it was asked to execute."""

    def __init__(self) -> None:
        super().__init__()
        self.executed: list[np.ndarray] = []

    def step(self, action: Any, space: str, poll: Poll) -> StepResult:
        self.executed.append(np.array(action))
        return super().step(action, space, poll)


class Jittery(FakePolicy):
    """Answers numbers with bits below the grid."""

    def infer(self, observation: Any) -> Any:
        return super().infer(observation) + np.float32(1e-3 / 3)


def test_what_is_executed_is_on_the_grid_and_is_what_is_recorded() -> None:
    world, recorder = Watching(), ActionRecorder()
    record = run_trial(world, Jittery(), KEY, policy_seed=1, recorder=recorder, parts=parts)
    assert is_quantized(np.stack(world.executed))
    assert np.array_equal(np.stack(world.executed), recorder.actions)
    assert actions_digest(list(recorder.actions)) == record.actions_digest
