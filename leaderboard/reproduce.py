"""Level 3, *reproduced*: hidden scenes run against the submitter's server, held against the bundle.

The server has to be what the bundle says: same spec, same settings. All outcomes together and those
of every category are tested exactly (`robospa.leaderboard.agreement`); categories are corrected for
being several. A fresh trial that was repeated counts as a failure: the policy may have broken off
the attempts that went badly. Passing means that the claim was not contradicted, which is worth a
badge only if a lie of five points would have been noticed.

A block of hidden scenes is fixed before a submitter can see them, and provably not chosen
afterwards: a JSON file of a random salt and fresh seeds. The salt enters every random draw of
scenes and sentences (`robospa.tasks.catalog.build_scene`), so nobody can draw them who has only the
seeds. The block's hash, the commitment, is published first; the block itself when the trials are
over. Refused: a block that does not hash to the commitment, that has seeds of the shipped range, or
that gives a seed twice.
"""

from __future__ import annotations

import json
import re
import secrets
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.evaluate import Request
from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.policy_probe import probe_policies
from robospa.harness.seeds.attempt import expert_pool
from robospa.harness.trial import salt_hash
from robospa.leaderboard.agreement import (
    LEAST_POWER,
    LIE,
    Counts,
    agreement,
    holm,
    power,
    trials_needed,
)
from robospa.leaderboard.bundle import MEGA, BundleError, canonical, sha256
from robospa.leaderboard.evidence import CategoryTest, OverallTest, Reproduction
from robospa.leaderboard.rules import Reference
from robospa.leaderboard.untrusted import parse_map
from robospa.leaderboard.verify import Valid
from robospa.results.records.runs import Run
from robospa.results.scoring.repeats import was_repeated, with_repeated_failed
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey
from robospa.trial import REFERENCE, TrialKey

FORMAT = 2
"""In format 1 the salt did not enter the scenes."""
FIRST, LAST = 10**9, 2**53
"""Hidden seeds lie here: far from the shipped ones, and exact in any JSON reader."""
SALT = 32
"""Bytes of the salt."""
FIELDS = {"format", "suite", "salt", "seeds"}
PLACE = re.compile(r"([A-Za-z0-9_]{1,64})/([1-5])")
MOST = 100_000


@dataclass(frozen=True)
class Block:
    """Hidden seeds by (task, level)."""

    seeds: dict[tuple[str, int], tuple[int, ...]]
    salt: str
    suite: str = SUITE

    def to_json(self) -> dict[str, object]:
        """Plain JSON values."""
        lists = {f"{task}/{level}": list(found) for (task, level), found in self.seeds.items()}
        return {"format": FORMAT, "suite": self.suite, "salt": self.salt, "seeds": lists}

    @property
    def commitment(self) -> str:
        """The hash to publish before the block."""
        return sha256(canonical(self.to_json()))


def draw_block(
    variants: Sequence[tuple[str, int]],
    count: int,
    workers: int = 1,
    note: Callable[[str], None] = lambda text: None,
    embodiment: str = REFERENCE,
    mode: str = "clean",
) -> Block:
    """`count` fresh seeds for each of `variants` whose scenes settle and that the expert solves
    with the robot and in the scene mode of the bundle.

    Raises BundleError for a `count` below 1, and if the expert solves fewer than half of what is
    drawn.
    """
    if count < 1:
        raise BundleError(f"a block of {count} trials a variant shows nothing; draw at least 1")
    seeds: dict[tuple[str, int], tuple[int, ...]] = {}
    salt = secrets.token_hex(SALT)
    with expert_pool(workers, salt) as pool:
        for task, level in variants:
            found: list[int] = []
            tried = 0
            while len(found) < count:
                if tried > 2 * count + 10:
                    raise BundleError(f"the expert does not solve {task} level {level}")
                wanted = [_fresh() for _ in range(count - len(found))]
                tried += len(wanted)
                key = ListKey(task, level, embodiment, mode)
                futures = [pool.submit((key, seed)) for seed in wanted]
                attempts = [future.result() for future in futures]
                found += [item.seed for item in attempts if item.accepted]
            seeds[task, level] = tuple(sorted(set(found)))
            note(f"{task} level {level}: {len(found)} of {tried} seeds accepted")
    return Block(seeds, salt)


