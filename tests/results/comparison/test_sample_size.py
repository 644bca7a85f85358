"""How many trials an average takes, against the published rates counted by hand."""

from __future__ import annotations

import pytest

from robospa.results.comparison.sample_size import (
    discordant,
    half_width,
    published_variances,
    sample_size,
    trials_for,
    trials_paired,
    trials_unpaired,
)
from robospa.results.paper.published import LEVELS, load


def test_of_one_variant_it_is_the_binomial_formula() -> None:
    assert published_variances([("Pick_Blocks_Size", 1)])["RDT"] == pytest.approx(0.03 * 0.97)
    assert published_variances([("Pick_Fake", 1)]) == {}
    assert half_width(0.25, 100) == pytest.approx(0.098, abs=1e-3)
    assert trials_for(0.25, 0.05) == 385


def test_a_tenth_of_the_benchmark_tells_the_overall_rate_to_two_points() -> None:
    found = published_variances([(task, level) for task in load().tasks for level in LEVELS])
    assert all(half_width(variance, 10) < 0.02 for variance in found.values())
    enough = {model: trials_for(variance, 0.025) for model, variance in found.items()}
    assert enough == {"RDT": 2, "GO-1": 3, "pi0.5": 4, "X-VLA": 4}


def test_unrelated_seeds() -> None:
    assert trials_unpaired(0.2, 0.3) == 292
    assert trials_unpaired(0.2, 0.25) == trials_unpaired(0.25, 0.2) == 1092


def test_equal_seeds_save_trials_where_outcomes_correlate() -> None:
    needed = [trials_paired(0.2, 0.3, phi) for phi in (0.0, 0.25, 0.5)]
    assert needed == sorted(needed, reverse=True)
    assert needed[0] == pytest.approx(trials_unpaired(0.2, 0.3), rel=0.02)


def test_discordant_share_by_hand() -> None:
    assert discordant(0.2, 0.3, 0.0) == pytest.approx(0.2 * 0.7 + 0.8 * 0.3)
    assert discordant(0.5, 0.5, 1.0) == pytest.approx(0.0)


def test_a_sample_size_leaves_out_correlations_that_cannot_be() -> None:
    assert set(sample_size(0.2, 0.05).paired) == {0.25, 0.5}
    assert set(sample_size(0.02, 0.5, (0.0, 0.5)).paired) == {0.0}


@pytest.mark.parametrize(("base", "other"), [(0.2, 0.2), (-0.1, 0.2), (0.5, 1.1)])
def test_rates_that_are_none_are_refused(base: float, other: float) -> None:
    with pytest.raises(ValueError, match="not two different rates"):
        trials_unpaired(base, other)
