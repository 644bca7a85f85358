"""A policy most of whose actions are out of reach is told so by every command that it meets."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from below_reach import BelowReach

from robospa.harness.cli.main import main
from robospa.protocol.server import ServerThread

pytestmark = pytest.mark.sim

SHARE = "ask for a pose out of reach, so that the arm holds"
HINT = "are poses in the world frame, in metres, with quaternions w x y z?"


def test_every_command_says_that_actions_are_out_of_reach(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")

    def printed(*words: str) -> str:
        capsys.readouterr()
        try:
            main(list(words))
        except SystemExit as end:
            assert not end.code, capsys.readouterr()
        return " ".join(capsys.readouterr().out.split())

    with ServerThread(policy_factory=BelowReach) as server:
        seen = printed("check", server.url, "--load-seconds", "0")
    assert f"executed actions look 298 of 300 actions (99 %) {SHARE}: {HINT}" in seen
    assert "can be evaluated, but look at its first actions and executed actions before" in seen

    run = str(tmp_path / "run")
    chosen = ("--tasks", "Pick_Blocks_Size", "--levels", "1,2", "--trials", "1")
    seen = printed("eval", "below_reach:BelowReach", *chosen, "--out", run, "--workers", "1")
    assert f"(99 %) {SHARE}: {HINT} First: Pick_Blocks_Size-L1-" in seen
    assert "action 2: the left arm cannot reach position (-0.250, 0.000, 0.200)" in seen

    seen = printed("report", run, "--failures", "--trials")
    assert "no attempt | no gripper came near anything that was asked for; 149 of 150" in seen
    assert SHARE in printed("report", run, "--failures")
    assert "[unreachable-actions]" in printed("report", run, "--lint")

    printed("report", run)
    report = tmp_path / "run" / "report"
    data = json.loads((report / "report.json").read_text())
    assert data["runs"][0]["problems"]["unreachable_actions"] == 298
    page = (report / "report.html").read_text()
    assert page.count(SHARE) >= 4  # the findings, the run's card, two trials
