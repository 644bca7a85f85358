"""Samples that nobody can choose, and what they catch."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from fractions import Fraction

import pytest

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.evidence import (
    announced,
    catch_probability,
    drawn,
    least_sample,
    sample_size,
    what_it_catches,
)
from robospa.trial import TrialKey

KEYS = [TrialKey(task, level, s) for task in ("A", "B") for level in (1, 2) for s in range(10)]


def test_one_percent_of_the_benchmark_catches_two_percent_forged() -> None:
    assert sample_size(0.01, 28_000) == 280
    assert round(100 * catch_probability(28_000, 560, 280), 1) == 99.7


@pytest.mark.parametrize(
    ("trials", "least"), [(1, 1), (19, 19), (40, 39), (100, 74), (2000, 131), (28_000, 135)]
)
def test_no_sample_misses_five_percent_more_than_once_in_a_thousand(
    trials: int, least: int
) -> None:
    """Against the hypergeometric distribution, by whole numbers."""
    forged = max(1, trials // 20)

    def missed(count: int) -> Fraction:
        return Fraction(math.comb(trials - forged, count), math.comb(trials, count))

    assert least_sample(trials) == least
    assert missed(least) <= Fraction(1, 1000) < missed(least - 1)


def test_more_may_be_asked_for_and_never_less() -> None:
    assert sample_size(0.01, 2000) == 131
    assert sample_size(1e-9, 2000) == 131
    assert sample_size(0.1, 2000) == 200
    assert sample_size(1, 2000) == 2000
    assert sample_size(0.01, 4) == 4


def test_what_a_sample_catches_is_said() -> None:
    assert what_it_catches(2000, 131).endswith("99.9 % for 5 %, 93.5 % for 2 %, 74.4 % for 1 %.")


def test_catch_probability_by_hand() -> None:
    assert catch_probability(10, 1, 1) == pytest.approx(0.1)
    assert catch_probability(4, 2, 2) == pytest.approx(1 - 1 / 6)
    assert catch_probability(10, 5, 6) == 1.0


def test_a_sample_follows_from_challenge_and_bundle() -> None:
    one = drawn("0123456789", "bundle", KEYS, 10)
    assert one == drawn("0123456789", "bundle", KEYS[::-1], 10)
    assert one != drawn("0123456780", "bundle", KEYS, 10)
    assert one != drawn("0123456789", "another", KEYS, 10)
    assert len(set(one)) == 10


def test_every_trial_is_as_likely_as_another() -> None:
    seen: Counter[TrialKey] = Counter()
    for n in range(500):
        seen.update(drawn(f"challenge {n}", "bundle", KEYS, 10))
    assert len(seen) == len(KEYS)
    assert min(seen.values()) > 90 and max(seen.values()) < 165


def test_a_challenge_that_can_be_guessed_is_refused() -> None:
    with pytest.raises(BundleError, match="fewer than 8"):
        drawn("1234567 ", "bundle", KEYS, 10)


@pytest.mark.parametrize("fraction", [0, -1, 1.1, float("nan")])
def test_a_fraction_that_is_none_is_refused(fraction: float) -> None:
    with pytest.raises(BundleError, match="the fraction"):
        sample_size(fraction, 100)


def test_videos_of_all_models_are_of_the_same_scenes() -> None:
    other = [replace(key, embodiment="other", mode="other", split="train") for key in KEYS]
    found = announced("robospa-1", other)
    assert [(k.variant, k.seed) for k in found] == [
        (k.variant, k.seed) for k in announced("robospa-1", KEYS)
    ]


def test_videos_are_one_of_every_task_whatever_the_order() -> None:
    chosen = announced("ab", KEYS)
    assert [key.task for key in chosen] == ["A", "B"]
    assert chosen == announced("ab", KEYS[::-1])
