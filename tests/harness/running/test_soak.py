"""A short form of `tests/helpers/soak.py`."""

from __future__ import annotations

import json
import subprocess
import sys

import soak

KINDS = "driver killed,workers killed while writing,server killed,file too large,second driver"


def test_a_run_interrupted_at_random_equals_one_in_peace() -> None:
    words = [sys.executable, soak.__file__, "--interruptions", "5", "--trials", "24"]
    words += ["--seed", "4", "--kinds", KINDS]
    done = subprocess.run(words, capture_output=True, text=True, timeout=290)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["interruptions"] == 5 and found["findings"] == []
