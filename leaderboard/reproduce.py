"""Level 3, *reproduced*: hidden scenes run against the submitter's server, held against the bundle.

The server has to be what the bundle says. Successes, and those at the first choice, are tested
exactly over everything and in every cell (`robospa.leaderboard.agreement`). A fresh trial that was
repeated counts as a failure: the policy may have broken off the attempts that went badly.

A block of hidden scenes is a JSON file of a random salt and fresh seeds. The salt enters every
random draw of scenes and sentences, so nobody can draw them who has only the seeds. The block's
hash, the commitment, is published first; the block itself when the trials are over.
"""

import json
import secrets
from collections.abc import Callable, Sequence
from dataclasses import astuple, replace
from operator import attrgetter
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct, to_builtins

from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.evaluate import Request
from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.policy_probe import probe_policies
from robospa.harness.seeds.attempt import expert_pool
from robospa.harness.trial import salt_hash
from robospa.leaderboard import agreement
from robospa.leaderboard.bundle import MEGA, BundleError, canonical, parse_map, sha256
from robospa.leaderboard.evidence import MOST_ALPHA, RANKED, TESTED, Reproduction
from robospa.leaderboard.rules import Reference
from robospa.leaderboard.verify import Valid
from robospa.results.records.runs import Run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.first_choice import first_choice
from robospa.results.scoring.repeats import was_repeated, with_repeated_failed
from robospa.schema import Sha256, pattern, read
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey
from robospa.trial import CATEGORIES, DIMENSIONS, REFERENCE, TrialKey

FORMAT = 2
"""In format 1 the salt did not enter the scenes."""
FIRST, LAST = 10**9, 2**53
"""Hidden seeds lie here: far from the shipped ones, and exact in any JSON reader."""
SALT = 32
"""Bytes of the salt."""
Place = Annotated[str, pattern(r"[A-Za-z0-9_]{1,64}/[1-5]", "TASK/LEVEL")]
Seeds = tuple[Annotated[int, Meta(ge=FIRST, lt=LAST)], ...]


class Block(Struct, frozen=True, forbid_unknown_fields=True):
    """Hidden seeds by "TASK/LEVEL"."""

    seeds: Annotated[dict[Place, Annotated[Seeds, Meta(min_length=1)]], Meta(min_length=1)]
    salt: Sha256  # SALT bytes, as long as a hash
    suite: str = SUITE
    format: int = FORMAT

    @property
    def commitment(self) -> str:
        """The hash to publish before the block."""
        return sha256(canonical(self))


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
    seeds: dict[str, tuple[int, ...]] = {}
    salt = secrets.token_hex(SALT)
    with expert_pool(workers, salt) as pool:
        for task, level in variants:
            found: list[int] = []
            tried = 0
            while len(found) < count:
                if tried > 2 * count + 10:
                    raise BundleError(f"the expert does not solve {task} level {level}")
                lacking = range(count - len(found))
                wanted = [FIRST + secrets.randbelow(LAST - FIRST) for _ in lacking]
                tried += len(wanted)
                key = ListKey(task, level, embodiment, mode)
                futures = [pool.submit((key, seed)) for seed in wanted]
                attempts = [future.result() for future in futures]
                found += [item.seed for item in attempts if item.accepted]
            seeds[f"{task}/{level}"] = tuple(sorted(set(found)))
            note(f"{task} level {level}: {len(found)} of {tried} seeds accepted")
    return Block(seeds, salt)


def write_block(block: Block, path: Path) -> None:
    """Write `block` to a new file."""
    if path.exists():
        raise BundleError(f"{path} is already there; a block is never written over")
    replace_file(path, (json.dumps(to_builtins(block), indent=1) + "\n").encode())


def read_block(path: Path, commitment: str) -> Block:
    """The block in `path`, if it is the one that `commitment` was published for."""
    try:
        if path.stat().st_size > 16 * MEGA:
            raise BundleError(f"{path} is larger than a block of seeds can be")
        data = parse_map(path.read_bytes(), path.name)
    except OSError as error:
        raise BundleError(f"the block {path} cannot be read: {error.strerror}") from None
    if sha256(canonical(data)) != commitment.strip().lower():
        raise BundleError(
            f"{path.name} is not the block that was committed to: its hash is "
            f"{sha256(canonical(data))}, not {commitment.strip()[:64]}"
        )
    block = read(Block, data, path.name, BundleError)
    if (block.suite, block.format) != (SUITE, FORMAT):
        raise BundleError(f"{path.name} is no block of {SUITE} and of format {FORMAT}")
    if twice := [place for place, found in block.seeds.items() if len(set(found)) < len(found)]:
        raise BundleError(f"{path.name}, {twice[0]}: a seed is there twice")
    return block


