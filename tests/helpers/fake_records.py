"""A record as a run writes it, and others like it."""

from __future__ import annotations

from dataclasses import replace

from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 1, 100000)
RECORD = TrialRecord(
    key=KEY,
    category="GAC",
    instruction="pick “it”",
    scene_digest="s",
    end="success",
    success=True,
    done=1,
    best=1,
    total=1,
    candidates=2,
    steps=3,
    physics_steps=15,
    policy_calls=1,
    digest="d",
    actions_digest="a",
    wall_time=0.5,
    events=({"time": 0.1, "kind": "success", "object": "", "index": -1, "note": ""},),
    latency={"p50": 1.0},
)


def other(seed: int) -> TrialRecord:
    return replace(RECORD, key=replace(KEY, seed=seed))
