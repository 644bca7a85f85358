"""One trial: when the policy is asked, when it ends, and what the record says."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from run_fakes import LIMIT, SPEC, FakePolicy, FakeWorld, parts

from robospa.harness.trial import run_trial
from robospa.harness.world import ActionProblem, Poll, SceneUnstable, StepResult
from robospa.protocol.policy import PolicySpec
from robospa.results.records.action_problems import UNREACHABLE
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 2, 100004)


def play(policy: FakePolicy, key: TrialKey = KEY, world: FakeWorld | None = None) -> TrialRecord:
    return run_trial(world or FakeWorld(), policy, key, policy_seed=7, parts=parts)


class Answers(FakePolicy):
    """The same to every query."""

    def __init__(self, answer: object, spec: PolicySpec = SPEC) -> None:
        super().__init__(spec)
        self.answer = answer

    def infer(self, observation: object) -> object:  # type: ignore[override]
        return self.answer


def queries(record: TrialRecord) -> tuple[object, object]:
    return record.diagnostics["chunks"], record.diagnostics["last_query"]


def test_success_ends_the_trial_inside_a_chunk() -> None:
    record = play(FakePolicy(length=4))
    assert (record.end, record.success, record.steps) == ("success", True, 5)
    assert record.policy_calls == 2 and queries(record) == ({"1": 1, "4": 1}, 4)
    assert (record.done, record.best, record.total) == (2, 2, 2)
    assert record.physics_steps == 25


def test_the_actions_digest_covers_exactly_the_executed_actions() -> None:
    expected = hashlib.sha256(np.ones((5, 14), "<f4").tobytes()).hexdigest()
    assert play(FakePolicy()).actions_digest == expected


def test_the_step_limit_cuts_the_last_chunk() -> None:
    record = play(Answers(np.zeros((3, 14), np.float32)))
    assert (record.end, record.success, record.steps) == ("step_limit", False, LIMIT)
    assert record.policy_calls == 7 and queries(record) == ({"2": 1, "3": 6}, 18)


def test_execute_leaves_the_rest_of_the_chunk_unused() -> None:
    policy = FakePolicy(replace(SPEC, execute=1), length=4)
    assert play(policy).policy_calls == 5


def test_the_policy_learns_the_trial_at_reset() -> None:
    policy = FakePolicy()
    play(policy)
    assert policy.trial is not None
    assert (policy.trial.key, policy.trial.policy_seed) == (None, 7)
    assert policy.trial.instruction == "level 2: sum to 5"


def test_the_world_is_observed_only_when_a_chunk_is_needed() -> None:
    world = FakeWorld()
    play(FakePolicy(length=2), world=world)
    assert world.views == 3


def test_history_holds_the_views_at_the_offsets_and_renders_no_others() -> None:
    world = FakeWorld()
    policy = FakePolicy(replace(SPEC, history=(-1,)), length=4)
    play(policy, TrialKey("Pick_Fake", 1, 100009), world)
    states = [float(seen["history"][-1]["state"][0]) for seen in policy.seen]
    assert states == [0.0, 3.0, 7.0]
    assert world.views == 5  # three queries, and steps 3 and 7


def test_long_history_offsets_reach_back_over_chunks() -> None:
    policy = FakePolicy(replace(SPEC, history=(-1, -5)), length=2)
    play(policy, TrialKey("Pick_Fake", 1, 100009))
    states = [float(seen["history"][-5]["state"][0]) for seen in policy.seen]
    assert states == [0.0, 0.0, 0.0, 1.0, 3.0]


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (np.full((2, 14), np.inf), "inf in action 0"),
        (np.zeros((2, 13)), "13 numbers per action"),
        (np.zeros((0, 14)), "shape (0, 14)"),
        (np.zeros((5, 14)), "shape (5, 14)"),
        (np.zeros(14), "shape (14,)"),
        ("up", "answered str"),
        ({"actions": 1}, "answered a map of actions"),
    ],
)
def test_a_bad_answer_is_a_failure_with_the_reason(answer: object, words: str) -> None:
    record = play(Answers(answer))
    assert (record.end, record.success, record.steps) == ("policy_error", False, 0)
    assert words in record.message


def test_an_action_that_cannot_be_executed_is_a_failure_with_the_reason() -> None:
    record = play(Answers(np.zeros((1, 16), np.float32), replace(SPEC, action="ee")))
    assert record.end == "policy_error"
    assert "left quaternion (w, x, y, z) of the ee action has length 0" in record.message


def test_absurd_numbers_are_clipped_and_counted() -> None:
    chunk = np.ones((4, 14), np.float32)
    chunk[2] = 3.4e38
    record = play(Answers(chunk))
    assert (record.end, record.steps) == ("success", 3)  # 1, 1 and at most pi
    assert record.diagnostics["clipped_joints"] == record.diagnostics["clipped_grippers"] == 1
    assert record.diagnostics["first_clipped_joint"].startswith("action 3: left joint 1 ")
    assert record.diagnostics["first_clipped_gripper"] == (
        "action 3: left gripper is 32767, not from 0 (closed) to 1 (open)"
    )


def test_actions_that_were_not_executed_as_sent_are_counted() -> None:
    problem = ActionProblem(UNREACHABLE, "the arm holds")

    class Short(FakeWorld):
        def step(self, action: np.ndarray, space: str, poll: Poll) -> StepResult:
            return replace(super().step(action, space, poll), problems=(problem, problem))

    record = play(FakePolicy(), world=Short())
    assert record.diagnostics["unreachable_actions"] == record.steps == 5
    assert record.diagnostics["first_unreachable"] == "action 1: the arm holds"
    assert record.success


def test_an_unstable_scene_is_passed_on() -> None:
    with pytest.raises(SceneUnstable):
        play(FakePolicy(), replace(KEY, seed=666))


def test_the_same_trial_gives_the_same_record_after_any_other() -> None:
    world = FakeWorld()
    first = play(FakePolicy(), world=world)
    play(FakePolicy(), replace(KEY, seed=100001), world)
    again = play(FakePolicy(), world=world)
    assert (first.digest, first.actions_digest) == (again.digest, again.actions_digest)


def test_what_the_server_tells_of_its_times_is_kept_as_means() -> None:
    class Telling(FakePolicy):
        def infer(self, observation: object) -> np.ndarray:
            number = float(len(self.seen))
            self.last_timing = {"queue_ms": number, "infer_ms": 5.0, "batch": float("nan")}
            self.last_timing |= {"requests": number + 1, "cost": float("nan")}
            return super().infer(observation)

    record = play(Telling())  # three calls
    assert record.policy_calls == 3
    assert set(record.latency) == {"p50", "p95", "p99", "max", "queue", "infer"}
    assert (record.latency["queue"], record.latency["infer"]) == (1.0, 5.0)
    assert record.diagnostics["usage"] == {"requests": 3}


def test_a_policy_that_tells_no_times_has_its_percentiles_only() -> None:
    assert set(play(FakePolicy()).latency) == {"p50", "p95", "p99", "max"}
