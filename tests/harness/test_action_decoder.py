"""What is read from a policy's numbers, and what is refused."""

import hashlib
import os
import sys
from typing import Any

import numpy as np
import pytest
from command_line import printed
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from run_fakes import FakePolicy, FakeWorld, parts
from world_scenes import READY, joint_action, unequal_arms

from robospa.action_space import STEPS_PER_UNIT, is_quantized, quantize
from robospa.harness import action_decoder
from robospa.harness.action_decoder import ActionDecoder
from robospa.harness.robots import embodiment
from robospa.harness.robots.kinematics import end_effector
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.trial import actions_digest, run_trial
from robospa.harness.world import ActionError, Poll, StepResult
from robospa.results.records.action_problems import CLIPPED_GRIPPERS, CLIPPED_JOINTS, UNREACHABLE
from robospa.trial import TrialKey

ROBOT = embodiment("aloha-agilex")
DECODER = ActionDecoder(ROBOT)
START = np.array([READY, READY])


def ee_action() -> np.ndarray:
    rows = []
    for chain in DECODER.chains:
        pose = end_effector(chain, READY)
        rows += [*pose.position, *pose.rotation, 0.5]
    return np.array(rows)


def changed(place: Any, value: object, action: np.ndarray) -> np.ndarray:
    """`action` with other numbers at `place`."""
    action[place] = value
    return action


def test_joint_goals_are_the_numbers_sent() -> None:
    targets = DECODER.decode(joint_action(grip=(0.25, 1.0)), "joint", START)
    assert targets.joints == pytest.approx(START)
    assert targets.gripper == pytest.approx([0.25, 1.0])


@pytest.mark.parametrize("angle", [10.2, 99.0, 3.4e38])
def test_joints_beyond_their_limits_are_clipped_and_reported(angle: float) -> None:
    targets = DECODER.decode(joint_action(left=(angle, *READY[1:])), "joint", START)
    assert targets.joints[0, 0] == ROBOT.arms[0].joints[0].upper
    assert [problem.kind for problem in targets.problems] == [CLIPPED_JOINTS]
    assert targets.problems[0].text == (
        f"left joint 1 is asked to go to {np.float32(angle):g} rad and goes to its limit 10.00"
    )


def test_a_gripper_outside_its_range_is_clipped_and_reported() -> None:
    targets = DECODER.decode(joint_action(grip=(-0.5, 1.5)), "joint", START)
    assert targets.gripper.tolist() == [0.0, 1.0]
    assert [problem.kind for problem in targets.problems] == [CLIPPED_GRIPPERS] * 2
    assert targets.problems[1].text == "right gripper is 1.5, not from 0 (closed) to 1 (open)"
    # Of a pose too: millimetres, or a percentage.
    (problem,) = DECODER.decode(changed(7, 88.0, ee_action()), "ee", START).problems
    assert problem.text == "left gripper is 88, not from 0 (closed) to 1 (open)"


def test_a_small_overshoot_is_no_problem() -> None:
    action = joint_action(left=(0.0, -10.04, *READY[2:]), grip=(-0.04, 1.04))
    targets = DECODER.decode(action, "joint", START)
    assert targets.joints[0, 1] == ROBOT.arms[0].joints[1].lower
    assert targets.gripper.tolist() == [0.0, 1.0] and targets.problems == ()


@pytest.mark.parametrize(
    ("action", "space", "said"),
    [
        (
            changed(9, np.nan, joint_action()),
            "joint",
            r"right joint 3 \(index 9 of the .*\) is nan",
        ),
        *((np.zeros(s), "joint", r"shape \(14,\), got") for s in ((13,), (16,), (1, 14), ())),
        (joint_action(), "torque", "no action space 'torque'"),
        ([[1.0], "x"], "joint", "not an array of numbers"),
        (changed(slice(3, 7), 0.0, ee_action()), "ee", "left quaternion"),
    ],
)
def test_what_is_no_action_is_refused(action: Any, space: str, said: str) -> None:
    with pytest.raises(ActionError, match=said):
        DECODER.decode(action, space, START)


def test_the_pose_of_the_present_posture_is_no_motion() -> None:
    targets = DECODER.decode(ee_action(), "ee", START)
    assert targets.joints == pytest.approx(START, abs=1e-3)
    assert targets.problems == ()


def test_a_pose_nearby_is_reached() -> None:
    action = ee_action()
    action[2] -= 0.05
    targets = DECODER.decode(action, "ee", START)
    found = end_effector(DECODER.chains[0], targets.joints[0])
    assert found.position == pytest.approx(action[:3], abs=2e-3)
    assert targets.joints[1] == pytest.approx(START[1], abs=1e-3)


def test_an_arm_that_cannot_reach_holds_and_says_so() -> None:
    targets = DECODER.decode(changed(slice(3), 5.0, ee_action()), "ee", START)
    assert np.array_equal(targets.joints[0], START[0])
    assert [problem.kind for problem in targets.problems] == [UNREACHABLE]
    assert "left arm cannot reach position (5.000, 5.000, 5.000)" in targets.problems[0].text


