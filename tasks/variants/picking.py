"""What the five pick tasks share: the plan is to pick the target, the goal that it is lifted."""

from __future__ import annotations

from collections.abc import Callable

from robospa.tasks.goals.pick import Lift, PickTracker
from robospa.tasks.plan import Pick, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.task import Tracker


def lifted(lift: Lift) -> Callable[[Scene], Tracker]:
    """The goal that the scene's target is picked as `lift` says."""

    def goal(scene: Scene) -> Tracker:
        return PickTracker(str(scene.facts["target"]), tuple(o.name for o in scene.objects), lift)

    return goal


def pick_target(scene: Scene) -> tuple[Skill, ...]:
    """The plan: pick the target."""
    return (Pick(str(scene.facts["target"])),)
