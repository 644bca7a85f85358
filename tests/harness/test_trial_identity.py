"""What a policy is sent in place of a trial's key."""

from __future__ import annotations

from dataclasses import replace

from run_fakes import KEYED, FakePolicy, FakeWorld, parts

from robospa.harness.trial import new_run_seed, policy_seed, run_trial, salt_hash, trial_id
from robospa.protocol.codec import decode
from robospa.protocol.messages import Reset, pack
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Blocks_Size", 3, 100007)
SALT = "ab" * 32
TOLD = {"task", "embodiment", "instruction", "policy_seed", "id", "extra", "joints"}
"""All that a policy learns of a trial unless it asks for the key."""


def sent(policy: FakePolicy) -> dict[str, object]:
    """The trial as it lies in the bytes of `reset`."""
    run_trial(FakeWorld(), policy, KEY, policy_seed=5, trial_id="a1", parts=parts)
    assert policy.trial is not None
    message = decode(pack(Reset(1, policy.trial)))
    assert isinstance(message, dict)
    found: dict[str, object] = message["trial"]
    return found


def test_no_policy_is_sent_level_seed_mode_or_split() -> None:
    assert sent(FakePolicy()).keys() == TOLD
    assert sent(FakePolicy())["id"] == "a1"


def test_one_that_asks_is_sent_the_key() -> None:
    policy = FakePolicy(KEYED)
    assert sent(policy).keys() == TOLD | {"key"}
    assert policy.trial is not None and policy.trial.key == KEY


def test_ids_and_policy_seeds_follow_from_the_run_and_the_key() -> None:
    """A run of an older version has the seed 0: its bundle must still be what it says."""
    assert policy_seed(KEY, 0) == policy_seed(KEY, "0") == 634677935
    for value in (policy_seed, trial_id):
        mine = new_run_seed()
        made = {value(KEY, mine), value(KEY, 0), value(KEY, "1"), value(KEY, new_run_seed())}
        assert len(made | {value(replace(KEY, seed=100008), mine)}) == 5
        assert value(KEY, mine) in made
    assert 0 <= policy_seed(KEY, SALT) < 2**31
    assert salt_hash(SALT) not in (SALT, salt_hash("cd" * 32))
