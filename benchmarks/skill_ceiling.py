"""The ceiling of the action space "skill": the expert's plan said in calls, one answer for each.

A policy that knows the plan and sees what every pixel shows finds a pixel of each object that the
plan names, and says the call. What it solves is what skills can reach at all.

    python benchmarks/skill_ceiling.py [--seeds 1] [--names TASK,...] [--json]

Seeds are of a range that no list of accepted ones uses; those that the expert itself does not solve
do not count. `--json` also writes a line a variant to benchmarks/results/skill_ceiling.csv.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path
from statistics import fmean

import numpy as np
from frame import RESULTS, Figure, Json, Result, gather, main
from numpy.typing import NDArray

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose, Vec3
from robospa.harness.selection import parse_tasks
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.harness.world import TABLE, SceneUnstable
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks import plan
from robospa.tasks.catalog import LEVELS, build_scene, task
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel
from robospa.trial import TrialKey

HEAD = CameraSpec("head", 640, 480)
SPEC = PolicySpec("plan in calls", (HEAD,), "none", "skill", seeded=True, needs_trial_key=True)
FIRST_SEED = 700_000
Call = dict[str, object]


class PlainWorld(SapienWorld):
    """A world that draws no pictures for observations: nobody looks at them here."""

    def observe(self, spec: PolicySpec) -> Observation:
        return super().observe(replace(spec, cameras=()))


class NotSeen(Exception):
    """What a plan names is not in the picture."""


class PlanInCalls:
    """Says the plan of a trial in `world`, a call or a pick with its place at a time."""

    spec = SPEC

    def __init__(self, world: SapienWorld) -> None:
        self.world = world
        self.left: list[object] = []
        self.note = ""

    def reset(self, trial: TrialInfo) -> None:
        key = trial.key
        assert key is not None
        self.scene = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)
        self.left = list(task(key.task).plan(self.scene))
        self.note = ""

    def infer(self, observation: Observation) -> list[Call]:
        if not self.left:
            return [{"skill": "done"}]
        call = self.left.pop(0)
        group = [call]
        while self.left and (
            (isinstance(call, plan.Press) and self.left[0] == call)
            or (isinstance(call, plan.Pick) and isinstance(self.left[0], plan.Place | plan.Drop))
        ):
            group.append(self.left.pop(0))
            if not isinstance(call, plan.Press):
                break
        try:
            picture = Shown(self.world, self.scene)
            return [picture.said(one) for one in group]
        except NotSeen as error:
            self.note = str(error)
            return [{"skill": "done"}]


class Shown:
    """What the head camera shows now, and where its pixels are."""

    def __init__(self, world: SapienWorld, scene: Scene) -> None:
        self.scene, self.now = scene, world.snapshot()
        self.ids: NDArray[np.int16] = world.identify(HEAD)
        self.view = world.view(HEAD)
        self.names = [one.name for one in scene.everything]

    def said(self, call: object) -> Call:
        """`call` in points; raises NotSeen."""
        name = {"RaiseLower": "raise_lower"}.get(type(call).__name__, type(call).__name__.lower())
        found: Call = {"skill": name}
        arm = getattr(call, "arm", None)
        if arm is not None:
            found["arm"] = arm
        match call:
            case plan.Home():
                pass
            case plan.Wait():
                found["seconds"] = call.seconds
            case plan.Place():
                found |= self._place(call)
            case plan.Drop():
                found["at"] = self.point(call.into)
            case plan.Hit():
                found["at"] = self.point(call.tool)
                found["to"] = [self.point(one) for one in call.targets]
            case plan.Pour():
                found["at"], found["to"] = self.point(call.object), self.point(call.into)
            case plan.Stamp():
                found["at"], found["to"] = self.point(call.object), self.point(call.on)
                found["times"] = call.times
            case plan.Dock() | plan.Hang():
                found["at"], found["to"] = self.point(call.object), self.point(call.on)
            case plan.RaiseLower():
                found |= {"at": self.point(call.object), "times": call.times}
                found |= {"arms": list(call.arms), "lift": call.rise}
            case plan.Pick():
                found |= {"at": self.point(call.object), "lift": call.lift}
            case plan.Press() | plan.Open():
                found["at"] = self.point(call.object)
            case _:
                raise NotSeen(f"no call says {call}")
        return found

    def point(self, name: str) -> list[float]:
        """A point well within what is seen of an object."""
        return self._inside(self.ids == self.names.index(name), name)

    def _inside(self, shown: NDArray[np.bool_], name: str) -> list[float]:
        rows, columns = np.nonzero(shown)
        if not len(rows):
            raise NotSeen(f"{name} is not seen")
        away = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
        best = int(away.argmin())
        height, width = self.ids.shape
        return [(float(columns[best]) + 0.5) / width, (float(rows[best]) + 0.5) / height]

    def _place(self, call: plan.Place) -> Call:
        found: Call = {}
        if call.yaw is not None:
            w, _, _, z = self.now.poses[call.object].rotation
            turn = math.degrees(call.yaw - 2 * math.atan2(z, w))
            found["turn"] = (turn + 180) % 360 - 180
        if call.drop != plan.Place.drop:
            found["height"] = call.drop
        model = self._model(call.object)
        if call.on is not None:
            found["at"] = self.point(call.on)
            if any(call.position[:2]):
                top = self._support(call.on)
                found["offset"] = list(np.subtract(top.apply(call.position), top.position)[:2])
            return found
        where = call.position
        if where[2] + model.bottom - self.scene.table_top > 0.004:  # on a thing, off its middle
            below = min(
                (n for n in self.names if n != call.object and n in self.now.poses),
                key=lambda n: math.dist(where[:2], self._support(n).position[:2]),
            )
            offset = np.subtract(where, self._support(below).position)[:2]
            return {**found, "at": self.point(below), "offset": offset.tolist()}
        seen = self.view.pixel((where[0], where[1], self.scene.table_top))
        height, width = self.ids.shape
        if seen is not None and 0 <= seen[0] < 1 and 0 <= seen[1] < 1:
            shown = self.ids[int(seen[1] * height), int(seen[0] * width)]
            if shown == TABLE:
                return {**found, "at": list(seen)}
        return {**found, **self._beside(where)}

    def _beside(self, where: Vec3) -> Call:
        """The table's point seen nearest to one that is not, and the way from there."""
        height, width = self.ids.shape
        best: tuple[float, list[float], list[float]] | None = None
        rows, columns = np.nonzero(self.ids[::4, ::4] == TABLE)
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            u, v = (4 * column + 0.5) / width, (4 * row + 0.5) / height
            spot = self.view.onto(u, v, self.scene.table_top)
            if spot is not None:
                off = [where[0] - spot[0], where[1] - spot[1]]
                if best is None or math.hypot(*off) < best[0]:
                    best = math.hypot(*off), [u, v], off
        if best is None:
            raise NotSeen("the table is not seen")
        return {"at": best[1], "offset": best[2]}

    def _model(self, name: str) -> ObjectModel:
        item = self.scene.object(name)
        return object_model(item.asset, item.params)

    def _support(self, name: str) -> Pose:
        return self.now.poses[name] * self._model(name).frames["support"]


