"""Where records go: append-only JSONL, one writer per file, flushed to disk per trial.

A kill at any byte is harmless: a line counts only once its newline is on disk. A writer never
touches a file that it did not create, so a torn line stays the last of its file for ever. Action
traces and videos lie beside, named by the trial, and are written under another name first.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.results.reading import TRIALS, RunError, to_line
from robospa.results.records import TrialKey, TrialRecord

ACTIONS = "actions"
VIDEOS = "videos"


class RecordWriter:
    """The only writer of one new file in a run's `trials` folder."""

    def __init__(self, folder: Path) -> None:
        """Create the next free file of the run in `folder`."""
        (folder / TRIALS).mkdir(parents=True, exist_ok=True)
        number = 0
        while True:
            self.path = folder / TRIALS / f"{number:04d}.jsonl"
            try:
                flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
                self._file = os.open(self.path, flags, 0o644)
                return
            except FileExistsError:
                number += 1

    def write(self, record: TrialRecord) -> None:
        """Append `record`; when this returns it is on disk."""
        line = to_line(record).encode()
        written = os.write(self._file, line)
        if written != len(line):
            raise OSError(f"only {written} of {len(line)} bytes of a record fit into {self.path}")
        os.fsync(self._file)

    def close(self) -> None:
        """Close the file, and remove it if nothing was written."""
        os.close(self._file)
        if self.path.stat().st_size == 0:
            self.path.unlink()


def replace_file(path: Path, data: bytes) -> None:
    """Write `path` at once or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


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
        with np.load(path, allow_pickle=False) as data:
            return np.asarray(data["actions"], dtype=np.float32), str(data["space"])
    except (OSError, ValueError, KeyError) as error:
        raise RunError(f"{path} is no action trace: {error}") from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the run in `folder` for this process; raises RunError if another one holds it."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RunError(f"another process is running the run in {folder}") from error
        yield
