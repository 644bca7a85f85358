"""How often a lie about one variant is noticed on hidden scenes, and an honest claim refused.

    python tools/lie_power.py [--draws 1000] [--trials 7,13]

All 280 variants with 100 claimed trials each, at one honest rate of success at the first choice and
of success (half of the failures at the first choice succeed later). The lie: one variant is claimed
at 100 of 100 and never succeeds. `before`: the tests of everything and of categories alone.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from robospa.leaderboard.agreement import Counts, agreement, contradictions, holm
from robospa.tasks.catalog import tasks
from robospa.trial import CATEGORIES

ALPHA, CLAIMED = 0.01, 100


def drawn(random: np.random.Generator, names: list[str], rate: float, fresh: int, lie: str | None):
    """Counts by metric and variant of one entry; `lie` is a variant that never succeeds."""
    metrics: dict[str, dict[str, Counts]] = {"sr": {}, "sr1": {}}
    for name in names:
        good, again = ((random.random(n) < rate) for n in (CLAIMED, fresh))
        late, relate = ((random.random(n) < 0.5) for n in (CLAIMED, fresh))
        for metric, one, two in (("sr1", good, again), ("sr", good | late, again | relate)):
            counts = Counts(int(one.sum()), CLAIMED, int(two.sum()), fresh)
            lied = replace(counts, claimed=CLAIMED, fresh=0) if name == lie else counts
            metrics[metric][name] = lied
    return metrics


def before(counts: dict[str, Counts], categories: dict[str, str]) -> bool:
    """Whether the claim was refused when only everything and categories were tested."""
    groups: dict[str, list[Counts]] = {}
    for name, found in counts.items():
        groups.setdefault(categories[name.rpartition("/")[0]], []).append(found)
    parts = holm([agreement(found).p for found in groups.values()])
    return min(agreement(counts.values()).p, *parts) < ALPHA


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("--trials", default="7,13")
    asked = parser.parse_args()
    found = {task.name: task.category for task in tasks().values() if task.category in CATEGORIES}
    names = [f"{task}/{level}" for task in found for level in range(1, 6)]
    print(f"{len(names)} variants\n| hidden trials | rate | honest refused before | now "
          "| lie noticed before | now |\n|---|---|---|---|---|---|")  # fmt: skip
    for fresh in map(int, asked.trials.split(",")):
        for rate in (0.3, 0.6, 0.9):
            random = np.random.default_rng(0)
            refused = np.zeros(4, int)
            for number in range(asked.draws):
                for place, lie in enumerate((None, names[number % len(names)])):
                    metrics = drawn(random, names, rate, fresh, lie)
                    refused[2 * place] += before(metrics["sr"], found)
                    refused[2 * place + 1] += bool(contradictions(metrics, found, ALPHA))
            shares = " | ".join(f"{100 * x / asked.draws:.1f} %" for x in refused)
            print(f"| {fresh} | {rate:.0%} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
