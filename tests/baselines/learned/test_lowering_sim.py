"""The expert's plan, read as primitives and lowered again, without the scene: it meets the goal."""

from __future__ import annotations

import pytest

from robospa.baselines.learned.maps.lowered_plan import LoweredPlan
from robospa.baselines.learned.maps.primitives import decisions_of
from robospa.harness.demonstrations.demonstration import DemonstrationWorld, demonstrate
from robospa.harness.demonstrations.recorder import KEYFRAMES, FrameRecorder
from robospa.harness.robots import embodiment
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
ROBOT = embodiment("aloha-agilex")


@pytest.mark.parametrize(
    ("task", "level", "kinds"),
    [
        ("Pick_Mugs_Distance", 3, ["grasp"]),
        ("Click_Can_Place_Items", 2, ["touch", "grasp", "release"]),
    ],
)
def test_an_experts_plan_survives_as_primitives(task: str, level: int, kinds: list[str]) -> None:
    key = TrialKey(task, level, 1_500_000, split="train")
    recorder = FrameRecorder(KEYFRAMES)
    assert demonstrate(DemonstrationWorld(render=False), key, recorder).success
    decisions = decisions_of(ROBOT, recorder.commanded)
    assert [one.primitive.kind for one in decisions if one.primitive is not None] == kinds
    record = run_trial(SapienWorld(render=False), LoweredPlan(ROBOT, decisions), key, policy_seed=0)
    assert record.success
