"""`robospa seeds` from the command line: what it prints."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import robospa

from robospa.harness.seeds.attempt import Attempt
from robospa.tasks.seeds import ListKey


def test_the_lists_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key = ListKey("Pick_Blocks_Size", 2)
    refused = Attempt(100_001, False, reason="does not settle: block_0 moves")
    found = SimpleNamespace(
        key=key,
        accepted=[100_000, 100_002],
        refused=[refused],
        given_up=False,
        row=lambda: [100_000, refused, 100_002],
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("robospa.harness.seeds.sweep.sweep_with_bar", lambda *_: [found])
    words = ("seeds", key.task, "--levels", "2", "--count", "2", "--check", "--json")
    done = robospa(*words)
    (row,) = json.loads(done.out)
    assert done.code == 0 and (row["task"], row["level"]) == (key.task, 2)
    assert row["accepted"] == [100_000, 100_002]
    assert row["refused"] == [{"seed": 100_001, "reason": refused.reason}]
    plain = robospa(*words[:-1]).out
    assert "2 of 3 seeds accepted" in plain and "seed 100001: does not settle" in plain
