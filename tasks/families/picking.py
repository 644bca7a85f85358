"""What the pick tasks share: names, plan, goal, and turns at which every object can be grasped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robospa.tasks.colors import NAMED
from robospa.tasks.families.table import draw_variant, standing
from robospa.tasks.goals.lifting import Lift, PickTracker
from robospa.tasks.objects import model_of
from robospa.tasks.plan import Pick, Skill
from robospa.tasks.sampling.turns import Turnable
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.task import SceneFacts, Tracker


@dataclass(frozen=True)
class PickFacts(SceneFacts):
    """What the pick tasks have in common."""

    target: str


def pick_name(kind: str, family: str) -> str:
    """The official name: ("Cups", "Canonical") -> "Pick_Cups_Canonical"; the letter of a set of
    mixed objects comes last.
    """
    head, _, letter = kind.rpartition("_")
    return f"Pick_{head}_{family}_{letter}" if letter in ("A", "B") else f"Pick_{kind}_{family}"


def lifted(lift: Lift) -> Callable[[Scene], Tracker]:
    """The goal that the scene's target is picked as `lift` says of a table at its usual height."""

    def goal(scene: Scene) -> Tracker:
        above = None if lift.above is None else lift.above + scene.table_rise
        names = tuple(o.name for o in scene.objects)
        models = {o.name: model_of(o) for o in scene.objects}
        middles = {n: (0.0, 0.0, m.bottom + m.size[2] / 2) for n, m in models.items()}
        target = PickFacts.of(scene).target
        return PickTracker(target, names, replace(lift, above=above), middles)

    return goal


def pick_target(scene: Scene) -> tuple[Skill, ...]:
    """The plan: pick the target."""
    return (Pick(PickFacts.of(scene).target),)


def put_down(items: Sequence[Turnable], yaws: Sequence[float]) -> tuple[SceneObject, ...]:
    """`items` on the table, turned by `yaws` [rad], as "object_0", "object_1", ..."""
    return tuple(
        SceneObject(
            f"object_{k}",
            item.asset,
            standing(item.place, yaw, item.params["half"][2] if "half" in item.params else 0.0),
            item.params,
        )
        for k, (item, yaw) in enumerate(zip(items, yaws, strict=True))
    )


BLOCK_HALF = 0.015
"""Half an edge [m] of a block among mixed objects."""
BLOCK_COLORS = ("red", "blue", "green", "yellow", "purple", "black")


def draw_params(rng: np.random.Generator, asset: str) -> dict[str, object]:
    """One of the variants of `asset`; for a block among mixed objects one of six colours."""
    if asset == "block":
        color = NAMED[BLOCK_COLORS[int(rng.integers(len(BLOCK_COLORS)))]]
        return {"half": [BLOCK_HALF] * 3, "color": list(color)}
    return dict(draw_variant(rng, asset))
