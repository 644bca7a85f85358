"""Whether a run is in progress: the lock that its driver holds is the only sign of it."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

LOCK = ".lock"
"""File of a run's folder that its driver holds a lock on."""


def in_progress(folder: Path) -> bool:
    """Whether a process is running the run in `folder`; False where locks do not tell.

    A driver that starts at the very instant of the look tries again (`running.run_lock`).
    """
    try:
        file = os.open(folder / LOCK, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    finally:
        os.close(file)
    return False