def _fresh() -> int:
    return FIRST + secrets.randbelow(LAST - FIRST)


def write_block(block: Block, path: Path) -> None:
    """Write `block` to a new file."""
    if path.exists():
        raise BundleError(f"{path} is already there; a block is never written over")
    replace_file(path, (json.dumps(block.to_json(), indent=1) + "\n").encode())


def read_block(path: Path, commitment: str) -> Block:
    """The block in `path`, if it is the one that `commitment` was published for."""
    try:
        if path.stat().st_size > 16 * MEGA:
            raise BundleError(f"{path} is larger than a block of seeds can be")
        data = parse_map(path.read_bytes(), path.name)
    except OSError as error:
        raise BundleError(f"the block {path} cannot be read: {error.strerror}") from None
    version = data.get("format")
    if type(version) is not int or version != FORMAT or set(data) != FIELDS:
        raise BundleError(f"{path.name} is no block of hidden seeds of format {FORMAT}")
    if sha256(canonical(data)) != commitment.strip().lower():
        raise BundleError(
            f"{path.name} is not the block that was committed to: its hash is "
            f"{sha256(canonical(data))}, not {commitment.strip()[:64]}"
        )
    salt, lists = data["salt"], data["seeds"]
    if not isinstance(salt, str) or not re.fullmatch(rf"[0-9a-f]{{{2 * SALT}}}", salt):
        raise BundleError(f"{path.name} has no salt of {SALT} bytes")
    if data["suite"] != SUITE:
        raise BundleError(f"{path.name} is of another suite than {SUITE!r}")
    return Block(_seeds(lists, path.name), salt)


def _seeds(lists: object, what: str) -> dict[tuple[str, int], tuple[int, ...]]:
    if not isinstance(lists, dict) or not lists:
        raise BundleError(f"{what} has no seeds")
    seeds: dict[tuple[str, int], tuple[int, ...]] = {}
    for place, found in lists.items():
        match = PLACE.fullmatch(place)
        if not match or not isinstance(found, list) or not found:
            raise BundleError(f"{what} has no list of seeds under {place[:80]!a}")
        if not all(type(seed) is int and FIRST <= seed < LAST for seed in found):
            raise BundleError(f"{what}, {place}: hidden seeds lie from {FIRST} to {LAST}")
        if len(set(found)) < len(found):
            raise BundleError(f"{what}, {place}: a seed is there twice")
        seeds[match[1], int(match[2])] = tuple(found)
    if sum(map(len, seeds.values())) > MOST:
        raise BundleError(f"{what} has more than {MOST} seeds")
    return seeds


MOST_ALPHA = 0.1
DROPS = (0.02, LIE, 0.1)
"""Losses of success for which the power is stated."""


def claims_of(valid: Valid) -> dict[tuple[str, int], Counts]:
    """What the bundle claims of each of its variants, without fresh trials."""
    found: dict[tuple[str, int], list[bool]] = {}
    for key, record in valid.run.records.items():
        found.setdefault(key.variant, []).append(record.success)
    return {variant: Counts(sum(made), len(made), 0, 0) for variant, made in found.items()}


def plan(valid: Valid, trials: int | None, alpha: float = 0.01) -> int:
    """How many hidden trials of every variant a block for the bundle has: `trials`, or as few as a
    badge needs. BundleError for fewer than that, unless the bundle is for practice.
    """
    claims = list(claims_of(valid).values())
    if not 0 < alpha <= MOST_ALPHA:
        raise BundleError(f"a test at the level {alpha:g} is none; choose at most {MOST_ALPHA:g}")
    if valid.manifest.practice and trials is not None and trials > 0:
        return trials
    needed = trials_needed(claims, alpha)
    if needed is None:
        raise BundleError(
            f"no block earns this bundle a badge: with {sum(c.claimed_trials for c in claims)} "
            f"trials its own rates are too uncertain to notice a lie of {100 * LIE:g} points"
        )
    if trials is not None and trials < needed:
        raise BundleError(
            f"{trials} hidden trials a variant are too few: {needed} notice a lie of "
            f"{100 * LIE:g} points with {100 * LEAST_POWER:g} %"
        )
    return trials or needed


