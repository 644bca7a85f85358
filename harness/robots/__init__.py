"""Robots as data, and their kinematics."""

from __future__ import annotations

from functools import cache

from robospa.harness.robots.embodiment import Embodiment

EMBODIMENTS = ("aloha-agilex",)


@cache
def embodiment(name: str) -> Embodiment:
    """The robot called `name`; ValueError, listing what exists, if there is none."""
    if name == "aloha-agilex":
        from robospa.harness.robots.aloha_agilex import ALOHA_AGILEX

        return ALOHA_AGILEX
    raise ValueError(f"no embodiment {name!r}; there are {', '.join(EMBODIMENTS)}")
