"""Pose policies: the joint actions that were executed are kept beside the poses, and replayed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundle_fakes import PICK, SEEDS, make_run
from fake_runs import trial_record

from robospa.harness.running.record_store import write_actions
from robospa.leaderboard.audit import _read as read_for_audit
from robospa.leaderboard.audit import expert_likeness
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.rules import Reference, shipped
from robospa.leaderboard.traces import (
    Trace,
    decode,
    durations,
    encode,
    joint_path,
    split_trace,
    with_joints,
)
from robospa.leaderboard.trial_rows import check_trace, trace_hash
from robospa.trial import REFERENCE, TrialKey

POSES = np.tile(np.array([0.25, 0, 1, 0.5, 0.5, 0.5, 0.5, 1] * 2, np.float32), (3, 1))
JOINTS = np.zeros((3, 14), np.float32)
JOINTS[:, [6, 13]] = 1.0
JOINTS[1:, 0] = 0.25


def both(trace: Trace, space: str = "ee") -> tuple[Trace, Trace | None]:
    return split_trace(trace, REFERENCE, space)


def test_a_trace_comes_apart_as_it_was_put_together() -> None:
    (stored,) = decode(encode([with_joints(POSES, JOINTS)]), "a file")
    actions, joints = both(stored)
    assert joints is not None
    assert np.array_equal(actions, POSES) and np.array_equal(joints, JOINTS)


@pytest.mark.parametrize("trace", [POSES, POSES[:0], np.zeros((2, 29), np.float32)])
def test_a_trace_without_joints_stays_whole(trace: Trace) -> None:
    actions, joints = both(with_joints(trace, None))
    assert joints is None and actions is trace


def test_joint_policies_have_no_second_part() -> None:
    wide = np.zeros((2, 28), np.float32)
    assert both(wide, "joint")[1] is None


def test_an_audit_compares_what_pose_policies_executed(tmp_path: Path) -> None:
    keys = [TrialKey(PICK, 1, seed) for seed in SEEDS[:3]]
    folder = make_run(tmp_path / "run", keys)
    write_actions(folder, keys[0], POSES, "ee", JOINTS)
    write_actions(folder, keys[1], POSES, "ee")  # of an older version
    write_actions(folder, keys[2], JOINTS, "joint")
    run, paths = read_for_audit(folder, 10)
    assert run.keys == tuple(keys) and list(paths) == [keys[0], keys[2]]
    assert np.array_equal(paths[keys[0]], JOINTS) and np.array_equal(paths[keys[2]], JOINTS)
    assert expert_likeness(paths, lambda key: JOINTS).suspicious


def test_a_bundle_has_the_same_paths() -> None:
    stored = with_joints(POSES, JOINTS)
    assert np.array_equal(joint_path(stored, REFERENCE, "ee"), JOINTS)
    assert joint_path(POSES, REFERENCE, "ee") is None
    assert joint_path(JOINTS, REFERENCE, "joint") is JOINTS


def reference() -> Reference:
    return replace(shipped(), durations=durations)


def checked(trace: Trace, physics_steps: int) -> None:
    """Check a trial that sent POSES and stored `trace`."""
    record = trial_record(
        TrialKey("Pick_Blocks_Size", 1, 100_000),
        steps=3,
        physics_steps=physics_steps,
        actions_digest=trace_hash(POSES),
    )
    check_trace(record, trace, trace_hash(trace), reference(), "ee")


def test_the_joints_decide_how_long_a_pose_action_takes() -> None:
    steps = int(durations(REFERENCE, "joint", JOINTS)[0].sum())
    checked(with_joints(POSES, JOINTS), steps)
    with pytest.raises(BundleError, match=f"its actions take {steps}"):
        checked(with_joints(POSES, JOINTS), steps + 1)
    checked(POSES, steps + 1)  # of an older version: only bounds are known


def test_the_poses_are_those_of_the_record() -> None:
    with pytest.raises(BundleError, match="not those of its record"):
        checked(with_joints(POSES + np.float32(0.5), JOINTS), 100)
