"""A whole run in a stand-in checkout: processes, records, scores, and a suite of its own."""

import json
import sys
from pathlib import Path

import pytest
from command_line import robospa
from standin_checkout import write_standin

from robospa.results.records.runs import read_run, setting_name

pytestmark = pytest.mark.sim
pytest.importorskip("yaml", reason="a checkout needs PyYAML")


def test_seeds_are_found_and_a_run_is_recorded_in_its_own_suite(tmp_path: Path) -> None:
    world = f"{write_standin(tmp_path)}?python={sys.executable}"
    seeds, out = tmp_path / "seeds.json", tmp_path / "run"
    what = ["--tasks", "Click_Bell_Repeat", "--levels", "1,2"]
    done = robospa("official", "checkout", world, "--find", seeds, *what, "--trials", "2")
    assert done.code == 0
    listed = {"1": [100000, 100004], "2": [100000, 100004]}
    assert json.loads(seeds.read_text()) == {"Click_Bell_Repeat": listed}
    done = robospa(
        "eval", "standin_checkout:Ringer", "--world", f"checkout:{world}", *what,
        "--seeds", seeds, "--trials", "2", "--workers", "1", "--out", out,
    )  # fmt: skip
    assert done.code == 0, done.err
    run = read_run(out)
    assert len(run.records) == 4 and not run.missing
    assert run.manifest.suite == "official-checkout"
    assert setting_name(run).startswith("official-checkout, ")
    assert {r.instruction for r in run.records.values() if r.key.level == 1} == {
        "make the golden bell sound"
    }
    assert all(r.success and r.done == r.total == r.key.level for r in run.records.values())
