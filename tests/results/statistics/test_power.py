"""Sample sizes: known numbers, and simulations that keep their promise."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.results.comparison.sample_size import (
    discordant,
    power_paired,
    sample_size,
    trials_paired,
    trials_unpaired,
)
from robospa.results.statistics.significance import mcnemar_mid_p


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


def test_the_power_formula_agrees_with_simulated_tests() -> None:
    apart = discordant(0.2, 0.3, 0.45)
    b, c = (apart - 0.1) / 2, (apart + 0.1) / 2
    draws = np.random.default_rng(0).multinomial(100, [b, c, 1 - b - c], size=2000)
    found = float(np.mean([mcnemar_mid_p(int(x), int(y)) < 0.05 for x, y, _ in draws]))
    assert power_paired(0.2, 0.3, 0.45, 100) == pytest.approx(0.58, abs=0.005)
    assert found == pytest.approx(0.58, abs=0.03)


def test_a_sample_size_leaves_out_correlations_that_cannot_be() -> None:
    assert set(sample_size(0.2, 0.05).paired) == {0.25, 0.5}
    assert set(sample_size(0.02, 0.5, (0.0, 0.5)).paired) == {0.0}


@pytest.mark.parametrize(("base", "other"), [(0.2, 0.2), (-0.1, 0.2), (0.5, 1.1)])
def test_rates_that_are_none_are_refused(base: float, other: float) -> None:
    with pytest.raises(ValueError, match="not two different rates"):
        trials_unpaired(base, other)