def hidden_keys(valid: Valid, block: Block, reference: Reference) -> list[TrialKey]:
    """The trials of a block under the bundle's settings; BundleError if they do not fit it."""
    there = {key.variant for key in valid.keys}
    if lacking := sorted(there - set(block.seeds)):
        raise BundleError(
            f"the block lacks {lacking[0][0]} level {lacking[0][1]} of the bundle; draw one for it"
        )
    model = valid.keys[0]
    keys = []
    for (task, level), seeds in block.seeds.items():
        if (task, level) not in there:
            raise BundleError(f"the block has {task} level {level}, which the bundle has not")
        listed = reference.seeds(task, level, model.embodiment, model.mode)
        if shown := set(seeds) & set(listed):
            raise BundleError(f"seed {min(shown)} of {task} level {level} is not hidden")
        keys += [TrialKey(task, level, s, model.embodiment, model.mode, model.split) for s in seeds]
    return keys


def check_policy(valid: Valid, request: Request) -> None:
    """BundleError unless the server says of itself what it said when the bundle was made."""
    settings = valid.run.manifest.settings
    for task, policy in probe_policies(request.config, request.keys, request.wait).items():
        recorded = settings.policies.get(task, settings.policy)
        before, now = recorded.spec, policy.spec.to_json()
        if changes := changed_settings(before, now):
            raise BundleError(
                f"the server for {task} is not the one of the bundle: {'; '.join(changes[:3])}"
            )


def compare(
    valid: Valid, fresh: Run, keys: Sequence[TrialKey], block: Block, alpha: float = 0.01
) -> Reproduction:
    """Hold the run on the hidden trials `keys` against the bundle.

    Raises BundleError if the run lacks any of them, has others, or was made without the salt.
    """
    if fresh.manifest.settings.salt_sha256 != salt_hash(block.salt):
        raise BundleError("the run was not made on the block's hidden scenes")
    if set(fresh.keys) != set(keys) or fresh.without_result:
        raise BundleError(
            f"the run on the hidden seeds is not complete: {len(fresh.without_result)} of "
            f"{len(keys)} trials are missing; go on with --resume"
        )
    records, claims = with_repeated_failed(fresh.records), claims_of(valid)
    category_of = valid.run.manifest.categories
    variants: dict[tuple[str, int], Counts] = {}
    categories: dict[str, list[Counts]] = {}
    for variant in block.seeds:
        made = [records[k].success for k in keys if k.variant == variant]
        counts = replace(claims[variant], fresh=sum(made), fresh_trials=len(made))
        variants[variant] = counts
        categories.setdefault(category_of[variant[0]], []).append(counts)
    tests = {name: agreement(found) for name, found in categories.items()}
    corrected = holm([found.p for found in tests.values()])
    everything = list(variants.values())
    overall = agreement(everything)
    return Reproduction(
        bundle=valid.manifest.bundle,
        commitment=block.commitment,
        trials=len(keys),
        repeated=sum(was_repeated(records[key]) for key in keys),
        alpha=alpha,
        overall=OverallTest(overall.fresh, overall.expected, overall.p),
        categories={
            name: CategoryTest(fresh=found.fresh, expected=found.expected, p=found.p, p_holm=p)
            for (name, found), p in zip(tests.items(), corrected, strict=True)
        },
        variants={f"{task}/{level}": astuple(c) for (task, level), c in variants.items()},
        power={f"{drop:g}": power(everything, drop, alpha) for drop in DROPS},
    )
