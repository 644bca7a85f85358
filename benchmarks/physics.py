"""Physics: the trial loop of `SapienWorld` against bare SAPIEN stepping of the same scene.

    python benchmarks/physics.py [--blocks 8] [--actions 40] [--rounds 5] [--json]

Both sides start from the same scene and write the same drive targets in the same physics steps, so
they must end in the same state to the bit (checked). "bare" is the loop one would write by hand:
set the targets, step. "trial", and "contacts" with contacts gathered, include reading the action,
planning, and a poll with a snapshot at 50 Hz. They take turns action by action, and of every action
the fastest round counts, in CPU time, so that other load on the machine does not decide.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from frame import Figure, Result, main
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.sim.motion import RATE, rest_to_rest
from robospa.harness.sim.physics import Setter
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot
from robospa.workcell import TABLE_TOP

Steps = Callable[[], int]


def table_of_blocks(count: int) -> Scene:
    """Blocks of several sizes in two rows."""
    rng = np.random.default_rng(7)
    objects = []
    for i in range(count):
        half = [float(h) for h in rng.uniform(0.012, 0.03, 3)]
        place = (-0.35 + 0.7 * (i // 2) / max(1, (count - 1) // 2), -0.15 + 0.2 * (i % 2))
        pose = Pose((*place, TABLE_TOP + half[2]))
        params = {"half": half, "color": [0.7, 0.2, 0.1]}
        objects.append(SceneObject(f"block {i}", "block", pose, params))
    return Scene("Benchmark", 1, 0, "aloha-agilex", "clean", tuple(objects), {})


def sweeping(count: int) -> list[NDArray[np.float32]]:
    """Actions that move all joints and grippers above the table."""
    rng = np.random.default_rng(11)
    low = np.array([-0.4, 1.2, 1.0, -1.0, -0.4, -0.4, 0.0])
    high = np.array([0.4, 1.9, 1.8, 0.3, 0.4, 0.4, 1.0])
    return [
        np.concatenate([rng.uniform(low, high), rng.uniform(low, high)]).astype(np.float32)
        for _ in range(count)
    ]


def watch(snapshot: Snapshot) -> bool:
    """A goal that looks at every object's height, as the pick goals do."""
    return any(snapshot.height(name) > 2.0 for name in snapshot.poses)


def trial_loop(world: SapienWorld, actions: list[NDArray[np.float32]]) -> list[Steps]:
    """One call per action: the world's own loop."""

    def run(action: NDArray[np.float32]) -> int:
        return world.step(action, "joint", watch).physics_steps

    return [partial(run, action) for action in actions]


def hand_written(world: SapienWorld, actions: list[NDArray[np.float32]]) -> list[Steps]:
    """The same motions as a plain loop over SAPIEN's calls, all targets computed beforehand."""
    drives, system = world._drives, world._loaded().system
    tables = []
    for action in actions:
        goals = world._decoder.decode(action, "joint", drives.joints)
        plan = rest_to_rest(
            drives.joints, goals.joints, drives.gripper, goals.gripper, drives.opening
        )
        setters, table = drives.schedule(plan)
        tables.append((setters, table.tolist()))
        drives.now = (plan, len(plan) - 1)

    def run(setters: list[Setter], rows: list[list[float]]) -> int:
        for row in rows:
            for i in range(len(setters)):
                setters[i](row[i])
            system.step()
        return len(rows)

    return [partial(run, *table) for table in tables]


def turns(sides: dict[str, list[Steps]]) -> tuple[dict[str, list[float]], int]:
    """CPU time [s] of every call of every side, and the physics steps that one side took."""
    spent: dict[str, list[float]] = {name: [] for name in sides}
    steps = dict.fromkeys(sides, 0)
    for calls in zip(*sides.values(), strict=True):
        for name, call in zip(sides, calls, strict=True):
            began = time.thread_time()
            steps[name] += call()
            spent[name].append(time.thread_time() - began)
    return spent, min(steps.values())


def measure(blocks: int = 8, actions: int = 40, rounds: int = 5) -> Result:
    """All figures of one run."""
    scene, plan = table_of_blocks(blocks), sweeping(actions)
    worlds = {name: SapienWorld(render=False) for name in ("bare", "trial", "contacts")}
    costs: list[dict[str, list[float]]] = []
    digests: set[str] = set()
    steps = 0
    for _ in range(rounds):
        for name, world in worlds.items():
            world.load(scene, contacts=name == "contacts")
        loops = {
            name: (hand_written if name == "bare" else trial_loop)(world, plan)
            for name, world in worlds.items()
        }
        cost, steps = turns(loops)
        digests |= {world.digest() for world in worlds.values()}
        costs.append(cost)
    best = {
        name: sum(min(c[name][i] for c in costs) for i in range(actions)) / steps * 1e6
        for name in worlds
    }
    rate = 1e6 / best["trial"]
    figures = [
        Figure("trial loop beside bare SAPIEN stepping with the same drive targets",
            round(best["trial"] / best["bare"], 3), "x", at_most=1.15,
            note=f"{rate:,.0f} steps/s, {rate / RATE:.0f} x real"),
        Figure("the same with contacts gathered for the goal",
            round(best["contacts"] / best["bare"], 3), "x"),
        Figure("trial loop, a physics step", round(best["trial"], 1), "us"),
        Figure("bare stepping, a physics step", round(best["bare"], 1), "us"),
        Figure("different final states of the sides", len(digests) - 1, at_most=0,
            note="poses, velocities and joints, to the bit"),
    ]  # fmt: skip
    return Result(
        "Physics in the trial loop",
        figures,
        text="""\
Both sides write the same drive targets for all joints of both arms in the same steps. The trial
loop also reads the action, computes its trajectory, and takes 50 snapshots a simulated second for a
goal that looks at every object's height.""",
        circumstances=f"{blocks} blocks, {steps} steps, fastest of {rounds} rounds, CPU time",
    )


if __name__ == "__main__":
    main(physics=measure)
