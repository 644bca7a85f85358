"""Success against demonstrations and level, drawn from runs."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_runs import make_run, shown

from robospa.harness.cli.main import main
from robospa.results.figures.curves import CurvePoint, draw_learning_curve, value_at
from robospa.results.figures.series import styled
from robospa.results.records.runs import Run
from robospa.results.scoring.scores import score_run


def run(folder: Path, won: int) -> Run:
    """Ten trials of level 1, of which `won` succeed, and ten of level 2, of which half as many."""
    records = [
        shown("Pick_Blocks_Size", level, seed, seed < won // level, candidates=2)
        for level in (1, 2)
        for seed in range(10)
    ]
    return make_run(folder, records)


def test_a_line_for_every_level_and_every_number(tmp_path: Path) -> None:
    points = [
        CurvePoint(n, score_run(run(tmp_path / str(n), won))) for n, won in ((250, 8), (50, 4))
    ]
    level, mean = value_at(points[0], 2, "sr"), value_at(points[0], 0, "sr")
    assert level is not None and level.value == pytest.approx(0.4)
    assert mean is not None and mean.value == pytest.approx(0.6)
    with styled():
        left, right = draw_learning_curve(points).axes
    assert [c.get_label() for c in left.containers] == ["L1", "L2", "mean"]
    assert [c.get_label() for c in right.containers] == ["50", "250"]
    with pytest.raises(ValueError, match="none of the runs has the metric ps"):
        draw_learning_curve(points, "ps")


def test_the_command_draws_it_and_refuses_what_is_no_curve(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(tmp_path / "a", 8)
    picture = tmp_path / "curve.png"
    words = [f"50={tmp_path / 'a'}", "--out", str(picture)]
    with pytest.raises(SystemExit) as end:
        main(["learn", "curve", *words])
    assert not end.value.code and picture.read_bytes().startswith(b"\x89PNG")
    for changed, told in (
        (["50", *words[1:]], "is not COUNT=RUN"),
        ([words[0], *words], "the same number"),
        ([words[0], "--out", "curve.gif"], "does not end in one of"),
    ):
        with pytest.raises(SystemExit) as end:
            main(["learn", "curve", *changed])
        assert end.value.code and told in capsys.readouterr().err
