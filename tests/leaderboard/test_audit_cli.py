"""`robospa report --audit` from the command line: what it prints."""

from __future__ import annotations

import json
from pathlib import Path

from bundle_fakes import PICK, SEEDS, make_run
from command_line import robospa

from robospa.trial import TrialKey


def test_findings_as_json(tmp_path: Path) -> None:
    make_run(tmp_path / "run", [TrialKey(PICK, 1, seed) for seed in SEEDS])
    done = robospa("report", tmp_path / "run", "--audit", "--samples", 0, "--json")
    found = json.loads(done.out)
    assert done.code == 0 and found and all(one["sentence"] for one in found)
    assert not any(one["suspicious"] for one in found)
    plain = robospa("report", tmp_path / "run", "--audit", "--samples", 0).out.splitlines()
    assert plain == [f"{'ok':10} {one['check']}: {one['sentence']}" for one in found]
