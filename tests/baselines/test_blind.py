"""Blind policies: that they use nothing of what is asked for, and what they score all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.baselines import blind
from robospa.tasks.catalog import build_scene
from robospa.trial import TrialKey

POLICIES = {
    "tries-all": blind.create_tries_all,
    "presses-all": blind.create_presses_all,
    "commonest": blind.create_commonest,
}


@pytest.mark.parametrize(
    ("planner", "name"),
    [
        (blind.tries_all, "Pick_Blocks_Size"),
        (blind.presses_all, "Click_Objects_Order"),
        (blind.commonest, "Move_Blocks_Apart"),
    ],
)
def test_it_does_the_same_whatever_is_asked_for(planner: blind.Planner, name: str) -> None:
    scene = build_scene(name, 3, 100_000)
    rows, home = [], at_home(scene.embodiment, *scene.everything).snapshot
    for facts in (scene.facts, {}, {key: "wrong" for key in scene.facts}):
        expert = blind.BlindExpert(replace(scene, facts=facts), home, planner)
        rows.append(expert.next(home))
    assert len(rows[0]) > 1, "it does something"
    for other in rows[1:]:
        np.testing.assert_array_equal(rows[0], other)


@pytest.mark.sim
@pytest.mark.parametrize(
    ("policy", "name", "level", "wrong"),
    [
        ("tries-all", "Pick_Cups_Canonical", 5, "wrong_object"),
        ("tries-all", "Lift_Fan_Repeat", 3, ""),
        ("presses-all", "Click_Objects_Order", 5, "wrong_order"),
        ("presses-all", "Observe_Objects_Click_Memory", 3, "wrong_order"),
        ("commonest", "Place_Bowls_Plates", 3, ""),
    ],
)
def test_the_official_rule_lets_it_succeed(policy: str, name: str, level: int, wrong: str) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    world, made = SapienWorld(render=False), POLICIES[policy]()
    record = run_trial(world, made, TrialKey(name, level, 100_000), policy_seed=0)
    world.close()
    assert made.spec.name == policy and made.spec.privileged
    assert record.success
    assert not wrong or wrong in {event["kind"] for event in record.events}