DROPS = (0.02, agreement.LIE, 0.1)
"""Losses of success for which the power is stated."""


COUNTED: dict[str, Callable[[TrialRecord], bool]] = dict(
    zip(TESTED, (attrgetter("success"), first_choice), strict=True)
)
"""What counts as a success in the metrics that are tested."""


def claims_of(valid: Valid, metric: str = RANKED) -> dict[str, agreement.Counts]:
    """What the bundle claims of each of its variants, without fresh trials."""
    found: dict[str, list[bool]] = {}
    for key, record in valid.run.records.items():
        found.setdefault(f"{key.task}/{key.level}", []).append(COUNTED[metric](record))
    return {name: agreement.Counts(sum(made), len(made), 0, 0) for name, made in found.items()}


def plan(valid: Valid, trials: int | None, alpha: float = 0.01) -> int:
    """How many hidden trials of every variant a block for the bundle has: `trials`, or as few as a
    badge and ranks in all categories need. BundleError for fewer than a badge needs, unless the
    bundle is for practice.
    """
    claims = claims_of(valid)
    if not 0 < alpha <= MOST_ALPHA:
        raise BundleError(f"a test at the level {alpha:g} is none; choose at most {MOST_ALPHA:g}")
    if valid.manifest.practice and trials is not None and trials > 0:
        return trials
    needed = agreement.trials_needed(list(claims.values()), alpha)
    if needed is None:
        raise BundleError(
            f"no block earns this bundle a badge: with {len(valid.keys)} trials its own rates are "
            f"too uncertain to notice a lie of {100 * agreement.LIE:g} points"
        )
    if trials is not None and trials < needed:
        raise BundleError(
            f"{trials} hidden trials a variant are too few: {needed} notice a lie of "
            f"{100 * agreement.LIE:g} points with {100 * agreement.LEAST_POWER:g} %"
        )
    if trials is not None:
        return trials
    found, level = _cells(valid, alpha)
    categories = [[claims[v] for v in own] for place, own in found.items() if place in RANKED_ROWS]
    more = [agreement.trials_needed(own, level, agreement.CELL_LIE) or 0 for own in categories]
    return max(needed, *more, 0)


def _cells(valid: Valid, alpha: float) -> tuple[dict[str, tuple[str, ...]], float]:
    """The cells of the bundle, and the level that is left for each when all are tested."""
    found = agreement.cells(claims_of(valid), valid.run.manifest.categories)
    return found, alpha / (len(COUNTED) * len(set(found.values())))


RANKED_ROWS = frozenset(f"{row}/0" for row in (*DIMENSIONS, *CATEGORIES))
"""The cells in which a block of the usual size earns a rank."""


def hidden_keys(valid: Valid, block: Block, reference: Reference) -> list[TrialKey]:
    """The trials of a block under the bundle's settings; BundleError if they do not fit it."""
    there = set(claims_of(valid))
    if differ := sorted(there ^ set(block.seeds)):
        raise BundleError(f"only one of block and bundle has {differ[0]}; draw a block for it")
    model = valid.keys[0]
    keys = []
    for place, seeds in block.seeds.items():
        task, level = place[:-2], int(place[-1])
        listed = reference.seeds(task, level, model.embodiment, model.mode)
        if shown := set(seeds) & set(listed):
            raise BundleError(f"seed {min(shown)} of {place} is not hidden")
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
    records = with_repeated_failed(fresh.records)
    made: dict[str, dict[str, agreement.Counts]] = {}
    for metric, good in COUNTED.items():
        claims = claims_of(valid, metric)
        found: dict[str, list[bool]] = {variant: [] for variant in claims}
        for key in keys:
            found[f"{key.task}/{key.level}"].append(good(records[key]))
        made[metric] = {
            v: replace(claims[v], fresh=sum(won), fresh_trials=len(won)) for v, won in found.items()
        }
    ranked = made[RANKED]
    places, level = _cells(valid, alpha)
    chances = {
        own: agreement.power([ranked[v] for v in own], agreement.CELL_LIE, level)
        for own in set(places.values())
    }
    return Reproduction(
        bundle=valid.manifest.bundle,
        commitment=block.commitment,
        trials=len(keys),
        repeated=sum(was_repeated(records[key]) for key in keys),
        alpha=alpha,
        categories=valid.run.manifest.categories,
        counts={m: {v: astuple(c) for v, c in counts.items()} for m, counts in made.items()},
        power={f"{drop:g}": agreement.power(list(ranked.values()), drop, alpha) for drop in DROPS},
        cells={place: chances[own] for place, own in places.items()},
    )
