"""What a suite ships lists for."""

from __future__ import annotations

from collections import Counter

from freeze_seeds import shipped

from robospa.harness.robots import embodiments
from robospa.trial import REFERENCE


def test_the_lists_of_a_suite() -> None:
    keys = shipped()
    count = Counter((key.embodiment, key.mode) for key in keys)
    assert len(keys) == len(set(keys))
    assert count.pop((REFERENCE, "clean")) == 355
    assert count.pop((REFERENCE, "randomized")) == 280
    others = [robot for robot in embodiments() if robot != REFERENCE]
    assert count == {(r, m): n for r in others for m, n in (("clean", 280), ("randomized", 50))}
