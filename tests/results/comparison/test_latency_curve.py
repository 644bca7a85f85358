"""Success against latency: pairs, the latency at which half is gone, table and figure."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_runs import make_run, shown

from robospa.results.comparison.latency_curve import (
    LatencyCurve,
    crossing,
    curve_table,
    latency_curve,
)
from robospa.results.comparison.sample_size import (
    discordant,
    half_width,
    published_variances,
    sample_size,
    trials_for,
    trials_unpaired,
)
from robospa.results.figures.charts import draw_latency_curves
from robospa.results.figures.series import styled
from robospa.results.scoring.models import IncomparableError, ModelResults, results_of_run

TRIALS = 40


def at(folder: Path, latency: float, good: int, switching: str = "wait") -> ModelResults:
    """A run of TRIALS trials at a latency, of which the first `good` succeed."""
    seen = {"periods": 100, "held": 20, "blind": 5, "seam_jerk": 300.0, "other_jerk": 50.0}
    size, ends = "Pick_Blocks_Size", ["success"] * good + ["time_limit"] * (TRIALS - good)
    records = [
        shown(size, 1, n, n < good, diagnostics={"real_time": seen}, end=end)
        for n, end in enumerate(ends)
    ]
    clock = {"latency": f"{latency:g}ms", "latency_ms": latency, "switching": switching}
    return results_of_run(make_run(folder, records, settings={"clock": clock}))


def test_a_point_is_over_the_trials_that_all_latencies_have(tmp_path: Path) -> None:
    """What one run lacks counts in none, and a variant that shares no seed is left out."""
    runs = [at(tmp_path / f"{ms:g}", ms, 20) for ms in (0.0, 100.0)]
    (variant,) = runs[0].trials
    one, other = dict(runs[0].trials[variant]), dict(runs[1].trials[variant])
    few = {seed: record for seed, record in other.items() if seed < 25}
    records = {
        replace(r.key, level=2, seed=place): replace(r, key=replace(r.key, level=2, seed=place))
        for place, r in ((0, one[0]), (1, other[1]))
    }
    alone = [{(variant[0], 2): {key.seed: record}} for key, record in records.items()]
    first = replace(runs[0], trials={variant: one, **alone[0]})
    second = replace(runs[1], trials={variant: few, **alone[1]})
    found = latency_curve([first, second])
    assert [p.success.value for p in found.points] == [0.8, 0.8]
    assert found.trials == 25
    assert found.points[1].gap is not None and found.points[1].gap.value == 0.0


@pytest.fixture
def curve(tmp_path: Path) -> LatencyCurve:
    rates = {0.0: 40, 100.0: 36, 200.0: 24, 400.0: 8}
    return latency_curve([at(tmp_path / f"{ms:g}", ms, good) for ms, good in rates.items()])


@pytest.mark.parametrize(
    ("rates", "expected"),
    [
        ([0.8, 0.6, 0.2], 150.0),  # from 0.6 at 100 to 0.2 at 200, half is 0.4
        ([0.8, 0.4, 0.2], 100.0),
        ([0.8, 0.7, 0.6], math.inf),
        ([0.8, 0.9, 0.0], 100.0 + 100.0 * 5 / 9),
        ([0.0, 0.0, 0.0], math.nan),  # nothing can be lost of nothing
    ],
)
def test_half_is_where_the_line_first_falls_to_it(rates: list[float], expected: float) -> None:
    found = crossing(np.array([0.0, 100.0, 200.0]), np.array(rates))
    assert found == pytest.approx(expected, nan_ok=True)


def test_points_are_held_against_the_lowest_latency_pair_by_pair(curve: LatencyCurve) -> None:
    assert [round(p.success.value, 3) for p in curve.points] == [1.0, 0.9, 0.6, 0.2]
    assert curve.points[0].gap is None
    gaps = [p.gap.value for p in curve.points[1:] if p.gap is not None]
    assert gaps == pytest.approx([-0.1, -0.4, -0.8])
    assert curve.points[2].p is not None and curve.points[2].p < 0.001
    assert curve.points[1].held == pytest.approx(0.2)
    assert curve.points[3].timed_out == pytest.approx(0.8)


def test_the_latency_at_which_half_is_gone_has_an_interval(curve: LatencyCurve) -> None:
    assert curve.half is not None
    assert curve.half.value == pytest.approx(250.0)
    assert 150.0 < curve.half.low < 250.0 < curve.half.high < 350.0
    assert curve.half_text.startswith("half of the success is gone at 250 ms [")


def test_beyond_the_last_point_it_is_not_known_and_json_stays_json(tmp_path: Path) -> None:
    found = latency_curve([at(tmp_path / "a", 0, 40), at(tmp_path / "b", 500, 36)])
    assert "at > 500 ms [> 500, > 500]" in found.half_text
    data = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert data["half"]["value"] is None and data["points"][1]["latency"] == 500


def test_the_table_says_what_it_cost(curve: LatencyCurve) -> None:
    table = curve_table(curve)
    assert [row.label for row in table.rows] == ["0 ms", "100 ms", "200 ms", "400 ms"]
    assert table.heads[1] == "minus 0 ms"
    assert table.rows[2].cells[1].text.startswith("-40.0 [-")
    assert "Half of the success is gone at 250 ms" in table.notes[0]


def test_what_is_no_curve_is_refused(tmp_path: Path) -> None:
    one = at(tmp_path / "a", 0, 40)
    with pytest.raises(IncomparableError, match="two latencies"):
        latency_curve([one])
    with pytest.raises(IncomparableError, match="one run a latency"):
        latency_curve([one, at(tmp_path / "b", 0, 30)])
    with pytest.raises(IncomparableError, match="one way to switch"):
        latency_curve([one, at(tmp_path / "c", 100, 30, "after:4")])
    paused = results_of_run(make_run(tmp_path / "d", [shown("Pick_Blocks_Size", 1, 0, True)]))
    with pytest.raises(IncomparableError, match="has no constant latency"):
        latency_curve([one, paused])


def test_the_figure_shows_every_point_and_where_half_is_gone(curve: LatencyCurve) -> None:
    with styled():
        figure = draw_latency_curves([curve])
    axis = figure.axes[0]
    assert axis.get_xlabel() == "declared latency of an answer [ms]"
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(names) == 1 and names[0].endswith("wait: half at 250 ms")
    assert list(axis.containers[0].lines[0].get_xdata()) == [0, 100, 200, 400]


# -------------------- how many trials an average takes, against the published rates counted by hand


def test_of_one_variant_it_is_the_binomial_formula() -> None:
    assert published_variances([("Pick_Blocks_Size", 1)])["RDT"] == pytest.approx(0.03 * 0.97)
    assert published_variances([("Pick_Fake", 1)]) == {}
    assert half_width(0.25, 100) == pytest.approx(0.098, abs=1e-3)
    assert trials_for(0.25, 0.05) == 385


def test_unrelated_seeds() -> None:
    assert trials_unpaired(0.2, 0.3) == 292
    assert trials_unpaired(0.2, 0.25) == trials_unpaired(0.25, 0.2) == 1092


def test_discordant_share_by_hand() -> None:
    assert discordant(0.2, 0.3, 0.0) == pytest.approx(0.2 * 0.7 + 0.8 * 0.3)
    assert discordant(0.5, 0.5, 1.0) == pytest.approx(0.0)


def test_a_sample_size_leaves_out_correlations_that_cannot_be() -> None:
    assert set(sample_size(0.2, 0.05)[1]) == {0.25, 0.5}
    assert set(sample_size(0.02, 0.5, (0.0, 0.5))[1]) == {0.0}


@pytest.mark.parametrize(("base", "other"), [(0.2, 0.2), (-0.1, 0.2), (0.5, 1.1)])
def test_rates_that_are_none_are_refused(base: float, other: float) -> None:
    with pytest.raises(ValueError, match="not two different rates"):
        trials_unpaired(base, other)
