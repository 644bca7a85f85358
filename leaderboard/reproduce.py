"""Level 3, *reproduced*: hidden seeds run against the submitter's server, held against the bundle.

The server has to be what the bundle says: same spec, same settings. All outcomes together and those
of every category are tested exactly (`robospa.leaderboard.agreement`); categories are corrected for
being several. Passing means that the claim was not contradicted, so the power is always stated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robospa.harness.running.evaluate import Request
from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.policy_probe import probe_policies
from robospa.leaderboard.agreement import Agreement, Counts, agreement, holm, power
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.hidden_seeds import Block
from robospa.leaderboard.reference import Reference
from robospa.leaderboard.verify import Valid
from robospa.results.records.run_io import Run
from robospa.trial import TrialKey

DROPS = (0.02, 0.05, 0.1)
"""Losses of success for which the power is stated."""


@dataclass(frozen=True)
class Reproduction:
    """Fresh trials against claimed ones: by variant, over all, and by category with Holm's p."""

    variants: Mapping[tuple[str, int], Counts]
    overall: Agreement
    categories: Mapping[str, tuple[Agreement, float]]
    alpha: float
    commitment: str
    noticed: Mapping[float, float]

    @property
    def holds(self) -> bool:
        """Whether neither the whole nor a category contradicts the claim at level `alpha`."""
        least = min((p for _, p in self.categories.values()), default=1.0)
        return self.overall.p >= self.alpha and least >= self.alpha

    def sentences(self) -> list[str]:
        """What this shows and what it does not, for people."""
        claimed = sum(c.claimed / c.claimed_trials * c.fresh_trials for c in self.variants.values())
        trials = sum(c.fresh_trials for c in self.variants.values())
        said = [
            f"{self.overall.fresh} of {trials} fresh trials succeeded where the claim leads one to "
            f"expect {claimed:.1f} (exact test over {len(self.variants)} variants, two-sided "
            f"p = {self.overall.p:.3g})."
        ]
        for category, (_, p) in self.categories.items():
            if p < self.alpha:
                said.append(f"{category} contradicts the claim (p = {p:.3g} after Holm).")
        chances = ", ".join(f"{100 * d:g} points {100 * p:.0f} %" for d, p in self.noticed.items())
        said.append(f"Chance to notice rates that are lower everywhere by: {chances}.")
        return said

    def to_json(self) -> dict[str, Any]:
        """The evidence for the badge."""

        def test(found: Agreement) -> dict[str, float]:
            return {"fresh": found.fresh, "expected": found.expected, "p": found.p}

        return {
            "commitment": self.commitment,
            "alpha": self.alpha,
            "overall": test(self.overall),
            "categories": {
                name: {**test(found), "p_holm": p} for name, (found, p) in self.categories.items()
            },
            "variants": {
                f"{task}/{level}": [c.claimed, c.claimed_trials, c.fresh, c.fresh_trials]
                for (task, level), c in self.variants.items()
            },
            "power": {f"{drop:g}": chance for drop, chance in self.noticed.items()},
        }


def hidden_keys(valid: Valid, block: Block, reference: Reference) -> list[TrialKey]:
    """The trials of a block under the bundle's settings; BundleError if they do not fit it."""
    there = {key.variant for key in valid.keys}
    model = valid.keys[0]
    keys = []
    for (task, level), seeds in block.seeds.items():
        if (task, level) not in there:
            raise BundleError(f"the block has {task} level {level}, which the bundle has not")
        if shown := set(seeds) & set(reference.seeds(task, level)):
            raise BundleError(f"seed {min(shown)} of {task} level {level} is not hidden")
        keys += [TrialKey(task, level, s, model.embodiment, model.mode, model.split) for s in seeds]
    return keys


def check_policy(valid: Valid, request: Request) -> None:
    """BundleError unless the server says of itself what it said when the bundle was made."""
    settings = valid.run.manifest["settings"]
    for task, policy in probe_policies(request.config, request.keys, request.wait).items():
        recorded = (settings.get("policies") or {}).get(task) or settings["policy"]
        before, now = dict(recorded["spec"]), policy.spec.to_json()
        if changes := changed_settings(before, now):
            raise BundleError(
                f"the server for {task} is not the one of the bundle: {'; '.join(changes[:3])}"
            )


def compare(
    valid: Valid, fresh: Run, keys: Sequence[TrialKey], block: Block, alpha: float = 0.01
) -> Reproduction:
    """Hold the run on the hidden trials `keys` against the bundle.

    Raises BundleError if the run lacks any of them or has others.
    """
    if set(fresh.keys) != set(keys) or fresh.missing:
        raise BundleError(
            f"the run on the hidden seeds is not complete: {len(fresh.missing)} of {len(keys)} "
            "trials are missing; go on with --resume"
        )
    variants: dict[tuple[str, int], Counts] = {}
    categories: dict[str, list[Counts]] = {}
    for variant in block.seeds:
        claims = [r for k, r in valid.run.records.items() if k.variant == variant]
        made = [fresh.records[k] for k in keys if k.variant == variant]
        counts = Counts(
            sum(r.success for r in claims), len(claims), sum(r.success for r in made), len(made)
        )
        variants[variant] = counts
        categories.setdefault(claims[0].category, []).append(counts)
    tests = {name: agreement(found) for name, found in categories.items()}
    corrected = dict(zip(tests, holm([found.p for found in tests.values()]), strict=True))
    everything = list(variants.values())
    return Reproduction(
        variants,
        agreement(everything),
        {name: (found, corrected[name]) for name, found in tests.items()},
        alpha,
        block.commitment,
        {drop: power(everything, drop, alpha) for drop in DROPS},
    )
