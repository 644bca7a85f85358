"""Messages: round trips, strict types, tolerated additions, versions, specs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wire_helpers import SPEC, TRIAL, observation

from robospa.action_space import KINDS
from robospa.clients.openpi_family import FamilyOptions
from robospa.observation import CAMERAS, STATES, CameraSpec
from robospa.protocol.codec import decode, encode
from robospa.protocol.errors import DecodeError, PolicyAnswerError, VersionMismatch
from robospa.protocol.messages import (
    MAX_ID,
    Actions,
    End,
    Ended,
    Error,
    Hello,
    Infer,
    Message,
    Ready,
    Reset,
    pack,
    unpack,
)
from robospa.protocol.openpi import from_openpi
from robospa.protocol.policy import PolicySpec, TrialInfo, check_chunk, check_observation
from robospa.trial import TrialKey

IDS = st.integers(0, MAX_ID)
TEXT = st.text(max_size=20)
NAME = TEXT.filter(str.isprintable)
WORD = st.from_regex(r"[A-Za-z0-9_+-][A-Za-z0-9_.+-]{0,20}|", fullmatch=True)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=10,
)
JSON_MAP = st.dictionaries(TEXT, JSON, max_size=3)
SPECS = st.builds(
    PolicySpec,
    name=NAME,
    cameras=st.lists(
        st.builds(CameraSpec, st.sampled_from(CAMERAS), st.integers(1, 8192), st.integers(1, 8192)),
        unique_by=lambda camera: camera.name,
    ).map(tuple),
    state=st.sampled_from(STATES),
    action=st.sampled_from(KINDS),
    horizon=st.none() | st.integers(50, 10_000),
    execute=st.none() | st.integers(1, 50),
    history=st.lists(st.integers(-100, -1), max_size=3).map(tuple),
    image_codec=st.sampled_from(["raw", "jpeg"]),
    batch=st.integers(1, 4096),
    seeded=st.booleans(),
    privileged=st.booleans(),
    needs_trial_key=st.booleans(),
    embodiments=st.lists(NAME, max_size=2).map(tuple),
    action_dim=st.none() | st.integers(1, 256),
)
KEYS = st.builds(
    TrialKey,
    task=st.from_regex(r"[A-Za-z0-9_]{1,20}", fullmatch=True),
    level=st.integers(0, 9),
    seed=st.integers(0, 2**53),
)
TRIALS = st.builds(
    TrialInfo,
    task=WORD,
    embodiment=st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9_.:,=+-]{0,20}", fullmatch=True),
    id=WORD,
    key=st.none() | KEYS,
    instruction=TEXT,
    policy_seed=st.integers(0, 2**64 - 1),
    extra=JSON_MAP,
)
MESSAGES = (
    st.builds(Hello, IDS, st.just("1.7"), NAME, SPECS)
    | st.builds(Reset, IDS, TRIALS)
    | st.builds(Ready, IDS)
    | st.builds(Error, IDS, TEXT, TEXT, st.booleans())
    | st.builds(End, IDS, JSON_MAP)
    | st.builds(Ended, IDS)
)


@given(MESSAGES)
def test_any_message_survives(message: Message) -> None:
    assert unpack(pack(message)) == message


@given(IDS, JSON_MAP, st.integers(0, 2**40))
def test_an_observation_survives_with_its_privileged_state(
    id: int, privileged: dict[str, Any], step: int
) -> None:
    sent = observation(step, privileged=privileged, history={-3: {"state": np.ones(14)}})
    found = unpack(pack(Infer(id, sent)))
    assert isinstance(found, Infer)
    assert found.observation["privileged"] == privileged
    assert found.observation["step"] == step
    assert found.observation["history"][-3]["state"].tolist() == [1.0] * 14
    assert np.array_equal(found.observation["images"]["head"], sent["images"]["head"])


def test_actions_survive() -> None:
    chunk = np.arange(28, dtype=np.float32).reshape(2, 14)
    found = unpack(pack(Actions(5, chunk, {"infer_ms": 1.5, "batch": 3})))
    assert isinstance(found, Actions)
    assert found.id == 5
    assert found.timing == {"infer_ms": 1.5, "batch": 3}
    assert np.array_equal(found.chunk, chunk)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"type": None}, "'type' must be text"),
        ({"type": "hallo"}, "not one of hello, reset"),
        ({"id": -1}, "'id'"),
        ({"id": True}, "'id'"),
        ({"id": 2**53 + 1}, "'id'"),
        ({"id": "3"}, "'id'"),
        ({"trial": []}, "'trial' must be a map"),
        ({"trial": {**TRIAL.to_json(), "policy_seed": "1"}}, "'trial.policy_seed'"),
        ({"trial": {**TRIAL.to_json(), "extra": [1]}}, "'trial.extra'"),
        ({"trial": {"task": "x"}}, "lacks the field 'embodiment'"),
    ],
)
def test_wrong_fields_are_refused_by_name(changes: dict[str, Any], reason: str) -> None:
    message = {"type": "reset", "id": 1, "trial": TRIAL.to_json(), **changes}
    with pytest.raises(DecodeError, match=reason):
        unpack(encode(message))


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"cameras": [{"name": "top"}]}, r"'cameras\[0\].name'"),
        ({"cameras": [{"name": "head"}, {"name": "head"}]}, "twice"),
        ({"cameras": [{"name": "head", "width": 0}]}, r"'cameras\[0\].width'"),
        ({"horizon": 0}, "'horizon'"),
        ({"execute": 99}, "'execute'"),
        ({"history": [1]}, r"'history\[0\]' must be a whole number <= -1, not 1"),
        ({"action": "fly"}, "joint, ee"),
        ({"image_codec": "png"}, "raw, jpeg"),
        ({"batch": 0}, "'batch'"),
        ({"seeded": 1}, "true or false"),
        ({"embodiments": [1]}, r"'embodiments\[0\]' must be text, not 1"),
        ({"action_dim": 0}, "'action_dim'"),
        ({"name": 3}, "'name'"),
        ({"contract": ["dtype"]}, "'contract' has NAME=TEXT"),
    ],
)
def test_a_wrong_spec_is_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(DecodeError, match=reason):
        PolicySpec.from_json({**SPEC.to_json(), **changes})


@pytest.mark.parametrize("value", [None, 3, [], "hello", b"x", {1: 2}, {}])
def test_what_is_no_message_is_refused(value: Any) -> None:
    with pytest.raises(DecodeError):
        unpack(encode(value))


def test_fields_of_later_minor_versions_are_ignored() -> None:
    spec = {**SPEC.to_json(), "audio": True}
    hello = {"type": "hello", "id": 0, "version": "1.9", "server": "s", "spec": spec, "new": [1]}
    assert unpack(encode(hello)) == Hello(0, "1.9", "s", SPEC)


@pytest.mark.parametrize("name", ["../../etc", "a/b", "a\\b", "..", ".x", "a\x00b", "a" * 500])
@pytest.mark.parametrize("field", ["task", "embodiment", "id"])
def test_names_that_could_be_paths_are_refused(name: str, field: str) -> None:
    with pytest.raises(DecodeError, match=f"trial.{field}") as caught:
        unpack(pack(Reset(1, replace(TRIAL, **{field: name}))))
    assert len(str(caught.value)) < 300


def test_an_observation_needs_its_step() -> None:
    with pytest.raises(DecodeError, match="'step'"):
        unpack(encode({"type": "infer", "id": 1, "observation": {}}))


@pytest.mark.parametrize("chunk", [None, [[0.0]], "x"])
def test_actions_must_be_an_array(chunk: Any) -> None:
    with pytest.raises(DecodeError, match="'chunk' must be an array"):
        unpack(encode({"type": "actions", "id": 1, "chunk": chunk}))


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (None, "NoneType"),
        ([[0.0] * 14], "list"),
        ({"left": 1, "right": 2}, "a map of left, right, not an array"),
        (np.zeros((2, 14), np.int32), "int32"),
        (np.zeros(14, np.float32), r"\(14,\)"),
        (np.zeros((0, 14), np.float32), r"\(0, 14\)"),
        (np.zeros((5, 14), np.float32), "horizon 4"),
        (np.zeros((2, 13), np.float32), "13 numbers"),
        (np.full((2, 14), np.nan, np.float32), "nan in action 0"),
        (np.full((2, 14), 1e300), "inf in action 0"),
    ],
)
def test_chunks_that_cannot_be_executed(answer: Any, reason: str) -> None:
    with pytest.raises(PolicyAnswerError, match=reason):
        check_chunk(answer, SPEC)


def test_any_length_is_taken_where_none_is_declared() -> None:
    free = replace(SPEC, horizon=None)
    assert PolicySpec.from_json({"name": "free"}).horizon is None
    assert len(check_chunk(np.zeros((10_000, 14), np.float32), free)) == 10_000
    with pytest.raises(PolicyAnswerError, match="T from 1 to 10000"):
        check_chunk(np.zeros((10_001, 14), np.float32), free)


PAST = {"history": (-3,)}
OBJECTS = {"environment_state": True}
COMMITTED = {"committed_actions": True}


@pytest.mark.parametrize(
    ("spec", "changes", "reason"),
    [
        ({}, {"images": {}}, "camera 'head'"),
        ({}, {"images": None}, "'images'"),
        ({}, {"images": {"head": np.zeros((6, 8, 1), np.uint8)}}, r"\(6, 8, 1\)"),
        ({}, {"images": {"head": np.zeros((6, 8, 3))}}, "float64"),
        ({}, {"state": np.zeros(14)}, "'state'"),
        ({}, {"state": [0.0]}, "'state'"),
        ({}, {"instruction": None}, "'instruction'"),
        *((PAST, {"history": past}, "history -3") for past in (None, {}, {-3: None}, {-3: {}})),
        *((OBJECTS, {"environment_state": row}, "'environment_state' must be float32 of one axis")
          for row in (None, [0.0], np.zeros(4), np.zeros((2, 2), np.float32))),
        (COMMITTED, {"committed": np.zeros(14, "f4"), "delay": 1}, "float32 of two axes"),
        (COMMITTED, {"committed": np.zeros((2, 14), "f8"), "delay": 1}, "must be float32"),
        (COMMITTED, {"committed": np.zeros((2, 14), "f4")}, "'delay' must be a whole number"),
        (COMMITTED, {"committed": np.zeros((2, 14), "f4"), "delay": -1}, "'delay' must be"),
    ],
)  # fmt: skip
def test_observations_that_do_not_fit_the_spec(
    spec: dict[str, Any], changes: dict[str, Any], reason: str
) -> None:
    """What the spec does not ask for is not looked at."""
    with pytest.raises(DecodeError, match=reason):
        check_observation(observation(**changes), replace(SPEC, **spec))
    if spec:
        check_observation(observation(**changes), SPEC)


def test_what_a_spec_asks_for_may_be_left_out_only_in_part() -> None:
    check_observation(observation(), replace(SPEC, committed_actions=True))
    asks = replace(SPEC, environment_state=True)
    assert asks.sees_state and not asks.privileged and not SPEC.sees_state


def corpus() -> list[bytes]:
    """Valid messages whose content somebody reads, one of each kind, and openpi's observation."""
    seen = observation(history={-1: observation()}, privileged={"a": [1, 2.5, None, True]})
    chunk = np.zeros((3, 14), np.float32)
    kinds = [Hello(0, "1.1", "s", SPEC), Reset(1, TRIAL), Infer(2, seen), Actions(2, chunk, {})]
    return [*map(pack, kinds), encode(FamilyOptions().request(observation()))]


PIECES = st.binary(max_size=8) | st.sampled_from([b"\xff" * 4, b"\x80\0\0\0", b"\xdd", b"\xc6"])


@given(
    st.sampled_from(corpus()),
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 8), PIECES), min_size=1, max_size=4),
)
@settings(max_examples=300)
def test_damaged_messages_are_refused_with_documented_errors(
    message: bytes, changes: list[tuple[int, int, bytes]]
) -> None:
    data = message
    for place, cut, piece in changes:
        at = place % (len(data) + 1)
        data = data[:at] + piece + data[at + cut :]
    for read in (unpack, lambda sent: from_openpi(decode(sent), 0, SPEC)):
        try:
            found = read(data)
            if isinstance(found, Infer):
                check_observation(found.observation, replace(SPEC, history=(-1,)))
            elif isinstance(found, Actions):
                check_chunk(found.chunk, SPEC)
        except (DecodeError, VersionMismatch, PolicyAnswerError) as error:
            assert str(error)
