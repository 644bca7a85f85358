"""The bootstrap drawn from exact distributions, against resampled episodes and the paper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robospa.results.paper.published import load
from robospa.results.statistics.samples import (
    Sample,
    draw,
    draw_over_tasks,
    progress,
    rate,
    resample_episodes,
)

SPATIAL = ("GAC", "SDE", "CPI", "RRR", "CVR")
PROCEDURAL = ("RPF", "OFE", "OCE", "CAC", "MIP")
COLUMNS = {"spatial": SPATIAL, "procedural": PROCEDURAL, "overall": SPATIAL + PROCEDURAL}


def published_cells(
    model: str, categories: tuple[str, ...], level: int = 5
) -> tuple[list[Sample], list[float]]:
    data, members = load(), load().members
    samples, weights = [], []
    for category in categories:
        for task in members[category]:
            successes = data.value(model, "sr", task, level)
            assert successes is not None
            samples.append(rate(int(successes), 100))
            weights.append(1 / (len(categories) * len(members[category])))
    return samples, weights


def distances() -> list[float]:
    """How far our 24 interval ends are from the printed ones, in points."""
    found = []
    for model, row in load().intervals.rows.items():
        for column, categories in COLUMNS.items():
            drawn = draw(*published_cells(model, categories))
            ours = 100 * np.percentile(drawn, [2.5, 97.5])
            found += [abs(a - b) for a, b in zip(ours, row[column][1:], strict=True)]
    return found


def test_the_papers_interval_table_within_the_noise_of_ten_thousand_resamples() -> None:
    found = distances()
    assert len(found) == 24
    assert np.mean(found) <= 0.03
    assert sum(d <= 0.05 for d in found) >= 20


def test_one_seed_gives_one_answer_and_another_seed_another() -> None:
    cells = published_cells("RDT", SPATIAL)
    first, again, other = draw(*cells, 7), draw(*cells, 7), draw(*cells, 8)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    groups = [cells[0][:4], cells[0][4:9]]
    assert np.array_equal(draw_over_tasks(groups, 7, 500), draw_over_tasks(groups, 7, 500))


def test_a_coin_thrown_twice() -> None:
    drawn = draw([rate(1, 2)], [1.0], resamples=100_000)
    shares = [float(np.mean(drawn == v)) for v in (0.0, 0.5, 1.0)]
    assert shares == pytest.approx([0.25, 0.5, 0.25], abs=0.006)


@pytest.mark.parametrize(
    "samples",
    [
        [rate(1, 100), rate(30, 100), rate(99, 100)],
        [rate(22, 100, candidates=6), rate(50, 100, candidates=2)],
        [Sample((60, 25, 10, 5), 1 / 3), Sample((97, 0, 3), 0.5)],
        [Sample((10, 70, 20), 1.0, -1.0)],
    ],
    ids=["rates", "onta", "progress", "paired"],
)
def test_drawing_sums_is_resampling_episodes(samples: list[Sample]) -> None:
    weights = [1 / len(samples)] * len(samples)
    fast = draw(samples, weights, seed=1, resamples=40_000)
    slow = resample_episodes(samples, weights, seed=2, resamples=40_000)
    noise = slow.std() / math.sqrt(40_000)
    assert abs(fast.mean() - slow.mean()) < 6 * noise
    assert fast.std() == pytest.approx(slow.std(), rel=0.03)
    ends = [np.percentile(x, [2.5, 25, 75, 97.5]) for x in (fast, slow)]
    step = max(s.scale / s.trials for s in samples) / len(samples)  # means lie on a grid
    assert ends[0] == pytest.approx(ends[1], abs=0.05 * slow.std() + 1.01 * step)


def test_a_variant_that_never_varies_is_drawn_as_it_is() -> None:
    drawn = draw([rate(0, 100), rate(100, 100), rate(0, 9, candidates=3)], [1.0, 1.0, 1.0])
    assert drawn == pytest.approx(np.full(10_000, 1.0 - 0.5))


def test_sums_beyond_sixteen_bits() -> None:
    drawn = draw([rate(69_000, 70_000)], [1.0], resamples=2000)
    assert drawn.mean() == pytest.approx(69 / 70, abs=1e-4)
    assert drawn.std() == pytest.approx(math.sqrt(69 / 70 / 70 / 70_000), rel=0.1)


def test_other_tasks_make_the_interval_of_the_paper_three_to_four_times_wider() -> None:
    data, members = load(), load().members
    groups = [
        [rate(int(data.value("RDT", "sr", t, 5) or 0), 100) for t in members[c]] for c in members
    ]
    low, high = 100 * np.percentile(draw_over_tasks(groups), [2.5, 97.5])
    assert (low, high) == pytest.approx((4.9, 9.3), abs=0.15)


def test_progress_counts_subtasks() -> None:
    found = progress([(0, 4), (1, 4), (4, 4), (3, 4)])
    assert found.counts == (1, 1, 0, 1, 1)
    assert found.value == pytest.approx(0.5)
    assert progress([(1, 2), (1, 3)]).value == pytest.approx((1 / 2 + 1 / 3) / 2)


def test_onta_by_hand() -> None:
    assert rate(22, 100, candidates=6).value == pytest.approx(0.064)
    assert rate(50, 100, candidates=2).value == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rate(3, 2), "3 successes in 2 trials is no rate"),
        (lambda: rate(0, 0), "0 successes in 0 trials is no rate"),
        (lambda: rate(1, 2, candidates=1), "chance among 1 candidates is certainty"),
        (lambda: progress([(3, 2)]), "3 of 2 subtasks done is no progress"),
        (lambda: progress([]), "are no counts"),
        (lambda: Sample((1, 1), -1.0), "not positive"),
        (lambda: draw([], []), "one weight for each of at least one sample"),
        (lambda: draw_over_tasks([[]]), "at least one task in every category"),
    ],
)
def test_what_is_no_sample_is_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
