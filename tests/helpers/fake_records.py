"""Records as a run writes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 1, 100000)


def trial_record(key: TrialKey = KEY, success: bool = False, **fields: Any) -> TrialRecord:
    """The record of a short trial of one subtask, with some of its fields given."""
    made = TrialRecord(
        key=key,
        category="GAC",
        instruction="go",
        scene_digest="",
        end="success" if success else "step_limit",
        success=success,
        done=int(success),
        best=int(success),
        total=1,
        candidates=2,
        steps=1,
        physics_steps=50,
        policy_calls=1,
        digest="",
        actions_digest="",
        wall_time=1.0,
    )
    return replace(made, **fields)


RECORD = trial_record(
    success=True,
    instruction="pick “it”",
    scene_digest="s",
    steps=3,
    physics_steps=15,
    digest="d",
    actions_digest="a",
    wall_time=0.5,
    events=({"time": 0.1, "kind": "success", "object": "", "index": -1, "note": ""},),
    latency={"p50": 1.0},
)


def other(seed: int) -> TrialRecord:
    return replace(RECORD, key=replace(KEY, seed=seed))