@pytest.mark.parametrize(("step", "near"), [(0.02, 2e-3), (1e-4, 1e-5), (0.0, 1e-12)])
def test_delta_moves_in_the_grippers_own_frame(step: float, near: float) -> None:
    row = [step, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    joints = DECODER.decode(np.array(row * 2), "delta_ee", START).joints
    before = end_effector(DECODER.chains[0], READY)
    after = end_effector(DECODER.chains[0], joints[0])
    assert after.position == pytest.approx(before.apply((step, 0.0, 0.0)), abs=near)
    assert step or joints == pytest.approx(START, abs=1e-12)


def test_arms_may_have_different_joint_counts() -> None:
    decoder = ActionDecoder(unequal_arms())
    action = np.array([*READY, 0.25, *READY, 0.1, 0.75])
    targets = decoder.decode(action, "joint", np.zeros((2, 7)))
    assert targets.joints.tolist() == [[*READY, 0.0], [*READY, 0.1]]
    assert targets.gripper.tolist() == [0.25, 0.75]
    with pytest.raises(ActionError, match=r"shape \(15,\), got \(14,\)"):
        decoder.decode(action[:14], "joint", np.zeros((2, 7)))


def test_the_joint_that_an_arm_lacks_is_not_reported() -> None:
    robot = unequal_arms()
    action = np.zeros(robot.action_space("joint").width)
    action[0] = 1.0
    assert ActionDecoder(robot).decode(action, "joint", np.zeros((2, 7))).problems == ()


def test_poses_move_arms_of_different_joint_counts() -> None:
    decoder = ActionDecoder(unequal_arms())
    start = np.array([[*READY, 0.0], [*READY, 0.1]])
    rows = []
    for chain, joints in zip(decoder.chains, (READY, (*READY, 0.1)), strict=True):
        pose = end_effector(chain, joints)
        x, y, z = pose.position
        rows += [x, y, z + 0.01, *pose.rotation, 0.5]
    targets = decoder.decode(np.array(rows), "ee", start)
    assert targets.problems == ()
    assert targets.joints[0, 6] == 0.0
    moved = end_effector(decoder.chains[1], targets.joints[1].tolist())
    assert moved.position == pytest.approx(rows[8:11], abs=1e-4)


def walked(decoder: ActionDecoder) -> str:
    """Hash of the targets of 80 steps of both kinds of pose, each from the targets before."""
    generator = np.random.default_rng(3)
    found, now = hashlib.sha256(), np.array([READY, READY])
    for space in ("delta_ee", "ee"):
        poses = [end_effector(chain, READY) for chain in decoder.chains]
        for _ in range(40):
            action = generator.integers(-300, 300, (2, 8)) / 2**16
            if space == "ee":
                action[:, :7] += [(*pose.position, *pose.rotation) for pose in poses]
            else:
                action[:, 3] += 1.0
            targets = decoder.decode(action.reshape(16).astype(np.float32), space, now)
            now = targets.joints
            found.update(now.astype("<f8").tobytes())
    return found.hexdigest()[:16]


WITHOUT_AVX = {
    "OPENBLAS_CORETYPE": "Prescott",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL,-AVX512DQ",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL",
}
"""OpenBLAS, C library and numpy as on an older processor."""
TARGETS = "c5874194efeeec69"
"""Of `walked`: one value, whatever the processor."""


def test_pose_actions_give_the_same_targets_on_every_processor() -> None:
    assert walked(DECODER) == TARGETS
    other = "import test_action_decoder as t; print(t.walked(t.DECODER))"
    assert printed(other, **WITHOUT_AVX, PYTHONPATH=os.pathsep.join(sys.path)) == f"{TARGETS}\n"


def test_noise_in_inverse_kinematics_does_not_reach_the_targets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Processors differ by 1e-14 rad; a million times that changes nothing either."""
    generator, exact = np.random.default_rng(0), action_decoder.inverse

    def noisy(*args: Any, **named: Any) -> Any:
        found, reached = exact(*args, **named)
        return found + generator.normal(0.0, 1e-8, found.shape), reached

    monkeypatch.setattr(action_decoder, "inverse", noisy)
    assert walked(DECODER) == TARGETS


def test_targets_of_poses_are_whole_steps_so_that_they_are_joint_actions_too() -> None:
    action = ee_action()
    action[[2, 10]] -= 0.05
    targets = DECODER.decode(action, "ee", START)
    assert is_quantized(targets.joints.astype(np.float32))
    again = np.hstack([targets.joints, targets.gripper[:, None]]).astype(np.float32).reshape(14)
    assert np.array_equal(DECODER.decode(again, "joint", START).joints, targets.joints)


# ------- the grid of executed actions: exact, idempotent, and what is recorded is what was executed


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


def test_single_numbers() -> None:
    given = np.array([0.1, 1.0, -0.25, 1e30, -1e30, -0.0, -1e-9], np.float32)
    rounded = quantize(given)
    assert rounded.tolist() == [6554 / 65536, 1.0, -0.25, 32767.0, -32767.0, 0.0, 0.0]
    assert not np.signbit(rounded[-2:]).any()
    odd = (0.1, -0.0, np.nan, np.inf, 1e30)
    assert not any(is_quantized(np.array([number], np.float32)) for number in odd)


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
