"""What all tests share: processes that they start find the modules of `tests/helpers` too."""

from __future__ import annotations

import os
from pathlib import Path

HELPERS = Path(__file__).resolve().parent / "helpers"


def pytest_configure() -> None:
    inherited = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(HELPERS), inherited)))
