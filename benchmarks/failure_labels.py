"""Accuracy of failure types: scripted mistakes in the simulator, labelled from their records.

    python benchmarks/failure_labels.py [--seeds 3] [--names TASK,...] [--json]

Every kind of mistake (`robospa.baselines.oracle`) runs on every task that gives occasion
for it. A trial counts only if it failed and no skill of the expert that acts it out failed. Nothing
is drawn. Trials end some actions after the script is over instead of at the task's limit, which
changes no label and saves the time of standing still.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

from frame import Figure, Result, main

from robospa.baselines.oracle import FailingOracle
from robospa.harness.selection import parse_tasks
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.results.failures.labels import NAMES, label
from robospa.tasks.catalog import task
from robospa.trial import TrialKey

FIRST_SEED = 920_000
LEVELS = {"spatial": (2, 3, 5), "procedural": (1, 2, 3, 5)}
EXPECTED = {
    "spatial": {
        "neighbour": "target_grounding",
        "beside": "no_contact_grasp",
        "drops": "target_execution",
        "hovers": "target_execution",
        "nothing": "no_attempt",
    },
    "procedural": {
        "beside": "manipulation",
        "drops": "manipulation",
        "repeats": "redundant_repetition",
        "stops": "no_attempt",
        "nothing": "no_attempt",
        "swaps": "temporal_ordering",
        "forgets": "memory",
        "hasty": "temporal_ordering",
    },
}
"""The label that each mistake should get."""


def parts(key: TrialKey) -> TrialSetup:
    """The trial's parts with a limit that lies shortly after the script's end."""
    found = task_parts(key)
    level = found.task.levels[key.level]
    short = replace(level, steps=min(level.steps, 40 + 40 * level.subtasks))
    return replace(found, task=replace(found.task, levels={**found.task.levels, key.level: short}))


def found_label(world: SapienWorld, kind: str, key: TrialKey) -> str | None:
    """The label of one scripted trial; "" if the script did not come off, None without occasion."""
    policy = FailingOracle(kind)
    record = run_trial(world, policy, key, policy_seed=0, parts=parts)
    if not policy.applies:
        return None
    if record.success or policy.failures:
        return ""
    failure = label(record)
    return failure.kind if failure else "none"


def measure(seeds: int = 3, names: str = "spatial,procedural") -> Result:
    """All mistakes of the tasks that `names` names."""
    world = SapienWorld(render=False)
    right, counted, idle = Counter[str](), Counter[str](), 0
    wrong = []
    for name in parse_tasks(names):
        dimension = task(name).dimension
        for kind, expected in EXPECTED[dimension].items():
            for level in LEVELS[dimension]:
                for seed in range(FIRST_SEED, FIRST_SEED + seeds):
                    found = found_label(world, kind, TrialKey(name, level, seed))
                    idle += found == ""
                    counted[expected] += bool(found)
                    right[expected] += found == expected
                    if found and found != expected:
                        wrong.append(f"{name} {kind} L{level} seed {seed}: {found}")
                        print(wrong[-1], file=sys.stderr, flush=True)
    world.close()
    total, good = counted.total(), right.total()
    figures = [
        Figure("labelled as scripted", round(100 * good / total, 2), "%", at_least=95,
            note=f"{good} of {total}; {idle} scripts did not come off")
    ]  # fmt: skip
    figures += [
        Figure(NAMES[kind], round(100 * right[kind] / count, 1), "%",
            note=f"{right[kind]} of {count}")
        for kind, count in counted.items()
        if count
    ]  # fmt: skip
    text = "Every kind of mistake on every task that gives occasion for it."
    return Result("Failure types of scripted mistakes", figures, text, data={"wrong": wrong})


if __name__ == "__main__":
    main(failure_labels=measure)
