"""ONTA: a success rate corrected for guessing among n candidates: 0 is chance, 1 certainty.

All of it is (rate - 1/n) / (1 - 1/n). Printed digits and the bits in reports depend on the order of
operations, so each form in use is written here once.
"""

from __future__ import annotations


def scale_and_shift(candidates: int) -> tuple[float, float]:
    """ONTA as `shift + scale * rate`; ValueError if there are fewer than two candidates."""
    _check(candidates)
    chance = 1 / candidates
    return 1 / (1 - chance), -chance / (1 - chance)


def of_percent(success: float, candidates: int) -> float:
    """ONTA in percent of a success rate in percent, computed as the paper does."""
    _check(candidates)
    return (success - 100 / candidates) / (1 - 1 / candidates)


def of_bound(rate: float, candidates: int) -> float:
    """ONTA of a bound of a success rate (a fraction): exactly 1 at 1."""
    _check(candidates)
    return (rate * candidates - 1) / (candidates - 1)


def _check(candidates: int) -> None:
    if candidates < 2:
        raise ValueError(f"chance among {candidates} candidates is certainty")
