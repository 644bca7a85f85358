"""Policies that fail on purpose: that they fail as they say."""

from __future__ import annotations

import pytest

from robospa.baselines.oracle import FailingOracle, create_failing
from robospa.harness.demonstrations.changed_plans import KINDS
from robospa.results.failures.labels import label
from robospa.trial import TrialKey

SEED = 930_000


def test_an_unknown_mistake_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="no mistake 'sulks'; there are neighbour"):
        create_failing("sulks")


def test_the_spec_says_which_mistake_it_is() -> None:
    for kind in KINDS:
        spec = FailingOracle(kind).spec
        assert (spec.name, spec.privileged) == (f"mistakes:{kind}", True)


@pytest.mark.sim
@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        ("neighbour", "Pick_Blocks_Size", "target_grounding"),
        ("beside", "Pick_Blocks_Size", "no_contact_grasp"),
        ("drops", "Pick_Blocks_Size", "target_execution"),
        ("drops", "Put_Bottles_Dustbin", "manipulation"),
        ("swaps", "Stack_Blocks_Color_Order", "temporal_ordering"),
        ("repeats", "Click_Can_Place_Items", "redundant_repetition"),
        ("forgets", "Remember_Color_Cover", "memory"),
        ("nothing", "Press_Stapler_Repeat", "no_attempt"),
    ],
)
def test_a_scripted_mistake_is_labelled_as_scripted(kind: str, name: str, expected: str) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    world, policy = SapienWorld(render=False), create_failing(kind)
    found = label(run_trial(world, policy, TrialKey(name, 2, SEED), policy_seed=0))
    world.close()
    assert policy.applies and found is not None
    assert found.kind == expected
