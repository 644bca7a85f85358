"""What all tests share: processes that they start find the modules of `tests/helpers` too."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from xdist.scheduler import LoadFileScheduling

from robospa.tasks import catalog

TASKS = re.compile("|".join(sorted(catalog.tasks(), key=len, reverse=True)), re.IGNORECASE)

HELPERS = Path(__file__).resolve().parent / "helpers"


def pytest_configure() -> None:
    inherited = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(HELPERS), inherited)))


class ByTask(LoadFileScheduling):  # type: ignore[misc]
    """Spreads tests by the task that they look at, others by file.

    A task's first scene of a level costs up to a second (a pool of layouts), those after it 1 ms.
    """

    def _split_scope(self, nodeid: str) -> str:
        path, _, given = nodeid.rstrip("]").partition("[")
        named = TASKS.search(given)
        return named.group().lower() if named else super()._split_scope(path)


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> ByTask | None:
    return ByTask(config, log) if config.getoption("dist") == "loadfile" else None
