"""Made-up trials are of a robot that the policy drives, with its joints."""

from __future__ import annotations

import pytest

from robospa.protocol.conformance import synthetic_observation, trial_for
from robospa.protocol.policy import PolicySpec


@pytest.mark.parametrize(
    ("spec", "robot", "joints"),
    [
        (PolicySpec("a"), "aloha-agilex", (6, 6)),
        (PolicySpec("a", embodiments=("franka-panda",)), "franka-panda", (7, 7)),
        (PolicySpec("a", embodiments=("piper", "aloha-agilex")), "aloha-agilex", (6, 6)),
        (PolicySpec("a", embodiments=("ours",), action_dim=15), "ours", (6, 7)),
        (PolicySpec("a", embodiments=("ours",), action_dim=18), "ours", (8, 8)),
        (PolicySpec("a", embodiments=("ours",), action="ee", action_dim=16), "ours", (6, 6)),
    ],
)
def test_the_robot_of_a_made_up_trial(
    spec: PolicySpec, robot: str, joints: tuple[int, int]
) -> None:
    trial = trial_for(spec)
    assert (trial.embodiment, trial.joints) == (robot, joints)
    assert len(synthetic_observation(spec)["state"]) == sum(joints) + 2
    assert type(trial).from_json(trial.to_json()) == trial
