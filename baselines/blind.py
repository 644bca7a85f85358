"""Blind policies: what can be scored without the sentence. Floors, never anybody's result.

`tries-all` picks up everything in turn, nearest first, and puts it back; `presses-all` presses
everything twice in turn; both begin again until the trial ends. `commonest` does with what lies
on the table what the plans of training scenes do with such things most often.

They know where everything lies and use the expert's skills, and say so in their specs. They see
nothing of a trial's sentence, target or plan: scenes are taken without their facts, and objects by
place and kind, for their names and order say nothing.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

from robospa.baselines.oracle import Oracle
from robospa.harness.skills import Expert, SkillFailed
from robospa.harness.skills.pick import pick
from robospa.harness.skills.workspace import Steps, Workspace, is_wall, moved_back, wall_front
from robospa.tasks.catalog import LEVELS, build_scene, task
from robospa.tasks.objects import object_model
from robospa.tasks.plan import Hit, Home, Pick, Place, Press, Skill, Wait
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot

LIFT = 0.1
"""How high things are lifted [m]: every pick task asks for less."""
SHOWN = 0.6
"""Seconds after the last thing has appeared: until then memory tasks allow no motion."""
ROUNDS = 400
"""More than the longest trial has actions for."""
TRAINING_SEEDS = range(1_000_000, 1_000_030)
"""Of each level: what `commonest` has seen."""
CELL = 0.05
"""Places [m] that round to the same multiple of this are one place; nearer ones are taken."""


@dataclass(frozen=True)
class TryOut:
    """Lift `object` and put it back where it was."""

    object: str

    def steps(self, ws: Workspace) -> Steps:
        """Down the same way; the arm stays above."""
        grasp = yield from pick(ws, Pick(self.object, LIFT))
        out = ws.solve(grasp.arm, moved_back(grasp.pose, grasp.approach, 0.08), grasp.joints)
        ws.add(grasp.arm, grasp.joints)
        ws.add(grasp.arm, gripper=1.0)
        if out is not None:
            ws.add(grasp.arm, out)
        ws.held[grasp.arm] = None
        yield from ws.flush()


Planner = Callable[[Scene, Workspace], Sequence[object]]
"""tuple[Skill, ...] from a scene without facts, once all of it has appeared."""


class BlindExpert(Expert):
    """Performs what `planner` says; what failed once is left alone."""

    def __init__(self, scene: Scene, snapshot: Snapshot, planner: Planner) -> None:
        super().__init__(replace(scene, facts={}), snapshot, ())
        self._planner = planner
        self._hopeless: set[str] = set()

    def _run(self, plan: Sequence[object]) -> Steps:
        scene = self.workspace.scene
        shown = max((item.appears_at or 0.0 for item in scene.objects), default=0.0)
        yield from self.perform(Wait(shown + SHOWN if shown else 0.0))
        yield from super()._run(self._planner(scene, self.workspace))

    def perform(self, call: object) -> Steps:
        name = getattr(call, "object", "")
        if name in self._hopeless:
            return
        try:
            if isinstance(call, TryOut):
                yield from call.steps(self.workspace)
            else:
                yield from super().perform(call)
        except SkillFailed:
            self._hopeless.add(name)
            raise


def tries_all(scene: Scene, ws: Workspace) -> list[TryOut]:
    """Everything loose that a gripper can close around, one after the other."""
    return [TryOut(item.name) for item in _nearest_first(scene, ws) if not item.fixed] * ROUNDS


def presses_all(scene: Scene, ws: Workspace) -> list[Press]:
    """Everything fixed that a gripper could close around, twice each."""
    return [Press(o.name) for o in _nearest_first(scene, ws) if o.fixed for _ in "12"] * ROUNDS


def _nearest_first(scene: Scene, ws: Workspace) -> list[SceneObject]:
    """What can be grasped and stands before any wall, each the nearest to the one before it."""
    at = {name: pose.position[:2] for name, pose in ws.snapshot.poses.items()}
    left = [o for o in scene.objects if ws.models[o.name].grasps and o.name in at]
    left = [o for o in left if at[o.name][1] < wall_front(ws) and not is_wall(ws.models[o.name])]
    found: list[SceneObject] = []
    here = (0.0, -0.4)
    while left:
        found.append(min(left, key=lambda o: math.dist(at[o.name], here)))
        here = at[found[-1].name]
        left.remove(found[-1])
    return found


@dataclass(frozen=True)
class Habit:
    """What a plan does with a thing of `kind` = (asset, right of the middle).

    Objects in `calls` are named by their assets, the thing itself is "". `sort` is the same with
    places rounded.
    """

    kind: tuple[str, bool]
    calls: tuple[Skill, ...]
    sort: tuple[Skill, ...]


def commonest(scene: Scene, ws: Workspace) -> list[Skill]:
    """With as many things of each asset as usual what is commonest for their kind, and possible."""
    seen = sorted(o.asset for o in scene.objects)
    known = _training(scene.task)
    alike = [habits for assets, habits in known if assets == seen] or [h for _, h in known]
    sorts: dict[tuple[str, bool], Counter[tuple[Skill, ...]]] = defaultdict(Counter)
    numbers: dict[str, Counter[int]] = defaultdict(Counter)
    example = {habit.sort: habit.calls for habits in alike for habit in habits}
    ranks: dict[str, list[int]] = defaultdict(list)
    for habits in alike:
        for asset in set(seen):
            numbers[asset][sum(habit.kind[0] == asset for habit in habits)] += 1
        for rank, habit in enumerate(habits):
            sorts[habit.kind][habit.sort] += 1
            ranks[habit.kind[0]].append(rank)
    things = [o for o in _nearest_first(scene, ws) if o.asset in ranks]
    things.sort(key=lambda o: sum(ranks[o.asset]) / len(ranks[o.asset]))
    left = {asset: count.most_common(1)[0][0] for asset, count in numbers.items()}
    done: list[SceneObject] = []
    plan: list[Skill] = []
    taken: list[tuple[float, float]] = []
    for item in things:
        kind = (item.asset, ws.pose(item.name).position[0] > 0)
        for sort, _ in sorts[kind].most_common() if left[item.asset] else ():
            calls = _bound(example[sort], item, scene, ws, done)
            places = [c.position[:2] for c in calls if isinstance(c, Place) and c.on is None]
            if calls and all(math.dist(a, b) > CELL for a in places for b in taken):
                plan += calls
                taken += places
                done.append(item)
                left[item.asset] -= 1
                break
    return plan


@cache
def _training(name: str) -> list[tuple[list[str], list[Habit]]]:
    """The assets of every training scene, and what its plan does with its things."""
    found = []
    for level in LEVELS:
        for seed in TRAINING_SEEDS:
            with suppress(ValueError):
                scene = build_scene(name, level, seed)
                found.append((sorted(o.asset for o in scene.objects), _habits(scene)))
    return found


def _habits(scene: Scene) -> list[Habit]:
    """The plan of a training scene, thing by thing in its order."""
    by_thing: dict[str, list[Skill]] = {}
    for call in task(scene.task).plan(scene):
        if not isinstance(call, Wait | Home):
            actor = call.tool if isinstance(call, Hit) else call.object
            by_thing.setdefault(actor, []).append(call)
    found = []
    for name, calls in by_thing.items():
        item = scene.object(name)
        base = scene.table_top - object_model(item.asset, item.params).bottom
        names = {o.name: o.asset for o in scene.objects} | {name: ""}
        plain = tuple(_named(call, names.__getitem__, -base) for call in calls)
        kind = (item.asset, item.pose.position[0] > 0)
        found.append(Habit(kind, plain, tuple(map(_rounded, plain))))
    return found


def _named(call: Skill, name: Callable[[str], str], rise: float) -> Skill:
    """`call` with other names of objects, and places on the table `rise` [m] higher."""
    changes: dict[str, Any] = {
        key: name(value)
        for key in ("object", "tool", "on", "into")
        if isinstance(value := getattr(call, key, None), str)
    }
    if isinstance(call, Hit):
        changes["targets"] = tuple(name(target) for target in call.targets)
    if isinstance(call, Place) and call.on is None:
        x, y, z = call.position
        changes["position"] = (x, y, z + rise)
    return replace(call, **changes)


def _rounded(call: Skill) -> Skill:
    """What is the same place: equal to `CELL` in the plane, and to 1 cm above the table."""
    if not isinstance(call, Place):
        return call
    x, y, z = call.position
    return replace(call, position=(round(x / CELL), round(y / CELL), round(z, 2)))


def _bound(
    calls: tuple[Skill, ...],
    item: SceneObject,
    scene: Scene,
    ws: Workspace,
    done: Sequence[SceneObject],
) -> tuple[Skill, ...]:
    """`calls` about `item`: on or into the last thing handled if it is alike, else the nearest of
    that asset that these calls do not have yet; () where there is none."""
    here, used = ws.pose(item.name).position, {item.name}

    def name(asset: str) -> str:
        if not asset:
            return item.name
        if asset == item.asset:
            return [o.name for o in done if o.asset == asset][-1]
        alike = [o for o in scene.objects if o.asset == asset]
        free = [o for o in alike if o.name not in used] or alike
        nearest = min(free, key=lambda o: math.dist(ws.pose(o.name).position, here))
        used.add(nearest.name)
        return nearest.name

    base = scene.table_top - ws.models[item.name].bottom
    try:
        return tuple(_named(call, name, base) for call in calls)
    except (IndexError, ValueError):
        return ()


class Blind(Oracle):
    """The blind policy `name`; `salt` is the secret of hidden scenes."""

    def __init__(self, name: str, planner: Planner, salt: str = "") -> None:
        super().__init__(salt)
        self.spec = replace(Oracle.spec, name=name)
        self._planner = planner

    def _planned(self, scene: Scene, snapshot: Snapshot) -> Expert:
        return BlindExpert(scene, snapshot, self._planner)


create_tries_all = partial(Blind, "tries-all", tries_all)
create_presses_all = partial(Blind, "presses-all", presses_all)
create_commonest = partial(Blind, "commonest", commonest)
