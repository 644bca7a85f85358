"""The paper's arithmetic, by hand."""

from __future__ import annotations

import pytest

from robospa.results.paper import rounding
from robospa.results.statistics.samples import onta_of_percent


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (4.75, "4.8"),
        (20.25, "20.3"),
        (25.25, "25.3"),
        (-0.04, "0.0"),
        (-7.55, "-7.6"),
        (0.0, "0.0"),
    ],
)
def test_values_are_rounded_half_away_from_zero(value: float, shown: str) -> None:
    assert rounding.text(value) == shown


def test_a_drop_is_the_difference_of_printed_values() -> None:
    assert rounding.drop(10.0, 4.75) == 5.2
    assert rounding.drop(None, 4.75) is None


def test_a_mean_of_something_missing_is_missing() -> None:
    assert rounding.mean([1.0, None]) is None
    assert rounding.mean([]) is None
    found = rounding.summary({"a": 10.0, "b": 20.0, "c": 40.0}, {"GAC": ["a", "b"], "RPF": ["c"]})
    assert found == {"GAC": 15.0, "RPF": 40.0, "spatial": 15.0, "procedural": 40.0, "overall": 27.5}


def test_onta_is_zero_at_chance_and_needs_a_choice() -> None:
    assert onta_of_percent(25, 4) == 0
    with pytest.raises(ValueError, match="certainty"):
        onta_of_percent(50, 1)


def test_progress_is_recovered_from_its_printed_form() -> None:
    assert rounding.exact_progress(39.3, 3) == pytest.approx(118 / 3)
    assert rounding.exact_progress(6.3, 5) == 6.3  # no mean of fifths
