"""Records survive kills at any byte; corruption and contradictions are named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from fake_runs import KEY, RECORD, other

from robospa.harness.running.atomic_file import StorageError, replace_file
from robospa.harness.running.record_store import (
    RecordWriter,
    read_actions,
    read_joints,
    write_actions,
)
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import (
    RepeatabilityError,
    action_path,
    from_line,
    read_file,
    read_records,
    to_line,
)
from robospa.results.records.trial_record import RetryRow, TrialRecord


def write(folder: Path, *records: TrialRecord) -> Path:
    writer = RecordWriter(folder)
    for record in records:
        writer.write(record)
    writer.close()
    return writer.path


def test_every_prefix_of_a_file_reads_as_its_whole_lines(tmp_path: Path) -> None:
    path = write(tmp_path, RECORD, other(1))
    data = path.read_bytes()
    first = len(to_line(RECORD).encode())
    for size in range(len(data)):
        path.write_bytes(data[:size])
        assert len(read_file(path)) == (size >= first)


def test_a_corrupt_middle_line_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, RECORD, other(1), other(2))
    lines = path.read_bytes().split(b"\n")
    lines[1] = lines[1][:40]
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(RunError, match=r"0000\.jsonl, line 2"):
        read_file(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('"end":"success"|"end":"bored"', "must be one of success, "),
        ('"category":"GAC"|"categories":"GAC"', "unknown fields categories"),
        ('"seed":100000|"sead":100000', "unknown fields sead"),
    ],
)
def test_a_line_of_something_else_says_why(change: str, words: str) -> None:
    old, new = change.split("|")
    with pytest.raises(ValueError, match=words):
        from_line(to_line(RECORD).replace(old, new))


def test_writers_never_share_a_file(tmp_path: Path) -> None:
    first, second = RecordWriter(tmp_path), RecordWriter(tmp_path)
    assert first.path != second.path
    first.close()
    second.close()
    assert not first.path.exists()  # nothing was written


def test_an_identical_record_of_the_same_trial_is_fine(tmp_path: Path) -> None:
    write(tmp_path, RECORD)
    write(tmp_path, replace(RECORD, wall_time=9.0, attempts=2))
    assert list(read_records(tmp_path)) == [KEY]


def test_a_different_record_of_the_same_trial_raises_an_alarm(tmp_path: Path) -> None:
    write(tmp_path, RECORD)
    write(tmp_path, replace(RECORD, digest="e"))
    with pytest.raises(RepeatabilityError, match="disagree on digest"):
        read_records(tmp_path)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_result_outranks_a_loss(tmp_path: Path, order: tuple[int, int]) -> None:
    pair = (RECORD, replace(RECORD, end="infrastructure", success=False, digest=""))
    write(tmp_path, pair[order[0]])
    write(tmp_path, pair[order[1]])
    assert read_records(tmp_path)[KEY].end == "success"


WITHDRAWN = (
    replace(RECORD, end="policy_error", success=False, digest="x"),
    replace(RECORD, end="infrastructure", success=False, retries=(RetryRow("policy_error"),)),
    replace(RECORD, retries=(RetryRow("policy_error"),), attempts=2),
)


@pytest.mark.parametrize("order", [(0, 1), (1, 0), *permutations(range(3))])
def test_a_policy_error_that_was_withdrawn_is_no_result(
    tmp_path: Path, order: tuple[int, ...]
) -> None:
    for place in order:
        write(tmp_path, WITHDRAWN[place])
    assert read_records(tmp_path)[KEY] == WITHDRAWN[max(order)]


def test_the_loss_with_most_attempts_is_the_last(tmp_path: Path) -> None:
    lost = replace(RECORD, end="infrastructure", success=False)
    write(tmp_path, replace(lost, retries=(RetryRow("deadline"),) * 2))
    write(tmp_path, replace(lost, retries=(RetryRow("deadline"),)))
    assert len(read_records(tmp_path)[KEY].retries) == 2


def test_replace_file_leaves_nothing_behind_when_it_fails(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    with pytest.raises(StorageError, match=r"cannot write .*x: Is a directory"):
        replace_file(tmp_path / "x", b"data")
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def test_actions_survive_their_file(tmp_path: Path) -> None:
    actions = np.linspace(0, 1, 28, dtype=np.float32).reshape(2, 14)
    write_actions(tmp_path, KEY, actions, "joint")
    back, space = read_actions(action_path(tmp_path, KEY))
    assert space == "joint"
    np.testing.assert_array_equal(back, actions)


def test_the_joints_of_pose_actions_survive_their_file(tmp_path: Path) -> None:
    poses, joints = np.ones((2, 16), np.float32), np.ones((2, 14), np.float32)
    write_actions(tmp_path, KEY, poses, "ee", joints)
    np.testing.assert_array_equal(read_actions(action_path(tmp_path, KEY))[0], poses)
    np.testing.assert_array_equal(read_joints(action_path(tmp_path, KEY)), joints)
    write_actions(tmp_path, KEY, poses, "ee")  # as older versions did
    assert read_joints(action_path(tmp_path, KEY)) is None


@pytest.mark.parametrize("read", [read_actions, read_joints])
def test_a_broken_action_trace_is_named(tmp_path: Path, read: Callable[[Path], object]) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(b"PK nonsense")
    with pytest.raises(RunError, match="no action trace"):
        read(path)
