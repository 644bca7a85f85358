"""A whole run in a stand-in checkout: processes, records, scores, and a suite of its own."""

import json
import sys
from pathlib import Path

import pytest
from standin_checkout import write_standin

from robospa.harness.cli.main import main
from robospa.results.records.runs import read_run, setting_name

pytestmark = pytest.mark.sim
pytest.importorskip("yaml", reason="a checkout needs PyYAML")


def test_seeds_are_found_and_a_run_is_recorded_in_its_own_suite(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = f"{write_standin(tmp_path)}?python={sys.executable}"
    seeds, out = tmp_path / "seeds.json", tmp_path / "run"
    what = ["--tasks", "Click_Bell_Repeat", "--levels", "1,2"]
    with pytest.raises(SystemExit) as found:
        main(["official", "checkout", world, "--find", str(seeds), *what, "--trials", "2"])
    assert found.value.code == 0
    listed = {"1": [100000, 100004], "2": [100000, 100004]}
    assert json.loads(seeds.read_text()) == {"Click_Bell_Repeat": listed}
    with pytest.raises(SystemExit) as ended:
        main([
            "eval", "standin_checkout:Ringer", "--world", f"checkout:{world}", *what,
            "--seeds", str(seeds), "--trials", "2", "--workers", "1", "--out", str(out),
        ])  # fmt: skip
    assert ended.value.code == 0, capsys.readouterr().err
    run = read_run(out)
    assert len(run.records) == 4 and not run.missing
    assert run.manifest.suite == "official-checkout"
    assert setting_name(run).startswith("official-checkout, ")
    assert {r.instruction for r in run.records.values() if r.key.level == 1} == {
        "make the golden bell sound"
    }
    assert all(r.success and r.done == r.total == r.key.level for r in run.records.values())
