"""Writing files so that a kill at any byte and a full disk are harmless."""

import contextlib
import errno
import faulthandler
import fcntl
import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robospa.results.records.manifest import RunError
from robospa.results.records.runs import LOCK
from robospa.text import size_text

PARTIAL = ".*.part"
"""What a file is called while it is being written."""


class StorageError(RunError):
    """A folder cannot be written: it is full, read-only or gone; the message says which and why."""


class OpenFile:
    """A file that is held open, and whether it still is what its path names."""

    def __init__(self, path: Path, handle: int) -> None:
        self.path, self.handle = path, handle
        self._comparable = self._in_place()  # not so on some file systems over a network

    def _in_place(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self.handle), os.stat(self.path))
        except OSError:
            return False

    def check(self, folder: Path) -> None:
        """Raises StorageError if the run's `folder`, in which it lies, was moved or deleted."""
        if self._comparable and not self._in_place():
            raise StorageError(
                f"the run's folder {folder} was moved, deleted or replaced while the run went on; "
                "put it back, or go on where it is now"
            )


@contextmanager
def storage_errors(path: Path) -> Iterator[None]:
    """Turns what the file system says while `path` is written into a StorageError."""
    try:
        yield
    except OSError as error:
        text = f"cannot write {path}: {error.strerror or error}"
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            text += f" ({_free(path.parent)} free in {path.parent}); make room"
        raise StorageError(text) from error


def _free(folder: Path) -> str:
    try:
        found = os.statvfs(folder)
    except OSError:
        return "nothing known to be"
    return size_text(found.f_bavail * found.f_frsize)


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


def replace_file(path: Path, data: bytes, parents: bool = True) -> None:
    """Write `path` at once or not at all; on disk when this returns. Raises StorageError.

    Its folder is made if need be, and those above only if `parents`.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with storage_errors(path):
        path.parent.mkdir(parents=parents, exist_ok=True)
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


LOGS = "logs"
"""Folder inside a run that holds what its processes printed."""


def log_to(path: Path) -> None:
    """Send whatever libraries print, and the stack of a crash, to a file instead of the screen."""
    with storage_errors(path):
        path.parent.mkdir(exist_ok=True)
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(file, sys.stdout.fileno())
    os.dup2(file, sys.stderr.fileno())
    faulthandler.enable()


NAME_BYTES = 160
TRIES, PAUSE = 5, 0.02
"""A reader that looks whether the run is in progress holds the lock for less than this [s]."""


@contextmanager
def run_lock(folder: Path) -> Iterator[OpenFile]:
    """Hold the run in `folder` for this process; raises RunError if another one holds it.

    What it gives tells whether the folder is still the one that was locked.
    """
    path = folder / LOCK
    with storage_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            _lock(file)
        except BlockingIOError as error:
            holder = os.pread(file, NAME_BYTES, 0).decode(errors="replace").strip()
            name = f" ({holder})" if holder.isprintable() and holder else ""
            raise RunError(f"another process{name} is running the run in {folder}") from error
        except OSError:
            pass  # a file system without locks
        name = f"process {os.getpid()} on {socket.gethostname()}"
        with storage_errors(path):
            os.pwrite(file, name.encode()[:NAME_BYTES].ljust(NAME_BYTES), 0)
        yield OpenFile(path, file)
    finally:
        os.close(file)


def _lock(file: int) -> None:
    for left in reversed(range(TRIES)):
        try:
            return fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not left:
                raise
            time.sleep(PAUSE)
