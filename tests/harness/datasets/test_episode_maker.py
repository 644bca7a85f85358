"""What is said of a seed that gave no episode."""

from __future__ import annotations

import pytest
from fake_records import trial_record

from robospa.harness.datasets.maker import replay_end
from robospa.harness.replay import ENDED
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Blocks_Size", 1, 1)


@pytest.mark.parametrize(
    ("end", "message", "words"),
    [
        ("policy_error", f"at step 8: {ENDED}", "all recorded commands were sent"),
        ("step_limit", "", "step_limit"),
        ("infrastructure", "scene unstable", "infrastructure scene unstable"),
    ],
)
def test_how_a_replay_ended(end: str, message: str, words: str) -> None:
    assert replay_end(trial_record(KEY, end=end, message=message)) == words
