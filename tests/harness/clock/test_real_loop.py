"""A trial in real time: what is executed while the policy thinks, and what the record says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clock_fakes import TargetWorld, Walker
from run_fakes import LIMIT, FakePolicy, parts

from robospa.harness.clock.policy_clock import PolicyClock, parse_latency, parse_switching
from robospa.harness.clock.real_time import ENTRY
from robospa.harness.replay import replay, replay_record
from robospa.harness.running.record_store import ActionRecorder, write_actions
from robospa.harness.trial import run_trial
from robospa.results.records.runs import action_path
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 2, 100004)
"""Its goal is ten actions of the walker away."""


def real(latency: str, switching: str = "wait", **more: Any) -> PolicyClock:
    """A clock with periods of 60 ms."""
    return PolicyClock(parse_latency(latency), parse_switching(switching), **more)


def play(
    policy: FakePolicy,
    clock: PolicyClock | None,
    key: TrialKey = KEY,
    seed: int = 7,
    **more: Any,
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
    paused = play(Walker(execute=execute), None)
    assert without_times(play(Walker(execute=execute), real("0", switching))) == without_times(
        paused
    )
    assert paused.success


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
    record = play(Walker(), real("120ms", "arrival"))
    found = record.diagnostics[ENTRY]
    assert (record.success, record.steps) == (True, 12)
    assert found["held_spans"] == [[0, 2]]
    assert found["asked"] == [0, 3, 5, 7, 9, 11]
    assert found["arrived"] == [2, 5, 7, 9, 11]
    assert found["blind"] == 9


def test_the_policy_sees_the_instant_at_which_it_is_asked() -> None:
    policy = Walker()
    play(policy, real("120ms", "arrival"))
    assert [seen["step"] for seen in policy.seen] == [0, 3, 5, 7, 9, 11]
    assert [seen["state"][0] for seen in policy.seen] == [0.0, 0.5, 1.5, 2.5, 3.5, 4.5]


def test_the_time_that_a_step_limit_takes_is_the_time_limit() -> None:
    record = play(Walker(), real("300ms"))
    assert (record.end, record.success, record.steps) == ("time_limit", False, LIMIT)
    assert record.physics_steps == 15 * LIMIT
    assert record.diagnostics[ENTRY]["held"] == 5 + 5 + 2


def test_a_longer_time_limit_leaves_the_limit_of_actions() -> None:
    assert play(Walker(), real("300ms", seconds=60.0)).success
    record = play(Walker(length=1), real("60ms", seconds=60.0), TrialKey("Pick_Fake", 2, 100009))
    assert record.success  # exactly as many actions as the limit has
    assert (record.steps, record.diagnostics[ENTRY]["held"]) == (2 * LIMIT, LIMIT)
    far = TrialKey("Pick_Fake", 2, 100009)
    slow = Walker()
    slow.infer = lambda seen: np.asarray(seen["state"], np.float32)[None]  # type: ignore[method-assign]
    record = play(slow, real("60ms", seconds=60.0), far)
    assert (record.end, record.steps) == ("step_limit", 2 * LIMIT)


def test_latencies_of_a_trial_do_not_depend_on_what_ran_before() -> None:
    clock = real("p0=0ms,p100=400ms", "arrival")
    other = TrialKey("Pick_Fake", 1, 100007)
    alone = play(Walker(), clock)
    play(Walker(), clock, other, seed=8)
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


def test_a_trial_longer_than_its_step_limit_is_played_again_whole(tmp_path: Path) -> None:
    key, recorder = TrialKey("Pick_Fake", 2, 100009), ActionRecorder()
    record = play(Walker(length=1), real("60ms", seconds=60.0), key, recorder=recorder)
    assert record.success and record.steps == 2 * LIMIT
    action_path(tmp_path, key).parent.mkdir()
    write_actions(tmp_path, key, recorder.actions, "joint")
    again = ActionRecorder()
    replay_record(TargetWorld(), record, tmp_path, again, parts=parts)
    assert np.array_equal(again.actions, recorder.actions)


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

    policy = Poses()
    policy.spec = replace(policy.spec, action=space, action_dim=16)
    world = TargetWorld()
    seen = world.observe
    world.observe = lambda spec: {**seen(spec), "ee": HOME_POSES}  # type: ignore[method-assign]
    record = run_trial(world, policy, KEY, policy_seed=7, parts=parts, clock=real("60ms"))
    assert record.end == "time_limit"
    assert record.diagnostics[ENTRY]["held"] == LIMIT // 4


HOME_POSES = np.array(
    [[-0.3, -0.1, 0.9, 1.0, 0.0, 0.0, 0.0, 1.0], [0.3, -0.1, 0.9, 1.0, 0.0, 0.0, 0.0, 1.0]],
    np.float32,
)
