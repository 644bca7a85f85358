"""Where records go: append-only JSONL, one writer per file, on disk before a trial counts.

A kill at any byte is harmless: a line counts only once its newline is there, and a trial's actions
are on disk, folder entry included, before its record is written. A writer never touches a
file that it did not create, so a torn line stays the last of its file for ever. What could not be
written whole (a full disk) is taken back and raises StorageError: the run stops, nothing is lost.
"""

import contextlib
import errno
import fcntl
import io
import math
import os
import re
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robospa.harness.running.atomic_file import (
    PARTIAL,
    OpenFile,
    StorageError,
    replace_file,
    storage_errors,
    sync_folder,
)
from robospa.harness.world import StepResult, World
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import ACTIONS, TRIALS, VIDEOS, action_path, is_locked, to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

ORPHAN_SECONDS = 10.0
"""How long the workers of a driver that was killed may take to end."""


class RecordWriter:
    """The only writer of one new file in a run's `trials` folder; holds a lock on it."""

    def __init__(self, folder: Path) -> None:
        """Create the next free file of the run in `folder`, which exists; raises StorageError."""
        trials = folder / TRIALS
        number = 0
        with storage_errors(trials / "0000.jsonl"):
            trials.mkdir(exist_ok=True)
            while True:
                self.path = trials / f"{number:04d}.jsonl"
                try:
                    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
                    self._file = os.open(self.path, flags, 0o644)
                    break
                except FileExistsError:
                    number += 1
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            sync_folder(trials)
            sync_folder(folder)
        self._folder, self._open = folder, OpenFile(self.path, self._file)

    def check(self) -> None:
        """Raises StorageError if the run's folder is not the one that this file was made in."""
        self._open.check(self._folder)

    def write(self, record: TrialRecord) -> None:
        """Append `record`; when this returns it is on disk. Raises StorageError: then it is not."""
        self.check()
        line = to_line(record).encode()
        before = os.fstat(self._file).st_size
        with storage_errors(self.path):
            try:
                written = os.write(self._file, line)
                if written != len(line):
                    raise OSError(errno.ENOSPC, "No space left for a whole record")
                os.fsync(self._file)
            except OSError:
                # Half a line in the middle of a file would spoil all that follow it.
                os.ftruncate(self._file, before)
                raise

    def close(self) -> None:
        """Close the file, and remove it if nothing was written."""
        with contextlib.suppress(OSError, StorageError):
            if os.fstat(self._file).st_size == 0:
                self.check()
                self.path.unlink(missing_ok=True)
        os.close(self._file)


def recover_folder(folder: Path, patience: float = ORPHAN_SECONDS) -> None:
    """After a driver was killed: make sure that none of its workers still writes, put on disk what
    they wrote, and remove half-written files. Hold the run's lock.

    Raises StorageError, and RunError if after `patience` s a worker is still there.
    """
    for path in sorted((folder / TRIALS).glob("*.jsonl")):
        with storage_errors(path):
            _finish_file(path, patience)
    remove_partial_files(folder)


def remove_partial_files(folder: Path) -> None:
    """Remove what workers that were killed while writing left half-written; none may be writing.

    Raises StorageError.
    """
    for place in (folder, folder / ACTIONS, folder / VIDEOS):
        for path in place.glob(PARTIAL):
            with storage_errors(path):
                path.unlink(missing_ok=True)


def _finish_file(path: Path, patience: float) -> None:
    """Wait for the writer of a record file to be gone; drop the file if nothing is in it."""
    until = time.monotonic() + patience
    handle = os.open(path, os.O_RDWR)
    try:
        while is_locked(handle):
            if time.monotonic() > until:
                raise RunError(
                    f"a worker of an earlier driver still writes to {path}; end it first "
                    f"(`fuser {path}` names it)"
                )
            time.sleep(0.05)
        if os.fstat(handle).st_size:
            os.fsync(handle)
        else:
            path.unlink(missing_ok=True)
    finally:
        os.close(handle)


