"""Hold, random and replay do what they say, repeatably."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robospa.baselines import hold, random, replay
from robospa.harness.running.record_store import write_actions
from robospa.protocol.policy import TrialInfo
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 3, 100007)
TRIAL = TrialInfo("Pick_Fake", KEY.embodiment, "", policy_seed=5, key=KEY)
STATE = np.linspace(0, 1, 14, dtype=np.float32)


def seen(step: int = 0) -> dict[str, Any]:
    return {"state": STATE, "step": step, "images": {}, "instruction": ""}


def test_hold_sends_the_state_back() -> None:
    chunk = hold.create().infer(seen())
    assert chunk.dtype == np.float32
    assert (chunk == STATE).all()


def test_random_depends_on_the_policy_seed_and_the_step_only() -> None:
    policy, other = random.create(), random.create()
    policy.reset(TRIAL)
    policy.infer(seen(10))
    other.reset(TRIAL)
    np.testing.assert_array_equal(policy.infer(seen(20)), other.infer(seen(20)))
    assert not np.array_equal(policy.infer(seen(20)), policy.infer(seen(30)))


def test_random_moves_otherwise_with_another_policy_seed() -> None:
    chunks = []
    for seed in (1, 2):
        policy = random.create()
        policy.reset(TrialInfo("T", "aloha-agilex", "Go.", seed))
        chunks.append(policy.infer(seen()))
    assert not np.array_equal(*chunks)


def test_random_keeps_grippers_in_range() -> None:
    chunk = random.create().infer(seen())
    assert chunk.shape == (random.CHUNK, 14)
    assert ((chunk[:, [6, 13]] >= 0) & (chunk[:, [6, 13]] <= 1)).all()


def test_replay_sends_exactly_what_was_recorded(tmp_path: Path) -> None:
    actions = np.random.default_rng(0).normal(size=(130, 14)).astype(np.float32)
    write_actions(tmp_path, KEY, actions, "joint")
    policy = replay.create(str(tmp_path))
    policy.reset(TRIAL)
    sent = np.concatenate([policy.infer(seen(0)), policy.infer(seen(100))])
    np.testing.assert_array_equal(sent, actions)
    np.testing.assert_array_equal(policy.infer(seen(500)), actions[-1:])


def test_replay_refuses_what_it_does_not_have(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no action traces"):
        replay.create(str(tmp_path))
    with pytest.raises(ValueError, match="--arg run="):
        replay.create()
    write_actions(tmp_path, KEY, np.ones((1, 14), np.float32), "joint")
    with pytest.raises(ValueError, match="no trace of Pick_Other"):
        replay.create(str(tmp_path)).reset(replace(TRIAL, key=replace(KEY, task="Pick_Other")))
