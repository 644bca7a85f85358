"""One driver per run, on one machine and on several that share its folder."""

from __future__ import annotations

import errno
import fcntl
import os
import threading
from pathlib import Path

import pytest

from robospa.harness.running.locking import LOCK, WIDTH, locked
from robospa.results.records.manifest import RunError

ELSEWHERE = b"process 12 on node7 #%d 0000-another-kernel"


def sign(folder: Path, number: int) -> None:
    (folder / LOCK).write_bytes((ELSEWHERE % number).ljust(WIDTH))


def test_a_second_driver_is_told_who_holds_the_run(tmp_path: Path) -> None:
    with (
        locked(tmp_path),
        pytest.raises(RunError, match=f"another process .process {os.getpid()} on .* is running"),
        locked(tmp_path),
    ):
        pass


def test_the_lock_is_free_again_and_says_so(tmp_path: Path) -> None:
    with locked(tmp_path):
        assert b" #" in (tmp_path / LOCK).read_bytes()
    assert (tmp_path / LOCK).read_bytes().strip() == b""
    with locked(tmp_path):
        pass


def test_a_driver_of_another_machine_that_counts_is_not_disturbed(tmp_path: Path) -> None:
    sign(tmp_path, 1)
    done = threading.Event()

    def count() -> None:
        number = 1
        while not done.wait(0.02):
            number += 1
            sign(tmp_path, number)

    other = threading.Thread(target=count)
    other.start()
    try:
        with pytest.raises(RunError, match="process 12 on node7"), locked(tmp_path, watch=5.0):
            pass
    finally:
        done.set()
        other.join()


def test_a_driver_of_another_machine_that_was_killed_holds_nothing(tmp_path: Path) -> None:
    sign(tmp_path, 5)
    with locked(tmp_path, watch=0.05):
        assert str(os.getpid()).encode() in (tmp_path / LOCK).read_bytes()


def test_a_killed_driver_of_this_machine_is_not_waited_for(tmp_path: Path) -> None:
    with locked(tmp_path):
        left = (tmp_path / LOCK).read_bytes()
    (tmp_path / LOCK).write_bytes(left)
    with locked(tmp_path, watch=3600.0):
        pass


def test_a_file_system_without_locks_is_no_reason_to_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with locked(tmp_path):
        pass


def test_nonsense_in_the_lock_file_is_nobody(tmp_path: Path) -> None:
    for data in (b"", b"\xff\xfe #x", b"x #" + b"9" * 100, b" #1 k"):
        (tmp_path / LOCK).write_bytes(data)
        with locked(tmp_path, watch=3600.0):
            pass
