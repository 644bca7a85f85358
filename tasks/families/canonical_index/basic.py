"""Basic Ordinal * (SOI): the grids of Pick * Canonical, always counted the same way.

Columns count from left to right and rows from far to near, so nothing about directions has to be
read from the instruction: a reference for how much of the difficulty lies there.
"""

from __future__ import annotations

from robospa.tasks.families.canonical_index.scenes import line_task
from robospa.tasks.families.canonical_index.task import LINES

TASKS = tuple(line_task(line, basic=True) for line in LINES)
