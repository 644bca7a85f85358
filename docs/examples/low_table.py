"""low-table: the table stands up to 3 cm lower, and everything on it.

A worked example, not a mode of the benchmark; docs/adding-a-scene-mode.md walks through it.
"""

from __future__ import annotations

from robospa.tasks.modes import Part, with_table_raised
from robospa.tasks.scene import Scene

LOWEST = 0.03  # [m]


def low_table(scene: Scene, part: Part) -> Scene:
    """`scene` on a table whose height is drawn anew for every seed."""
    return with_table_raised(scene, -float(part("table height").uniform(0.0, LOWEST)))