@cache
def plain_world() -> PlainWorld:
    """One in a process."""
    return PlainWorld()


def in_calls(name: str, level: int, seed: int) -> Json:
    """What came of one trial; a seed whose scene is not stable is told as such."""
    world, key = plain_world(), TrialKey(name, level, seed)
    policy = PlanInCalls(world)
    try:
        record = run_trial(world, policy, key, policy_seed=0)
    except (SceneUnstable, ValueError) as error:
        return {"end": f"unstable: {error}"}
    calls = record.diagnostics.get("calls", [])
    end = record.end
    if end != "success" and not run_trial(world, Oracle(), key, policy_seed=0).success:
        end = "expert fails, too"  # so no list of accepted seeds would have it
    return {
        "end": end,
        "message": record.message,
        "steps": record.steps,
        "calls": len(calls),
        "seconds": round(record.wall_time, 1),
        "note": policy.note,
        "failed": [(one["skill"], one["feedback"]) for one in calls if one["feedback"] != "done"],
    }


def measure(seeds: int = 1, workers: int = 2, names: str = "all,basic") -> Result:
    """`seeds` of every variant of the tasks that `names` names."""
    tasks = parse_tasks(names)
    jobs = [(name, n, FIRST_SEED + k) for k in range(seeds) for name in tasks for n in LEVELS]
    variants = defaultdict(list)
    for row in gather(Path("build/skill_ceiling.jsonl"), jobs, in_calls, workers):
        if row.end.split()[0] not in ("unstable:", "expert"):
            variants[row.job[:2]].append(row)
    lines, missed, solved = ["task,level,trials,solved,actions,calls"], [], 0
    for (name, level), some in sorted(variants.items()):
        good = sum(row.end == "success" for row in some)
        means = (round(fmean(getattr(row, what) for row in some), 1) for what in ("steps", "calls"))
        lines.append(",".join(map(str, (name, level, len(some), good, *means))))
        missed += [f"{name} {level}: {good} of {len(some)}"] if good < len(some) else []
        solved += good
    what, trials = "trials that the expert's plan solves in calls", sum(map(len, variants.values()))
    figures = [Figure(what, solved, f"of {trials}", note="; ".join(missed))]
    table = {RESULTS / "skill_ceiling.csv": "\n".join(lines) + "\n"}
    return Result("What skills can reach", figures, files=table)


if __name__ == "__main__":
    main(skill_ceiling=measure)
