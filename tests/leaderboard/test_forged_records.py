"""Records that no trial of our harness has: each impossible value is refused, whoever sealed it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundle_fakes import (
    PICK,
    REFERENCE,
    Files,
    edit,
    edit_row,
    refused,
    relist,
    rows_of,
    seal,
    zip_up,
)

from robospa.harness.sim.motion import RATE
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.rules import check_scenes, first_wrong
from robospa.leaderboard.traces import Trace
from robospa.leaderboard.trial_rows import check_record, check_trace
from robospa.leaderboard.verify import Valid, read_traces, verify
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey

Change = Callable[[TrialRecord], TrialRecord]


@pytest.fixture(scope="module")
def valid(honest: Path) -> Valid:
    return verify(honest, REFERENCE)


def of_end(valid: Valid, end: str) -> TrialRecord:
    return next(r for r in valid.run.records.values() if r.end == end and r.key.task == PICK)


def put(**fields: Any) -> Change:
    return lambda record: replace(record, **fields)


def event(kind: str, **fields: Any) -> dict[str, Any]:
    return {"time": 0.0, "kind": kind, "object": "", "index": -1, "note": "", "step": 0, **fields}


def and_event(*more: Mapping[str, Any]) -> Change:
    return lambda record: replace(record, events=(*record.events, *more))


def before(*more: Mapping[str, Any]) -> Change:
    return lambda record: replace(record, events=(*more, *record.events))


def first_event(**fields: Any) -> Change:
    return lambda r: replace(r, events=({**r.events[0], **fields}, *r.events[1:]))


def last_event(**fields: Any) -> Change:
    return lambda r: replace(r, events=(*r.events[:-1], {**r.events[-1], **fields}))


LATENCY = {"p50": 1e-3, "p95": 1e-3, "p99": 1e-3, "max": 1e-3}
CASES: list[tuple[str, str, Change, str]] = [
    ("no actions", "success", put(steps=0), "nothing happens without any"),
    ("no physics", "success", put(physics_steps=0), "nothing happens without any"),
    ("no queries", "success", put(policy_calls=0), "nothing happens without any"),
    ("no actions at all", "step_limit", put(steps=0), "ends at its limit of 20 actions after 0"),
    ("too many actions", "success", put(steps=10_000), "the limit is 20"),
    ("ended early", "step_limit", put(steps=19), "ends at its limit of 20 actions after 19"),
    ("too few queries", "step_limit", put(policy_calls=4), "an answer has at most 4"),
    ("too many queries", "step_limit", put(policy_calls=21), "every answer has an action"),
    ("less physics", "step_limit", put(physics_steps=19), "fewer physics steps than actions"),
    ("candidates", "success", put(candidates=99), "candidates is 99"),
    ("total", "success", put(total=1), "total is 1"),
    ("category", "success", put(category="MIP"), "category is 'MIP'"),
    ("policy seed", "success", put(policy_seed=1), "policy_seed is 1"),
    ("lost", "success", put(end="infrastructure"), "has no result"),
    ("success", "step_limit", put(success=True), "its events say False"),
    ("end", "success", put(end="step_limit"), "ends at its limit"),
    ("end alone", "success", put(end="policy_error"), "ends in policy_error and claims success"),
    (
        "lost goal",
        "policy_error",
        put(end="goal_lost", physics_steps=6),
        "which its events do not say once",
    ),
    (
        "lost unsaid",
        "step_limit",
        and_event(event("failed", time=20 / RATE, step=20)),
        "do not say once",
    ),
    ("succeeded twice", "success", last_event(kind="grasped"), "its events say False"),
    ("goes on", "success", put(physics_steps=21), "goes on after"),
    ("won before", "success", last_event(step=0), "go back in time|goes on after"),
    ("unknown event", "success", first_event(kind="flew"), "the unknown kind 'flew'"),
    ("subtask", "success", before(event("subtask_done", index=2)), "subtask 2; there are 2"),
    ("late event", "success", last_event(time=60.0), "outside the trial's time"),
    ("early event", "success", first_event(time=-1.0), "outside the trial's time"),
    ("late step", "success", last_event(step=21), "outside the trial's time"),
    ("back in time", "success", and_event(event("closed")), "go back in time"),
    ("attempts", "success", put(attempts=10**6), "tried 1000000 times"),
    ("none", "success", put(attempts=0), "tried 0 times"),
    ("causes", "success", put(attempts=3), "gives the causes of 0"),
    (
        "too many retries",
        "success",
        put(attempts=12, retries=(RetryRow("connection_lost"),) * 11),
        "11 times at most",
    ),
    (
        "long retry",
        "success",
        put(attempts=2, retries=(RetryRow("deadline", "", 21),)),
        "an attempt of more than 20 actions",
    ),
    ("wall time", "success", put(wall_time=-1.0), "a time below zero"),
    ("timing", "success", put(timing={"physics": -1e-9}), "a time below zero"),
    ("no latency", "success", put(latency={}), "0 times of answers"),
    ("latency", "success", put(latency={**LATENCY, "p95": 0.5}), "no percentiles"),
    ("below zero", "success", put(latency={**LATENCY, "p50": -1}), "no percentiles"),
    ("waited", "success", put(latency={**LATENCY, "max": 1e9}), "waited longer"),
    ("unreachable", "success", put(diagnostics={"unreachable_actions": 21}), "unreachable ones"),
]


@pytest.mark.parametrize(
    ("end", "change", "words"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_a_record_that_cannot_be(valid: Valid, end: str, change: Change, words: str) -> None:
    record = of_end(valid, end)
    check_record(record, REFERENCE, valid.settings)
    with pytest.raises(BundleError, match=words):
        check_record(change(record), REFERENCE, valid.settings)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("end", "vanished", "'end' must be one of success, "),
        ("success", 1, "'success' must be true or false, not 1"),
        ("wall_time", 0.0, "waited longer|faster than physics"),
        ("steps", 0, "nothing happens without any"),
        ("attempts", 10**6, "tried 1000000 times"),
        ("instruction", "x", r"has another sentence \('x', not 'level 1: sum to 1'\)"),
        ("scene_digest", "0" * 16, r"has another scene \('0000000000000000', not "),
    ],
)
def test_a_bundle_with_such_a_record_is_refused(
    files: Files, tmp_path: Path, field: str, value: Any, words: str
) -> None:
    import re

    edit_row(files, 0, lambda row: row["record"].update({field: value}))
    assert re.search(words, refused(zip_up(tmp_path / "b.zip", seal(files))))


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("mode", "moonlight", "the run's mode is 'moonlight', which is not known here"),
        ("embodiment", "humanoid-9000", "the run's embodiment is 'humanoid-9000', which is not"),
        ("split", "easy", "the run's split is 'easy', which is not known here"),
    ],
)
def test_unknown_modes_robots_and_splits_are_refused(
    files: Files, tmp_path: Path, field: str, value: str, words: str
) -> None:
    rows = rows_of(files)
    edit(files, layout.RUN, lambda run: run["settings"].update({field: [value]}))
    relist(files, [TrialKey(**{**row["record"]["key"], field: value}) for row in rows])
    assert refused(zip_up(tmp_path / "b.zip", seal(files))).startswith(words)


@pytest.mark.parametrize(
    ("policies", "words"),
    [
        ({"Easy_Task": {"spec": {"name": "x", "action": "joint"}}}, "a policy for 'Easy_Task'"),
        ({PICK: {"spec": {"name": "x", "action": "joint"}}}, "hold no policy spec for Press"),
        ({PICK: None}, "'settings.policies' must be a map"),
        ({PICK: {"spec": {"name": "x", "action": "fly"}}}, "must be one of joint"),
        (
            {PICK: {"spec": {"name": "x", "action": "joint", "horizon": 0}}},
            "must be a whole number >= 1",
        ),
        ([], "must be a map"),
        ("pi0.5", "must be a map"),
    ],
)
def test_odd_policies_are_refused(files: Files, tmp_path: Path, policies: Any, words: str) -> None:
    edit(files, layout.RUN, lambda run: run["settings"].update(policies=policies))
    assert words in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_physics_steps_are_those_of_the_actions(valid: Valid) -> None:
    record = of_end(valid, "step_limit")
    [trace] = read_traces(valid, [record.key]).values()
    digest = record.actions_digest
    check_trace(record, trace, digest, REFERENCE, "joint")
    for steps in (19, 21, 10**6):
        other = replace(record, physics_steps=steps)
        with pytest.raises(BundleError, match=f"{steps} physics steps; its actions take 20"):
            check_trace(other, trace, digest, REFERENCE, "joint")


def test_the_last_action_ends_with_the_goal(valid: Valid) -> None:
    def slow(robot: str, trace: Trace) -> Any:
        return np.full(len(trace), 100)

    record = of_end(valid, "success")
    [trace] = read_traces(valid, [record.key]).values()
    reference, count = replace(REFERENCE, durations=slow), len(trace)
    for steps, right in (
        (100 * (count - 1), False),
        (100 * (count - 1) + 1, True),
        (100 * count, True),
        (100 * count + 1, False),
    ):
        other = replace(record, physics_steps=steps)
        if right:
            check_trace(other, trace, record.actions_digest, reference, "joint")
            continue
        with pytest.raises(BundleError, match="its actions take"):
            check_trace(other, trace, record.actions_digest, reference, "joint")


def test_all_scenes_are_made_again(valid: Valid) -> None:
    records, seen = dict(valid.run.records), list[tuple[int, int]]()
    check_scenes(records, REFERENCE.parts, done=lambda *counts: seen.append(counts))
    assert seen[-1] == (40, 40) and len(seen) == 10
    key = list(records)[-1]
    records[key] = replace(records[key], scene_digest="f" * 16)
    with pytest.raises(BundleError, match=f"{key.slug} has another scene"):
        check_scenes(records, REFERENCE.parts)


def test_other_processes_make_scenes_too(valid: Valid, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robospa.leaderboard.rules.FEW", 0)
    records = dict(valid.run.records)
    check_scenes(records, REFERENCE.parts, workers=2)
    key = list(records)[-1]
    records[key] = replace(records[key], instruction="x")
    with pytest.raises(BundleError, match=f"{key.slug} has another sentence"):
        check_scenes(records, REFERENCE.parts, workers=2)


def test_a_real_scene_and_sentence_are_made_again() -> None:
    from robospa.harness.trial import task_parts
    from robospa.harness.worlds import TASK_PARTS

    key = TrialKey(PICK, 1, 100000)
    found = task_parts(key)
    assert first_wrong(TASK_PARTS, [(key, found.scene.digest, found.instruction)]) == ""
    train = replace(key, split="train")
    text = first_wrong(TASK_PARTS, [(train, found.scene.digest, found.instruction)])
    assert "has another sentence" in text
    text = first_wrong(TASK_PARTS, [(replace(key, mode="moonlight"), "", "")])
    assert "is no trial of this suite" in text
