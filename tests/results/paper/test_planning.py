"""How many trials an average takes, against the published rates counted by hand."""

from __future__ import annotations

import pytest

from robospa.results.comparison.sample_size import half_width, published_variances, trials_for
from robospa.results.paper.published import LEVELS, load


def test_of_one_variant_it_is_the_binomial_formula() -> None:
    assert published_variances([("Pick_Blocks_Size", 1)])["RDT"] == pytest.approx(0.03 * 0.97)
    assert half_width(0.25, 100) == pytest.approx(0.098, abs=1e-3)
    assert trials_for(0.25, 0.05) == 385


def test_a_tenth_of_the_benchmark_tells_the_overall_rate_to_two_points() -> None:
    found = published_variances([(task, level) for task in load().tasks for level in LEVELS])
    assert all(half_width(variance, 10) < 0.02 for variance in found.values())
    enough = {model: trials_for(variance, 0.025) for model, variance in found.items()}
    assert enough == {"RDT": 2, "GO-1": 3, "pi0.5": 4, "X-VLA": 4}


def test_variants_that_are_not_published_say_nothing() -> None:
    assert published_variances([("Pick_Fake", 1)]) == {}
