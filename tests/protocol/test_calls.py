"""Calls of skills: what is taken, what is refused in one sentence, and the same over the wire."""

import numpy as np
import pytest
from wire_helpers import Recall, begun

from robospa.observation import CameraSpec
from robospa.protocol.calls import MAX_CALLS, check_calls
from robospa.protocol.conformance import check, synthetic_observation
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.policy import PolicySpec
from robospa.protocol.server import ServerThread

SPEC = PolicySpec("caller", cameras=(CameraSpec("head", 32, 24),), state="none", action="skill")
MIDDLE = [0.5, 0.5]
PICK = {"skill": "pick", "at": MIDDLE}

HOSTILE: tuple[tuple[object, str], ...] = (
    ("pick the red block", "str, not a list of calls"),
    (b"\x00", "bytes, not a list"),
    (None, "NoneType, not a list"),
    (PICK, "dict, not a list"),
    (np.zeros((2, 14), np.float32), "float32, not a list"),
    ([], "0 calls, not 1 to 64"),
    ([PICK] * 10_000, "10000 calls, not 1 to 64"),
    (["pick"], "call 1 must be a map whose 'skill' is one of pick"),
    ([PICK, {"skill": "fly\x1b[31m"}], "call 2 must be a map"),
    ([{"at": MIDDLE}], "call 1 must be a map"),
    ([{"skill": "pick"}], "call 1 (pick) lacks the field 'at'"),
    ([{**PICK, "at": [float("nan"), 0.5]}], "'at[0]' must be a number >= 0.0, not nan"),
    ([{**PICK, "at": [0.5, 1.01]}], "'at[1]' must be a number <= 1.0"),
    ([{**PICK, "at": [320]}], "'at' must be a list of length 2"),
    ([{**PICK, "at": "here"}], "'at' must be a list"),
    ([{**PICK, "at": [True, 0.5]}], "'at[0]' must be a number"),
    ([{**PICK, "name": "red_block"}], "has the unknown field 'name'"),
    ([{**PICK, "seconds": 1}], "has no field 'seconds': its fields are at, camera, arm, lift"),
    ([{**PICK, "camera": "front"}], "sees no camera 'front', only head"),
    ([{**PICK, "arm": "both"}], "'arm' must be one of left, right"),
    ([{"skill": "wait", "seconds": float("inf")}], "'seconds' must be a number <= 60"),
    ([{"skill": "place", "at": MIDDLE, "offset": [0, -9]}], "'offset[1]' must be a number >= -2"),
    ([{"skill": "dock", "at": MIDDLE, "to": [MIDDLE, MIDDLE]}], "'to' must be one point, not 2"),
    ([{"skill": "hit", "at": MIDDLE, "to": [0.5, MIDDLE]}], "'to[0]' must be a list"),
    ([{"skill": "raise_lower", "at": MIDDLE, "times": 10**30}], "'times' must be a whole number"),
)


@pytest.mark.parametrize(("answer", "sentence"), HOSTILE)
def test_hostile_answers_get_one_sentence(answer: object, sentence: str) -> None:
    with pytest.raises(PolicyAnswerError) as refused:
        check_calls(answer, SPEC)
    said = str(refused.value)
    assert sentence in said
    assert said.isprintable() and len(said) < 300


def test_what_is_taken_is_plain() -> None:
    hit = {"skill": "hit", "at": np.array(MIDDLE), "to": [(0, 1), (np.float32(0.25), 0.5)]}
    one = {"skill": "dock", "at": (0.5, 0.5), "to": MIDDLE, "arm": "left"}
    assert check_calls([hit, one, {"skill": "done"}], SPEC) == [
        {"skill": "hit", "at": MIDDLE, "to": [[0.0, 1.0], [0.25, 0.5]], "camera": "head"},
        {"skill": "dock", "at": MIDDLE, "to": MIDDLE, "arm": "left", "camera": "head"},
        {"skill": "done"},
    ]
    assert len(check_calls([PICK] * MAX_CALLS, SPEC)) == MAX_CALLS


def test_calls_over_the_wire() -> None:
    seen = synthetic_observation(SPEC)
    seen["calls"] = [{**PICK, "feedback": "out of reach"}]
    with ServerThread(policy_factory=lambda: Recall(SPEC, [PICK])) as server:
        assert all(result.passed is not False for result in check(server.url))
    policy = Recall(SPEC, [PICK])
    with ServerThread(policy) as server, begun(server) as remote:
        assert remote.infer(seen) == [{**PICK, "camera": "head"}]
        assert policy.seen[0]["calls"] == seen["calls"]
    refused = pytest.raises(PolicyAnswerError, match="call 1 must be a map whose 'skill'")
    with ServerThread(Recall(SPEC, ["pick"])) as server, begun(server) as remote, refused:
        remote.infer(seen)
