"""One driver per run: a lock on the file `.lock` of its folder, and who holds it.

The lock goes away with its process, however that ends. File systems that several machines share do
not always carry locks from one to the other, so the holder also writes its name and a number into
the file and counts the number up. Who gets the lock and finds the name of another machine that did
not sign off looks whether the number moves. No clock is compared, so none has to be right.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robospa.harness.running.store import storing
from robospa.results.records.manifest import RunError

LOCK = ".lock"
BEAT = 5.0
"""Seconds from one number to the next."""
WATCH = 20.0
"""Seconds for which the number of another machine has to stand still."""
WIDTH = 160
"""Bytes of the file: written in place, so that counting works on a full disk, too."""


@contextmanager
def locked(folder: Path, *, beat: float = BEAT, watch: float = WATCH) -> Iterator[None]:
    """Hold the run in `folder` for this process; raises RunError if another one holds it."""
    path = folder / LOCK
    with storing(path):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        _take(handle, folder)
        _look_elsewhere(path, folder, watch)
        with storing(path):
            _write(handle, 0)
        done = threading.Event()
        thread = threading.Thread(target=_count, args=(handle, done, beat), daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()
            with contextlib.suppress(OSError):
                os.pwrite(handle, b" " * WIDTH, 0)
    finally:
        os.close(handle)


def _take(handle: int, folder: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = _read(handle)
        raise RunError(
            f"another process{f' ({holder[0]})' if holder else ''} is running the run in {folder}"
        ) from error
    except OSError:
        return  # a file system without locks: the number has to do


def _look_elsewhere(path: Path, folder: Path, watch: float) -> None:
    """Raises RunError if a driver on another machine is counting in the lock file."""
    before = _peek(path)
    if before is None or before[2] == _kernel():
        return  # nobody, or a process of this machine: here the lock speaks for itself
    until = time.monotonic() + watch
    while time.monotonic() < until:
        time.sleep(min(1.0, watch / 10))
        now = _peek(path)
        if now is not None and now != before:
            raise RunError(f"another process ({now[0]}) is running the run in {folder}")


def _peek(path: Path) -> tuple[str, int, str] | None:
    """What the file says now: opened anew, because shared file systems look again only then."""
    with storing(path), path.open("rb") as file:
        return _parse(file.read(WIDTH))


def _read(handle: int) -> tuple[str, int, str] | None:
    return _parse(os.pread(handle, WIDTH, 0))


def _parse(data: bytes) -> tuple[str, int, str] | None:
    """(holder, number, its kernel); None if nobody has signed."""
    holder, _, rest = data.decode(errors="replace").strip().rpartition(" #")
    number, _, kernel = rest.partition(" ")
    known = holder and number.isascii() and number.isdigit() and len(number) < 19
    return (holder, int(number), kernel) if known else None


def _kernel() -> str:
    """What tells this running kernel from all others; processes under one share its locks."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return socket.gethostname()


def _write(handle: int, number: int) -> None:
    text = f"process {os.getpid()} on {socket.gethostname()[:64]} #{number} {_kernel()}"
    os.pwrite(handle, text.encode()[:WIDTH].ljust(WIDTH), 0)


def _count(handle: int, done: threading.Event, beat: float) -> None:
    number = 0
    while not done.wait(beat):
        number += 1
        with contextlib.suppress(OSError):
            _write(handle, number)
