"""Blocks are planned so that a lie shows, and runs on hidden scenes are held against the claim."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import PICK, REFERENCE, Idle, Weak, World
from fake_runs import run_of, trial_record
from msgspec import to_builtins
from msgspec.structs import replace as replaced
from run_fakes import FakePolicy, parts
from site_fakes import make_valid

from robospa.harness.trial import run_trial, salt_hash
from robospa.leaderboard.bundle import BundleError, canonical, sha256
from robospa.leaderboard.reproduce import (
    FIRST,
    Block,
    Reproduction,
    compare,
    hidden_keys,
    plan,
    read_block,
    write_block,
)
from robospa.leaderboard.verify import Valid
from robospa.results.records.manifest import RunManifest
from robospa.results.records.trial_record import RetryRow
from robospa.trial import CATEGORIES, TrialKey

SALT = "ab" * 32
LEVELS = (1, 2, 3, 4, 5)


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Valid:
    """A bundle of 20 trials, 15 of them successes."""
    return make_valid(tmp_path_factory.mktemp("claim"))


@pytest.fixture(scope="module")
def large(valid: Valid) -> Valid:
    """As if it had 40 of 100 successes in each of 280 variants."""
    names = [f"Task_{task}" for task in range(56)]
    variants = [(task, level) for task in names for level in LEVELS]
    records = [trial_record(TrialKey(*v, n), n < 40) for v in variants for n in range(100)]
    return replace(valid, run=run_of(records, categories=dict.fromkeys(names, "GAC")))


def block_of(count: int) -> Block:
    return Block({f"{PICK}/{level}": tuple(range(FIRST, FIRST + count)) for level in LEVELS}, SALT)


def reproduced(
    valid: Valid, block: Block, policy: FakePolicy, salt: str = SALT, repeated: int = 0
) -> Reproduction:
    """The comparison with a run of `policy`, the first trials of which were `repeated`."""
    keys = hidden_keys(valid, block, REFERENCE)
    found = partial(parts, salt=salt)
    records = {k: run_trial(World(), policy, k, policy_seed=0, parts=found) for k in keys}
    for key in keys[:repeated]:
        lost = (RetryRow("connection", "it hung up", 5),)
        records[key] = replace(records[key], attempts=2, retries=lost)
    settings = {"salt_sha256": salt_hash(salt) if salt else ""}
    return compare(valid, run_of(records.values(), settings=settings), keys, block)


def test_an_honest_claim_holds_and_an_empty_one_does_not(valid: Valid) -> None:
    honest = reproduced(valid, block_of(8), Weak())
    assert honest.holds and honest.overall.fresh == 35 and honest.repeated == 0
    assert honest.bundle == valid.manifest.bundle and honest.trials == 40
    nothing = reproduced(valid, block_of(8), Idle())
    assert not nothing.holds and nothing.overall.fresh == 0


def test_one_hidden_trial_earns_no_badge(valid: Valid) -> None:
    """Nothing contradicts, because nothing could."""
    found = reproduced(valid, block_of(1), Weak())
    assert found.holds and not found.enough
    assert found.power["0.05"] < 0.95
    assert "A badge needs 95 % for 5 points." in found.sentences()


def test_a_repeated_trial_counts_as_a_failure(valid: Valid) -> None:
    """Or a policy that hangs up whenever it is about to fail would end at 100 %."""
    found = reproduced(valid, block_of(8), FakePolicy(), repeated=40)
    assert found.overall.fresh == 0 and found.repeated == 40 and not found.holds
    assert "40 trials were repeated and count as failures." in found.sentences()


def test_a_run_on_other_scenes_than_the_blocks_is_refused(valid: Valid) -> None:
    for salt in ("", "cd" * 32):
        with pytest.raises(BundleError, match="not made on the block's hidden scenes"):
            reproduced(valid, block_of(2), Weak(), salt)


def test_a_block_has_every_variant_of_the_bundle(valid: Valid) -> None:
    with pytest.raises(BundleError, match=f"only one of block and bundle has {PICK}/2"):
        hidden_keys(valid, Block({f"{PICK}/1": (FIRST,)}, SALT), REFERENCE)


def test_a_block_has_as_many_trials_as_a_badge_needs(large: Valid) -> None:
    assert plan(large, None) == 7 == plan(large, 7)
    for few in (0, 6):
        with pytest.raises(BundleError, match=f"{few} hidden trials a variant are too few: "):
            plan(large, few)


def test_a_block_has_as_many_as_ranks_in_all_categories_need(large: Valid) -> None:
    tasks = enumerate(large.run.manifest.categories)
    info = RunManifest(categories={task: CATEGORIES[n % 10] for n, task in tasks})
    tenths = replace(large, run=replace(large.run, manifest=info))
    assert plan(tenths, None) > 7 == plan(tenths, 7)


def test_a_test_has_a_level_at_which_it_can_refuse(large: Valid) -> None:
    for alpha in (0.0, 1.0):
        with pytest.raises(BundleError, match=f"level {alpha:g} is none"):
            plan(large, None, alpha)


def test_a_bundle_of_few_trials_is_told_that_no_block_helps(valid: Valid) -> None:
    with pytest.raises(BundleError, match="with 20 trials its own rates are too uncertain"):
        plan(valid, 1000)
    practice = replace(valid, manifest=replaced(valid.manifest, practice=True))
    assert plan(practice, 3) == 3


BLOCK = Block({"Pick_Blocks_Size/1": (FIRST, FIRST + 7)}, "ab" * 32)


def test_a_block_is_read_back_under_its_commitment_and_never_written_over(tmp_path: Path) -> None:
    for name, other in (("seeds", {"Pick_Blocks_Size/1": (FIRST,)}), ("salt", "cd" * 32)):
        write_block(replaced(BLOCK, **{name: other}), tmp_path / name)
        with pytest.raises(BundleError, match="not the block that was committed to"):
            read_block(tmp_path / name, BLOCK.commitment)
    write_block(BLOCK, tmp_path / "b.json")
    assert read_block(tmp_path / "b.json", BLOCK.commitment) == BLOCK
    with pytest.raises(BundleError, match="never written over"):
        write_block(BLOCK, tmp_path / "b.json")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 1}, "format 2"),
        ({"salt": "short"}, "'salt' must be 64 hexadecimal"),
        ({"suite": "robospa-9"}, "no block of"),
        ({"seeds": {}}, "'seeds'"),
        ({"seeds": {"Pick_Blocks_Size/1": [100000]}}, "1000000000"),
        ({"seeds": {"Pick_Blocks_Size/1": [FIRST, FIRST]}}, "there twice"),
        ({"seeds": {"Pick_Blocks_Size/9": [FIRST]}}, "TASK/LEVEL"),
        ({"seeds": {"Pick_Blocks_Size/1": [True]}}, "whole number"),
        ({"extra": 1}, "unknown field 'extra'"),
    ],
)
def test_blocks_that_are_none_are_refused(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    data = {**to_builtins(BLOCK), **change}
    (tmp_path / "b.json").write_text(json.dumps(data))
    with pytest.raises(BundleError, match=words):
        read_block(tmp_path / "b.json", sha256(canonical(data)))
