"""The demo as a user sees it: a server process, a table, a report with a film."""

from pathlib import Path

import pytest
from command_line import robospa

from robospa.registry import POLICIES, names

pytestmark = [
    pytest.mark.sim,
    pytest.mark.skipif("oracle" not in names(POLICIES), reason="robospa is not installed"),
]


def test_the_demo_leaves_a_page_of_mistakes_and_expert_with_films(tmp_path: Path) -> None:
    words = ["demo", "--tasks", "Pick_Blocks_Size", "--levels", "3", "--workers", "1"]
    done = robospa(*words, "--out", tmp_path / "demo")
    assert done.code == 0 and "Pick Blocks Size" in done.out
    report = tmp_path / "demo" / "report"
    assert len(list((report / "videos").rglob("*.mp4"))) == 2
    assert f"python3 -m webbrowser {(report / 'report.html').as_uri()}\n" in done.out
    page = (report / "report.html").read_text()
    assert "<video" in page and "mistakes" in page and "oracle" in page
