"""Where records go: append-only JSONL, one writer per file, on disk before a trial counts.

A kill at any byte is harmless: a line counts only once its newline is there, and a trial's actions
and video are on disk, folder entry included, before its record is written. A writer never touches a
file that it did not create, so a torn line stays the last of its file for ever. What could not be
written whole (a full disk) is taken back and raises StorageError: the run stops, nothing is lost.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import math
import os
import re
import time
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import TRIALS, to_line
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

ACTIONS = "actions"
VIDEOS = "videos"
MOST_TRACE = 2**28
"""Bytes of a trial's actions, at most."""
PART = ".*.part"
"""What a file is called while it is being written."""
ORPHAN_SECONDS = 10.0
"""How long the workers of a driver that was killed may take to end."""


class StorageError(RunError):
    """A folder cannot be written: it is full, read-only or gone; the message says which and why."""


@contextmanager
def storing(path: Path) -> Iterator[None]:
    """Turns what the file system says while `path` is written into a StorageError."""
    try:
        yield
    except OSError as error:
        raise StorageError(_cannot_write(path, error)) from error


def _cannot_write(path: Path, error: OSError) -> str:
    why = error.strerror or str(error)
    if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return f"cannot write {path}: {why}"
    return f"cannot write {path}: {why} ({_free(path.parent)} free in {path.parent}); make room"


def _free(folder: Path) -> str:
    try:
        found = os.statvfs(folder)
    except OSError:
        return "nothing known to be"
    size = float(found.f_bavail * found.f_frsize)
    for unit in ("bytes", "KB", "MB", "GB"):
        if size < 1000 or unit == "GB":
            break
        size /= 1000
    return f"{size:.3g} {unit}"


def sync_folder(folder: Path) -> None:
    """Put the entries of `folder` on disk: a new name survives a power failure only then."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EBADF):  # file systems that have no such thing
            raise
    finally:
        os.close(handle)


class RecordWriter:
    """The only writer of one new file in a run's `trials` folder; holds a lock on it."""

    def __init__(self, folder: Path) -> None:
        """Create the next free file of the run in `folder`; raises StorageError."""
        trials = folder / TRIALS
        number = 0
        with storing(trials / "0000.jsonl"):
            trials.mkdir(parents=True, exist_ok=True)
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

    def write(self, record: TrialRecord) -> None:
        """Append `record`; when this returns it is on disk. Raises StorageError: then it is not."""
        line = to_line(record).encode()
        before = os.fstat(self._file).st_size
        with storing(self.path):
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
        with contextlib.suppress(OSError):
            if os.fstat(self._file).st_size == 0:
                self.path.unlink(missing_ok=True)
        os.close(self._file)


def replace_file(path: Path, data: bytes) -> None:
    """Write `path` at once or not at all; on disk when this returns. Raises StorageError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with storing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
            sync_folder(path.parent)
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def tidy(folder: Path, patience: float = ORPHAN_SECONDS) -> None:
    """After a driver was killed: make sure that none of its workers still writes, put on disk what
    they wrote, and remove half-written files. Hold the run's lock.

    Raises StorageError, and RunError if after `patience` s a worker is still there.
    """
    for path in sorted((folder / TRIALS).glob("*.jsonl")):
        with storing(path):
            _settle(path, patience)
    drop_parts(folder)


def drop_parts(folder: Path) -> None:
    """Remove what workers that were killed while writing left half-written; none may be writing.

    Raises StorageError.
    """
    for place in (folder, folder / ACTIONS, folder / VIDEOS):
        for path in place.glob(PART):
            with storing(path):
                path.unlink(missing_ok=True)


def _settle(path: Path, patience: float) -> None:
    """Wait for the writer of a record file to be gone; drop the file if nothing is in it."""
    until = time.monotonic() + patience
    handle = os.open(path, os.O_RDWR)
    try:
        while _is_locked(handle):
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


def _is_locked(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    return False


def action_path(folder: Path, key: TrialKey) -> Path:
    """Where the action trace of `key` lies."""
    return folder / ACTIONS / f"{key.slug}.npz"


def write_actions(folder: Path, key: TrialKey, actions: NDArray[np.float32], space: str) -> None:
    """Keep the executed actions, float32 (steps, D), so that the trial can be replayed."""
    import io

    buffer = io.BytesIO()
    np.savez_compressed(buffer, actions=actions, space=np.array(space))
    replace_file(action_path(folder, key), buffer.getvalue())


def read_actions(path: Path) -> tuple[NDArray[np.float32], str]:
    """(actions (steps, D), action space) of a trace; raises RunError if it is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            actions = _member(archive, "actions.npy")
            space = _member(archive, "space.npy")
    except _BROKEN as error:
        raise RunError(f"{path} is no action trace: {error}") from error
    if actions.ndim != 2 or actions.dtype.kind != "f" or space.ndim or space.dtype.kind != "U":
        raise RunError(f"{path} is no action trace: it has other arrays")
    return np.asarray(actions, dtype=np.float32), str(space)


_BROKEN = (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


def _member(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """An array of an .npz file; its data is there before anything of its announced size is made."""
    with archive.open(name) as file:
        data = file.read(MOST_TRACE + 1)
    if len(data) > MOST_TRACE:
        raise ValueError(f"{name} has more than {MOST_TRACE} bytes")
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
