"""The exact test, by hand and against enumeration."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from robospa.leaderboard.agreement import (
    LEAST_POWER,
    LIE,
    Counts,
    agreement,
    cells,
    contradictions,
    holm,
    power,
    trials_needed,
)
from robospa.trial import SPATIAL


def test_one_variant_is_fishers_test_by_hand() -> None:
    """3 of 3 claimed, 0 of 3 fresh: of C(6, 3) = 20 ways to place the successes one is that."""
    found = agreement([Counts(3, 3, 0, 3)])
    assert found.lower == pytest.approx(1 / 20)
    assert found.upper == pytest.approx(1)
    assert found.p == pytest.approx(1 / 10)
    assert found.expected == pytest.approx(1.5)


def test_it_agrees_with_scipy() -> None:
    from scipy.stats import fisher_exact

    for claimed, fresh in ((60, 1), (60, 6), (5, 4), (0, 0)):
        found = agreement([Counts(claimed, 100, fresh, 10)])
        table = [[fresh, 10 - fresh], [claimed, 100 - claimed]]
        assert found.lower == pytest.approx(fisher_exact(table, "less")[1])
        assert found.upper == pytest.approx(fisher_exact(table, "greater")[1])


def test_several_variants_are_all_their_permutations() -> None:
    """Every way of calling two of a variant's trials fresh, for two variants at once."""
    first, second = [1, 1, 1, 0, 0], [1, 0, 0, 0]
    sums = [
        sum(a) + sum(b)
        for a in itertools.combinations(first, 2)
        for b in itertools.combinations(second, 2)
    ]
    found = agreement([Counts(3, 3, 0, 2), Counts(0, 2, 1, 2)])
    assert found.lower == pytest.approx(np.mean(np.array(sums) <= 1))
    assert found.upper == pytest.approx(np.mean(np.array(sums) >= 1))


def test_variants_without_any_success_count_for_nothing() -> None:
    some = [Counts(50, 100, 2, 10)]
    assert agreement([*some, Counts(0, 100, 0, 10)]).p == pytest.approx(agreement(some).p)


CATEGORY = {f"Task_{n}": "GAC" if n < 28 else "MIP" for n in range(56)}


def test_honest_claims_are_rarely_contradicted_and_a_lie_about_one_variant_always() -> None:
    random = np.random.default_rng(5)
    refused = noticed = 0
    for _ in range(60):
        rates = random.uniform(0, 0.9, 280).tolist()
        drawn = [
            Counts(int(random.binomial(100, r)), 100, int(random.binomial(7, r)), 7) for r in rates
        ]
        claim = {f"Task_{n // 5}/{n % 5 + 1}": c for n, c in enumerate(drawn)}
        refused += bool(contradictions({"sr": claim}, CATEGORY, 0.01))
        lie = {**claim, "Task_7/3": Counts(100, 100, 0, 7)}
        noticed += "sr of Task_7/3" in contradictions({"sr": lie, "sr1": claim}, CATEGORY, 0.01)
    assert refused <= 3 and noticed == 60


def test_cells_are_the_values_of_a_table() -> None:
    variants = [f"Do_{category}/{level}" for category in (*SPATIAL, "MIP") for level in (2, 3)]
    found = cells(variants, {v[:6]: v[3:6] for v in variants})
    assert found["spatial/2"] == tuple(f"Do_{category}/2" for category in SPATIAL)
    assert found["GAC/0"] == found["Do_GAC/0"] == ("Do_GAC/2", "Do_GAC/3")
    assert found["MIP/2"] == ("Do_MIP/2",) and "MIP/4" not in found
    assert not {"procedural/0", "overall/0"} & found.keys(), "means of what was not run"


def test_power_grows_with_the_drop() -> None:
    counts = [Counts(40, 100, 4, 10)] * 56
    small, large = power(counts, 0.02, 0.01), power(counts, 0.1, 0.01)
    assert small < 0.2
    assert large > 0.9


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []


def test_a_block_is_planned_so_that_a_lie_of_five_points_shows() -> None:
    claims = [Counts(40, 100, 0, 0)] * 40 + [Counts(90, 100, 0, 0)] * 40
    needed = trials_needed(claims, 0.01)
    assert needed is not None
    made = [replace(c, fresh_trials=needed) for c in claims]
    assert power(made, LIE, 0.01) >= LEAST_POWER
    fewer = [replace(c, fresh_trials=needed // 2) for c in claims]
    assert power(fewer, LIE, 0.01) < LEAST_POWER


def test_no_block_helps_claims_that_rest_on_too_few_trials() -> None:
    assert trials_needed([Counts(3, 4, 0, 0)] * 2, 0.01) is None
    assert trials_needed([Counts(50, 100, 0, 0)], 0.01) is None