MAX_BYTES = 2**28
"""Of a trial's actions."""


class ActionRecorder:
    """A `Recorder` of actions; `on_step` is told that time goes on."""

    def __init__(self, on_step: Callable[[], None] = lambda: None) -> None:
        self._actions: list[NDArray[np.float32]] = []
        self._joints: list[NDArray[np.float32]] = []
        self._on_step = on_step

    @property
    def actions(self) -> NDArray[np.float32]:
        """All executed actions, float32 (steps, D); (0, 0) if there was none."""
        return np.stack(self._actions) if self._actions else np.zeros((0, 0), np.float32)

    @property
    def joints(self) -> NDArray[np.float32] | None:
        """The joint actions (steps, D) executed in place of pose actions, if there are any."""
        return np.stack(self._joints) if self._joints else None

    def started(self, world: World) -> None:
        self._on_step()

    def polled(self, world: World, time: float) -> None:
        self._on_step()

    def executed(self, world: World, action: NDArray[np.float32], done: StepResult) -> None:
        """Keep `action`, and the joint action that was executed in its place."""
        self._on_step()
        self._actions.append(action)
        if done.joints is not None:
            self._joints.append(done.joints)

    def ended(self, world: World) -> None:
        """Nothing follows."""


def write_actions(
    folder: Path,
    key: TrialKey,
    actions: NDArray[np.float32],
    space: str,
    joints: NDArray[np.float32] | None = None,
) -> None:
    """Keep the executed actions, float32 (steps, D), so that the trial can be replayed; of pose
    actions also the joint actions (steps, D') that were executed in their place."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {"actions": actions, "space": np.array(space)}
    np.savez_compressed(buffer, **(arrays if joints is None else {**arrays, "joints": joints}))
    replace_file(action_path(folder, key), buffer.getvalue(), parents=False)


class ActionTrace(NamedTuple):
    """What a trial executed; `joints` (steps, D') in place of pose actions, None if there are none,
    as of joint policies and in traces of older versions."""

    actions: NDArray[np.float32]
    """(steps, D)"""
    space: str
    joints: NDArray[np.float32] | None


def read_trace(path: Path) -> ActionTrace:
    """What `write_actions` kept; raises RunError if it is no trace."""
    try:
        with zipfile.ZipFile(path) as archive:
            space, actions = _member(archive, "space.npy"), _member(archive, "actions.npy")
            extra = "joints.npy" in archive.namelist()
            joints = _member(archive, "joints.npy") if extra else None
    except _BROKEN as error:
        raise RunError(f"{path} is no action trace: {error}") from error
    numbers = [actions] if joints is None else [actions, joints]
    plain = all(array.ndim == 2 and array.dtype.kind == "f" for array in numbers)
    if not plain or space.ndim or space.dtype.kind != "U":
        raise RunError(f"{path} is no action trace: it has other arrays")
    return ActionTrace(
        np.asarray(actions, np.float32),
        str(space),
        None if joints is None else np.asarray(joints, np.float32),
    )


_BROKEN = (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


def _member(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """An array of an .npz file; its data is there before anything of its announced size is made."""
    with archive.open(name) as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"{name} has more than {MAX_BYTES} bytes")
    found = re.fullmatch(_HEADER, data[10:128].rstrip(b" \n\x00").split(b"\n")[0].rstrip())
    if not data.startswith(b"\x93NUMPY\x01\x00") or found is None:
        raise ValueError(f"{name} is no plain array")
    dtype = np.dtype(found[1].decode())
    shape = tuple(int(n) for n in found[2].decode().split(",") if n.strip())
    start = 10 + int.from_bytes(data[8:10], "little")
    if math.prod(shape) * dtype.itemsize != len(data) - start:
        raise ValueError(f"{name} announces another size than it has")
    return np.frombuffer(data, dtype, offset=start).reshape(shape)


_HEADER = (
    rb"\{'descr': '(<[fU][0-9]{1,4})', 'fortran_order': False, 'shape': \(([0-9, ]{0,40})\), \}"
)
