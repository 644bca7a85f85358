"""Accuracy of failure types: scripted mistakes in the simulator, labelled from their records.

    python benchmarks/failure_labels.py [--seeds 3] [--tasks NAME,...] [--json]

Every kind of mistake (`robospa.baselines.failure_policies`) runs on every task that gives occasion
for it. A trial counts only if it failed and no skill of the expert that acts it out failed. Nothing
is drawn. Trials end some actions after the script is over instead of at the task's limit, which
changes no label and saves the time of standing still.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field, replace

from common import Metric, Result, argument_parser, finish

from robospa.baselines.failure_policies import create
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialParts, run_trial, task_parts
from robospa.results.failures.labels import NAMES, label
from robospa.tasks.catalog import tasks
from robospa.trial import TrialKey

FIRST_SEED = 920_000
LEVELS = {"spatial": (2, 3, 5), "procedural": (1, 2, 3, 5)}
SPATIAL = {
    "neighbour": "target_grounding",
    "beside": "no_contact_grasp",
    "drops": "target_execution",
    "hovers": "target_execution",
    "nothing": "no_attempt",
}
PROCEDURAL = {
    "beside": "manipulation",
    "drops": "manipulation",
    "repeats": "redundant_repetition",
    "stops": "no_attempt",
    "nothing": "no_attempt",
    "swaps": "temporal_ordering",
    "forgets": "memory",
    "hasty": "temporal_ordering",
}
"""The label that each mistake should get."""


@dataclass
class LabelledFailure:
    """One mistake on one task."""

    task: str
    kind: str
    expected: str
    found: Counter[str] = field(default_factory=Counter)
    not_acted: int = 0
    wrong: list[str] = field(default_factory=list)

    @property
    def counted(self) -> int:
        """Trials in which the script came off."""
        return sum(self.found.values())

    @property
    def right(self) -> int:
        """Trials labelled as scripted."""
        return self.found[self.expected]


def parts(key: TrialKey) -> TrialParts:
    """The trial's parts with a limit that lies shortly after the script's end."""
    found = task_parts(key)
    level = found.task.levels[key.level]
    short = replace(level, steps=min(level.steps, 40 + 40 * level.subtasks))
    return replace(found, task=replace(found.task, levels={**found.task.levels, key.level: short}))


def measure(world: SapienWorld, row: LabelledFailure, level: int, seed: int) -> None:
    """Run one trial and note its label."""
    policy = create(row.kind)
    key = TrialKey(row.task, level, seed)
    record = run_trial(world, policy, key, policy_seed=0, parts=parts)
    if not policy.applies:
        return
    if record.success or policy.failures:
        row.not_acted += 1
        return
    failure = label(record)
    kind = failure.kind if failure else "none"
    row.found[kind] += 1
    if failure and kind != row.expected:
        row.wrong.append(f"L{level} seed {seed}: {kind}, {failure.evidence}")


def rows(names: list[str], seeds: int) -> list[LabelledFailure]:
    """All measured rows that had an occasion."""
    world = SapienWorld(render=False)
    found = []
    for name in names:
        task = tasks()[name]
        for kind, expected in (SPATIAL if task.dimension == "spatial" else PROCEDURAL).items():
            row = LabelledFailure(name, kind, expected)
            for level in LEVELS[task.dimension]:
                for i in range(seeds):
                    measure(world, row, level, FIRST_SEED + i)
            if row.counted or row.not_acted:
                found.append(row)
                print(f"{name} {kind}: {row.right} of {row.counted}", *row.wrong, sep="\n  ")
    world.close()
    return found


def table(found: list[LabelledFailure]) -> str:
    """The result as Markdown."""
    lines = [
        "| task | mistake | should be | labelled so | otherwise | not acted out |",
        "|---|---|---|---|---|---|",
    ]
    for row in found:
        other = ", ".join(
            f"{count} {NAMES.get(kind, kind)}"
            for kind, count in row.found.items()
            if kind != row.expected
        )
        score = f"{row.right} of {row.counted}"
        should = NAMES[row.expected]
        lines.append(
            f"| {row.task} | {row.kind} | {should} | {score} | {other} | {row.not_acted} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="seeds a mistake, task and level")
    parser.add_argument("--tasks", default=",".join(tasks()))
    options = parser.parse_args()
    began = time.perf_counter()
    found = rows(options.tasks.split(","), options.seeds)
    counted, right = sum(r.counted for r in found), sum(r.right for r in found)
    by_label: dict[str, dict[str, int]] = {}
    for row in found:
        cell = by_label.setdefault(row.expected, {"right": 0, "of": 0})
        cell["right"] += row.right
        cell["of"] += row.counted
    print(table(found))
    idle = sum(r.not_acted for r in found)
    figures = [
        Metric("labelled as scripted", round(100 * right / counted, 2), "%", at_least=95,
            note=f"{right} of {counted}; {idle} scripts did not come off")
    ]  # fmt: skip
    figures += [
        Metric(NAMES[kind], round(100 * cell["right"] / max(1, cell["of"]), 1), "%",
            note=f"{cell['right']} of {cell['of']}")
        for kind, cell in by_label.items()
    ]  # fmt: skip
    wrong = [f"{r.task} {r.kind} {text}" for r in found for text in r.wrong]
    result = Result(
        "failure_labels",
        "Failure types of scripted mistakes",
        tuple(figures),
        text="Every kind of mistake on every task that gives occasion for it.",
        circumstances=f"{time.perf_counter() - began:.0f} s",
        data={"wrong": wrong},
    )
    finish(result, options)


if __name__ == "__main__":
    main()
