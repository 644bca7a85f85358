"""`robospa official checkout` from the command line: what it prints."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import robospa

from robospa.harness.official.checkout_world import CheckoutFinding


def test_findings_and_seeds_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    findings = [
        CheckoutFinding("scene", None, "seed 100004"),
        CheckoutFinding("torch", False, "2.13, not 2.4"),
    ]
    closed = SimpleNamespace(close=lambda: None)
    official = "robospa.harness.official"
    monkeypatch.setattr(f"{official}.checkout_world.CheckoutWorld", lambda *_, **__: closed)
    monkeypatch.setattr(f"{official}.checkout_world.examine", lambda *_: iter(findings))
    monkeypatch.setattr(f"{official}.checkout_world.valid_seeds", lambda *_: [100_000, 100_004])
    done = robospa("official", "checkout", tmp_path, "--json")
    assert done.code == 1 and json.loads(done.out) == [
        {"what": "scene", "good": None, "seen": "seed 100004"},
        {"what": "torch", "good": False, "seen": "2.13, not 2.4"},
    ]
    assert (
        robospa("official", "checkout", tmp_path).out.splitlines()[1] == "LOOK torch: 2.13, not 2.4"
    )
    words = ("--tasks", "Click_Bell_Repeat", "--levels", "2", "--trials", "2", "--json")
    done = robospa("official", "checkout", tmp_path, "--find", tmp_path / "seeds.json", *words)
    assert json.loads(done.out) == {"Click_Bell_Repeat": {"2": [100_000, 100_004]}}
    assert done.code == 0 and done.err == "Click_Bell_Repeat level 2: 2 seeds, 5 tried\n"
