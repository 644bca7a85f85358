"""A recorded demonstration goes on past the goal, and its replay meets it within the limit."""

from __future__ import annotations

import numpy as np
import pytest

from robospa.harness.demonstrations.demonstration import demonstrate
from robospa.harness.demonstrations.recorder import FrameRecorder, frame_steps
from robospa.harness.replay import replay
from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.tasks.catalog import task
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim

SHARE = 0.85
"""Of the step limit that a demonstration may take."""


@pytest.mark.parametrize(
    "key",
    [
        TrialKey("Pick_Breads_Multi_View", 2, 950_001),
        TrialKey("Lift_Pot_Repeat", 1, 950_001),
        TrialKey("Press_Stapler_Repeat", 3, 950_001),
    ],
    ids=lambda key: key.task,
)
def test_a_replayed_demonstration_succeeds_within_the_step_limit(key: TrialKey) -> None:
    recorder = FrameRecorder(frame_steps(key.task))
    made = demonstrate(SapienWorld(render=False, limits=DEMONSTRATION_LIMITS), key, recorder)
    assert made.success and not made.failures
    space = embodiment(key.embodiment).action_space("joint")
    actions = recorder.episode("x", made.instruction, {}, space, ()).actions
    limit = task(key.task).levels[key.level].steps
    done = replay(SapienWorld(render=False), key, actions, "joint")
    assert done.success and done.end == "success"
    assert done.steps < len(actions) <= SHARE * limit  # it goes on where the replay has succeeded
    assert np.array_equal(actions[-1], actions[-2])  # and comes to rest
