"""OpenVLA-OFT: what its server reads of us, and what its answers become."""

import json
from typing import Any

import numpy as np
import pytest
from standins import answered, first_request, talking
from standins_http import LEFT, RIGHT, STATE, TRIAL, Oft, image, joint_chunk, observation

from robospa.protocol.errors import PolicyAnswerError, ServerError


def test_the_left_wrist_comes_before_the_right_and_no_other_name_has_wrist_in_it() -> None:
    seen = first_request(Oft())
    assert np.array_equal(seen["full_image"], image("head"))
    assert [w.tobytes() for w in seen["wrists"]] == [image(n).tobytes() for n in (LEFT, RIGHT)]
    assert seen["state"].dtype == np.float64 and np.array_equal(seen["state"], STATE)
    assert seen["instruction"] == "pick the red block"


def test_a_text_with_status_200_is_the_servers_error_and_says_where_the_reason_is() -> None:
    with pytest.raises(ServerError, match=r"reported an error: error; .*'aloha'"):
        answered(Oft(lambda seen: 1 / 0))


def test_seven_numbers_say_how_the_server_is_to_be_started() -> None:
    with pytest.raises(PolicyAnswerError, match=r"7 numbers .*start deploy.py with 'aloha'"):
        answered(Oft(lambda seen: np.zeros((8, 7))))


def test_rows_of_plain_lists_are_read_as_well() -> None:
    rows = json.dumps(joint_chunk(2).tolist()).encode()
    assert np.array_equal(answered(Oft(None, rows)), joint_chunk(2).astype(np.float32))


def test_relative_actions_are_added_to_the_last_target_of_the_trial_and_never_rebased() -> None:
    """The original adds each to the target before it, from the joints at the trial's start on."""
    elsewhere = STATE + np.float32(0.3)
    changes = joint_chunk(3)
    target: Any = STATE.astype(float)
    with talking(Oft(lambda seen: changes), "?actions=relative&execute=2") as policy:
        for state in (STATE, elsewhere):  # the second trial starts elsewhere
            policy.reset(TRIAL)
            target = state.astype(float)
            for step in (0, 2, 4):
                chunk = policy.infer(observation(step, state=state + np.float32(step)))
                assert np.allclose(chunk, target + np.cumsum(changes, axis=0), atol=1e-6)
                target = target + changes[:2].sum(axis=0)
