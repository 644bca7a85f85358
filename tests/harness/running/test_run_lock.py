"""One driver per run."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robospa.harness.running.atomic_file import run_lock
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import LOCK


def test_a_second_driver_is_told_who_holds_the_run(tmp_path: Path) -> None:
    for _ in range(2):  # it is free again afterwards
        with (
            run_lock(tmp_path),
            pytest.raises(RunError, match=f"another process .process {os.getpid()} on .* is run"),
            run_lock(tmp_path),
        ):
            pass


def test_a_killed_driver_holds_nothing(tmp_path: Path) -> None:
    code = f"""
import os, pathlib
from robospa.harness.running.atomic_file import run_lock
with run_lock(pathlib.Path({str(tmp_path)!r})):
    os.kill(os.getpid(), 9)
"""
    assert subprocess.run([sys.executable, "-c", code]).returncode == -9
    assert b"process" in (tmp_path / LOCK).read_bytes()
    with run_lock(tmp_path):
        pass


def test_a_file_system_without_locks_is_no_reason_to_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with run_lock(tmp_path):
        pass


def test_nonsense_in_the_lock_file_is_not_repeated(tmp_path: Path) -> None:
    with run_lock(tmp_path):
        (tmp_path / LOCK).write_bytes(b"\xff\x1b[2J\x00")
        with pytest.raises(RunError, match=r"^another process is running"), run_lock(tmp_path):
            pass
