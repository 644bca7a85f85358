"""Basic Position * (EPG): the scenes of Pick * Multi View, always named as the robot sees them.

No viewpoint has to be taken: a reference for how much of the difficulty lies there.
"""

from __future__ import annotations

from robospa.tasks.families.cross_view.scenes import spread_task
from robospa.tasks.families.cross_view.task import SPREADS

TASKS = tuple(spread_task(spread, basic=True) for spread in SPREADS)
