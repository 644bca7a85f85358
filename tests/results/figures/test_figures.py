"""Figures exist in every format, the same bytes each time, and show what they are given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from fake_runs import record

from robospa.results.failures.labels import KINDS, distribution
from robospa.results.figures.charts import (
    FILLS,
    chance_levels,
    draw_latency,
    draw_levels,
    draw_progress,
)
from robospa.results.figures.draw import draw
from robospa.results.figures.series import FORMATS, GRID, INK, Series, label_of, styled
from robospa.results.paper.columns import published_column
from robospa.results.report.page import inline_svg
from robospa.results.scoring.scores import score
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from matplotlib.figure import Figure


RDT = Series("RDT", published_column("RDT").scores, published=True)


LATE = {"p95": 6.0, "p99": 9.0, "max": 9.0}


def small_run(name: str = "mine") -> Series:
    records = [
        record(task, level, seed, level - (seed <= level), level, latency={"p50": 4 + seed, **LATE})
        for task in ("Pick_Blocks_Size", "Press_Stapler_Repeat")
        for level in (1, 5)
        for seed in range(4)
    ]
    by_key = {r.key: r for r in records}
    failures = distribution(records)
    return Series(name, score(by_key, by_key), tuple(records), failures=failures)


SVG = ("svg",)
"""The one format of tests that look at no other: the figures are the same in all."""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All figures of the small run, in all formats."""
    folder = tmp_path_factory.mktemp("drawn")
    draw([small_run()], folder)
    return folder


def test_a_run_gets_all_figures_in_all_formats(drawn: Path) -> None:
    made = ["success", "progress", "latency", "failures", "heat"]
    assert {p.name for p in drawn.iterdir()} == {f"{n}.{f}" for n in made for f in FORMATS}


def test_published_models_have_no_latency_and_no_failures(tmp_path: Path) -> None:
    made = [d.name for d in draw([RDT], tmp_path, ())]
    assert made == ["success", "progress", "heat"]


def test_beside_a_run_published_models_get_no_heat_map(tmp_path: Path) -> None:
    made = [d.name for d in draw([small_run(), RDT], tmp_path, ())]
    assert [n for n in made if n.startswith("heat")] == ["heat-1"]


def test_the_same_data_in_any_order_make_the_same_bytes(drawn: Path, tmp_path: Path) -> None:
    one = small_run()
    draw([replace(one, records=one.records[::-1])], tmp_path)
    for path in drawn.iterdir():
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


def test_a_series_without_any_result_draws_what_it_can(tmp_path: Path) -> None:
    keys = [TrialKey("Pick_Blocks_Size", 2, 7)]
    empty = Series("empty", score(keys, {}, {"Pick_Blocks_Size": "GAC"}))
    assert [d.name for d in draw([empty], tmp_path, ())] == ["success", "heat"]


def test_names_of_policies_are_no_mathematics(tmp_path: Path) -> None:
    assert label_of("a$b$\n" + "x" * 60, 28) == r"a\$b\$ " + "x" * 22 + "…"
    draw([small_run(r"$\frac{a$ _^{")], tmp_path, SVG)


def test_chance_comes_back_from_onta() -> None:
    levels = chance_levels(published_column("RDT").scores)
    assert levels["GAC", 1] == pytest.approx(50.0)
    assert levels["RRR", 5] == pytest.approx(100 / 9)


def test_every_failure_type_has_a_look_of_its_own() -> None:
    assert len(set(FILLS)) == len(FILLS) >= len(KINDS)


def test_a_figure_in_the_page_takes_its_colours_and_keeps_its_ids_apart(drawn: Path) -> None:
    svg = inline_svg((drawn / "success.svg").read_text(), "success", 'a "label"')
    assert svg.startswith("<svg ")
    assert INK not in svg
    assert GRID not in svg
    assert "http" not in svg
    assert 'id="success-figure_1"' in svg
    assert "a &#34;label&#34;" in svg


@pytest.mark.parametrize("make", [draw_latency, draw_levels, draw_progress])
def test_nothing_of_a_figure_is_cut_off(make: Callable[[Sequence[Series]], Figure]) -> None:
    runs = [small_run(f"{n} mistakes:neighbour (privileged, 3 of 60 missing)") for n in range(3)]
    with styled():
        figure = make(runs)
        figure.draw_without_rendering()
    width, height = figure.bbox.width, figure.bbox.height
    for part in (*figure.legends, *figure.axes):
        box = part.get_tightbbox(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        assert box is not None
        assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1, part
