"""A server of openpi's form, and our client."""

import sys
import time
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgpack
import numpy as np
import pytest
from model_fakes import first, install, seen, trial
from standins import QUICK, Family, OpenPi, answered, talking
from standins_http import (
    HEAD,
    LEFT,
    OPENPI,
    STATE,
    TRIAL,
    image,
    joint_chunk,
    observation,
    shows,
)
from websockets.protocol import State
from wire_helpers import until

from robospa.action_space import ActionSpace
from robospa.clients import connect, openpi, openpi_family
from robospa.clients.openpi_family import FamilyOptions
from robospa.harness.running.policy_probe import probe
from robospa.harness.running.request import client_options
from robospa.protocol import transport
from robospa.protocol.errors import (
    ConnectionLost,
    EncodeError,
    HandshakeError,
    PolicyAnswerError,
    ProtocolViolation,
    ServerError,
)
from robospa.protocol.openpi import CAMERA_NAMES
from robospa.results.records.manifest import RunError


@pytest.mark.parametrize("scheme", ["openpi", "ws"])
def test_openpi_is_sent_what_its_server_reads(scheme: str) -> None:
    """And a server that does not select our own protocol is spoken to in openpi's."""
    server = OpenPi()
    with server as url, connect(url.replace("openpi", scheme, 1), timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        assert policy.hello["metadata"] == {"reset_pose": [0, -1.5, 1.5, 0, 0, 0]}
        assert policy.last_timing["infer_ms"] == 12.5 and policy.dialect == "openpi"
        assert (policy.spec.horizon, policy.spec.text_budget) == (None, 150)
        assert any("adapt_to_pi" in text for text in policy.hello["warnings"])
    sent = server.requests[0]
    assert sent.keys() == {"images", "state", "prompt"}
    names = ("cam_high", "cam_left_wrist", "cam_right_wrist")
    assert sent["images"].keys() == {*names}
    shows({name: np.moveaxis(shown, 0, -1) for name, shown in sent["images"].items()}, *names)
    assert sent["state"].dtype == np.float64
    assert np.array_equal(sent["state"], STATE)
    assert sent["prompt"] == "pick the red block"
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))


def test_metadata_that_openpis_own_client_reads_is_read() -> None:
    server = OpenPi()
    server.metadata = {
        "names": np.array(["left", "right"]),
        "gains": np.array([1.5, 2], ">f4"),
        "when": np.datetime64("2026-01-01"),
        b"stats": {b"mean": np.float32(0.5)},
    }
    with talking(server) as policy:
        assert policy.hello["metadata"]["gains"] == [1.5, 2]
        assert policy.hello["metadata"]["names"] == "array of <U5 [2]"
        assert policy.infer(observation()).shape == (3, 14)


@pytest.mark.parametrize(
    "actions", [[[1] * 14] * 2, np.ones((2, 14), np.int64), np.ones((2, 14), ">f8")], ids=type
)
def test_actions_that_openpis_own_client_takes_are_taken(actions: Any) -> None:
    answer = msgpack.packb({"actions": actions}, default=OPENPI.write)
    assert answered(OpenPi(None, answer)).tolist() == [[1] * 14] * 2


def test_openpis_key_is_sent_as_its_client_sends_it() -> None:
    server = OpenPi()
    with server as url:
        connect(url, token="s3cret", timeouts=QUICK).close()
        assert server.authorization == "Api-Key s3cret"
        connect(url.replace("openpi://", "ws://"), token="s3cret", timeouts=QUICK).close()
        assert server.authorization == "Bearer s3cret"


def test_openpi_other_cameras_names_and_keys() -> None:
    server = OpenPi()
    query = '?cameras=head&names=head:cam_high&extra={"seed":3}&horizon=3&execute=2'
    with talking(server, query) as policy:
        assert [camera.name for camera in policy.spec.cameras] == ["head"]
        policy.infer(observation(images={"head": image(HEAD)}))
        assert (policy.spec.horizon, policy.spec.execute) == (3, 2)
    assert server.requests[0]["images"].keys() == {"cam_high"}
    assert server.requests[0]["seed"] == 3


def test_committed_actions_go_under_the_names_of_the_server() -> None:
    options = FamilyOptions(committed="prev_chunk_left_over,inference_delay")
    assert options.spec("x").committed_actions and not FamilyOptions().spec("x").committed_actions
    rows = np.ones((3, 14), np.float32)
    seen: Any = {"instruction": "go", "committed": rows, "delay": 2}
    sent = options.request(seen)
    assert sent["inference_delay"] == 2
    assert np.array_equal(np.asarray(sent["prev_chunk_left_over"]), rows)
    assert set(FamilyOptions().request(seen)) == {"images", "prompt"}
    with pytest.raises(ValueError, match="is not two names"):
        FamilyOptions(committed="prefix")


def test_openpis_own_codec_reads_and_is_read() -> None:
    original = pytest.importorskip("openpi_client.msgpack_numpy")
    answer = {"actions": joint_chunk(), "server_timing": {"infer_ms": np.float64(3.5)}}
    server = OpenPi(None, original.packb(answer))
    with talking(server) as policy:
        chunk = policy.infer(observation())
        assert policy.last_timing["infer_ms"] == 3.5
    assert np.array_equal(chunk, joint_chunk().astype(np.float32))
    seen = original.unpackb(server.raw[0])
    assert np.array_equal(np.moveaxis(seen["images"]["cam_left_wrist"], 0, -1), image(LEFT))
    assert np.array_equal(seen["state"], STATE)
    assert seen["prompt"] == "pick the red block"


def test_after_a_text_frame_the_connection_is_gone() -> None:
    trace = 'Traceback (most recent call last):\n  File "policy.py"\nKeyError: "cam_high"\n'
    with talking(OpenPi(None, trace)) as policy:
        with pytest.raises(ServerError, match=r'KeyError: "cam_high"$') as caught:
            policy.infer(observation())
        assert caught.value.retriable
        with pytest.raises(ConnectionLost):
            policy.infer(observation())


@pytest.mark.parametrize(
    ("frame", "error"),
    [
        (b"\xc1", ProtocolViolation),
        (msgpack.packb([1]), ProtocolViolation),
        (msgpack.packb({"a": 1}), PolicyAnswerError),
        (msgpack.packb({"actions": [["1"] * 14]}), PolicyAnswerError),
    ],
)
def test_answers_that_cannot_be(frame: bytes, error: Any) -> None:
    with pytest.raises(error):
        answered(OpenPi(None, frame))


def test_a_camera_without_openpi_name_is_named() -> None:
    seen = observation(images={"third": np.zeros((6, 8, 3), np.uint8)})
    with talking(OpenPi()) as policy, pytest.raises(EncodeError, match="'third'"):
        policy.infer(seen)


class OfficialPolicy:
    """Answers its noise, cut to 14 columns."""

    def __init__(self) -> None:
        self.calls: list[dict[str, Any]] = []

    def infer(self, obs: dict[str, Any], *, noise: Any = None) -> dict[str, Any]:
        self.calls.append(obs)
        return {"actions": noise[:, :14].astype(np.float64), "policy_timing": {"infer_ms": 1.0}}


class BatchingPolicy(OfficialPolicy):
    """A version of the class that takes several."""

    def infer_batch(self, obs_batch: list[Any], *, noise: Any = None) -> dict[str, Any]:
        self.calls.append({"together": len(obs_batch)})
        return {"actions": noise[:, :, :14].astype(np.float64)}


def served(policy: Any) -> openpi.OpenPi:
    return openpi.OpenPi(policy, 50, 32, openpi.OpenPiServerOptions(config="c", checkpoint="x"))


def test_the_model_is_asked_what_our_client_sends() -> None:
    policy = served(OfficialPolicy())
    observation, chunk = first(policy)
    np.testing.assert_equal(policy.policy.calls[0], FamilyOptions().request(observation))
    assert chunk.shape == (50, 14) and chunk.dtype == np.float32


def test_noise_is_given_and_follows_from_the_seed() -> None:
    policy, chunks = served(OfficialPolicy()), []
    for seed in (1, 1, 2):
        policy.reset(trial(seed))
        chunks.append(policy.infer(seen(policy.spec)))
    assert np.array_equal(chunks[0], chunks[1])
    assert not np.array_equal(chunks[0], chunks[2])


def test_several_are_one_call_where_the_class_allows() -> None:
    one, many = served(OfficialPolicy()), served(BatchingPolicy())
    assert (one.spec.batch, many.spec.batch) == (1, 8)
    chunks = []
    for policy in (one, many):
        for session in (1, 2):
            policy.reset_session(session, trial(session))
        chunks.append(policy.infer_batch([seen(policy.spec)] * 2, [1, 2]))
    np.testing.assert_array_equal(chunks[0], chunks[1])
    assert many.policy.calls == [{"together": 2}]


def test_adapt_to_pi_is_refused_unless_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    configure(monkeypatch, adapt_to_pi=True)
    with pytest.raises(ValueError, match="adapt_to_pi on"):
        openpi.create(openpi.OpenPiServerOptions(config="c", checkpoint="x"))
    accepted = openpi.create(
        openpi.OpenPiServerOptions(config="c", checkpoint="x", adapt_to_pi="accept")
    )
    assert accepted.spec.horizon == 50


def test_a_configuration_of_robotwin_is_served(monkeypatch: pytest.MonkeyPatch) -> None:
    configure(monkeypatch, adapt_to_pi=False)
    policy = openpi.create(openpi.OpenPiServerOptions(config="c", checkpoint="x", execute=25))
    assert (policy.spec.name, policy.spec.execute, policy.shape) == ("openpi:c", 25, (50, 32))
    assert policy.spec.text_budget == 150
    assert {"pictures=224x224, padded", "dtype=bfloat16"} < {*policy.spec.contract}


MODEL = SimpleNamespace(
    action_horizon=50, action_dim=32, max_token_len=200, discrete_state_input=True, dtype="bfloat16"
)


def configure(monkeypatch: pytest.MonkeyPatch, adapt_to_pi: bool) -> None:
    """openpi with one configuration."""
    config = SimpleNamespace(data=SimpleNamespace(adapt_to_pi=adapt_to_pi), model=MODEL)
    install(monkeypatch, "openpi.training.config", get_config=lambda name: config)
    install(
        monkeypatch,
        "openpi.policies.policy_config",
        create_trained_policy=lambda config, folder: OfficialPolicy(),
    )


def kept(kind: str) -> Any:
    """A stand-in of one of openpi's dataclasses: keeps its fields."""
    return lambda *args, **fields: SimpleNamespace(kind=kind, args=args, **fields)


@pytest.fixture
def configs(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """openpi without weights; its list of configurations."""
    known: dict[str, Any] = {}

    def model(**fields: Any) -> Any:
        return SimpleNamespace(
            **vars(MODEL), get_freeze_filter=lambda: sorted(fields), fields=fields
        )

    install(
        monkeypatch,
        "openpi.training.config",
        _CONFIGS_DICT=known,
        get_config=known.__getitem__,
        TrainConfig=kept("train"),
        LeRobotAlohaDataConfig=kept("aloha"),
        DataConfig=kept("data"),
    )
    install(monkeypatch, "openpi.models.pi0_config", Pi0Config=model)
    transforms = {"Group": kept("group"), "RepackTransform": kept("repack")}
    install(monkeypatch, "openpi.transforms", **transforms)
    loader = {"CheckpointWeightLoader": kept("weights")}
    install(monkeypatch, "openpi.training.weight_loaders", **loader)
    return known


def test_the_configuration_is_the_papers(configs: dict[str, Any]) -> None:
    made = openpi.train_config("pi05_robospa_Pick_Blocks_Size")
    assert made.name == "pi05_robospa_Pick_Blocks_Size"
    assert (made.num_train_steps, made.batch_size) == (20_000, 16)
    assert made.model.fields == {"pi05": True}
    assert made.weight_loader.args == ("gs://openpi-assets/checkpoints/pi05_base/params",)
    data = made.data
    assert data.kind == "aloha" and data.repo_id == "robospa/Pick_Blocks_Size"
    assert (data.adapt_to_pi, data.use_delta_joint_actions) == (False, True)
    assert data.base_config.prompt_from_task is True
    assert not hasattr(made, "freeze_filter")


def test_the_names_read_at_training_are_those_sent_at_evaluation(configs: dict[str, Any]) -> None:
    made = openpi.train_config("pi05_robospa_x")
    (repacked,) = made.data.repack_transforms.inputs
    (structure,) = repacked.args
    observation: Any = {
        "images": {name: np.zeros((2, 2, 3), np.uint8) for name in openpi.CAMERAS.values()},
        "state": np.zeros(ActionSpace("joint").width),
        "instruction": "Go.",
    }
    sent = FamilyOptions().request(observation)
    assert set(structure) == {*sent, "actions"}
    assert set(structure["images"]) == set(sent["images"])  # type: ignore[call-overload]
    assert structure["images"]["cam_left_wrist"] == "observation.images.left_wrist"
    assert {CAMERA_NAMES[ours]: ours for ours in openpi.CAMERAS.values()} == openpi.CAMERAS


@pytest.mark.parametrize("name", ["pi05_robospa_", "pi05_aloha", "pi05_robospa_a/b", "x"])
def test_another_name_is_refused(name: str, configs: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="no configuration of ours"):
        openpi.train_config(name)


def test_a_script_of_openpi_finds_the_configurations_that_it_is_given(
    configs: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "train.py"
    script.write_text(
        "import importlib, pathlib, sys\n"
        "c = importlib.import_module('openpi.training.config')\n"
        "pathlib.Path(sys.argv[-1]).write_text(' '.join([__name__, *sorted(c._CONFIGS_DICT)]))\n"
    )
    monkeypatch.setattr(sys, "argv", ["before"])
    monkeypatch.setattr(sys, "path", list(sys.path))
    out = tmp_path / "out"
    openpi.main([str(script), "pi05_robospa_a", "--policy.config=pi05_lora_robospa_b", str(out)])
    assert out.read_text() == "__main__ pi05_lora_robospa_b pi05_robospa_a"


def preset(scheme: str, metadata: Any, *answers: Any) -> Family:
    """A server of the family: greets with `metadata`, answers `answers` one after another."""
    left = iter(answers)
    server = Family(lambda seen: next(left))
    server.scheme, server.metadata = scheme, metadata
    return server


STARVLA = {"env": "starvla_policy_server", "ckpt_path": "1.pt"}


def test_starvla_is_asked_and_read_in_its_own_order() -> None:
    chunk = np.arange(28.0).reshape(1, 2, 14)
    server = preset("starvla", STARVLA, {"status": "ok", "data": {"actions": chunk}})
    found = answered(server, "?joints=state[]")
    assert found[0].tolist() == [0, 1, 2, 3, 4, 5, 12, 6, 7, 8, 9, 10, 11, 13]
    (asked,) = server.requests[0]["examples"]
    assert [shown.shape for shown in asked["image"]] == [(224, 224, 3)] * 3
    assert asked["lang"] == "pick the red block" and server.requests[0]["use_ddim"] is True
    joints = np.concatenate([STATE[:6], STATE[7:13], STATE[[6, 13]]])
    assert np.array_equal(asked["state"], joints[None])
    assert float(asked["image"][0][0, 0, 2]) == image(HEAD)[0, 0, 2]


@pytest.mark.parametrize(
    ("rows", "size", "theirs"),
    [(240, 224, "bfcf0fdc"), (448, 224, "0250b6bc"), (240, 80, "40f8b6d1")],
)
def test_pictures_are_shrunk_to_the_bits_of_opencv(
    rows: int, size: int, theirs: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`theirs`: the SHA-256 of what OpenCV 5.0 makes of it; here without it."""
    monkeypatch.setitem(sys.modules, "cv2", None)
    noise = np.random.default_rng(0).integers(0, 256, (rows, max(rows, 320), 3), np.uint8)
    assert sha256(openpi_family.shrunk(noise, size).tobytes()).hexdigest()[:8] == theirs


def test_a_server_that_cannot_answer_is_refused_before_the_first_trial() -> None:
    broken = {"status": "error", "error": {"message": "unnorm_key not specified"}}
    server = preset("starvla", STARVLA, broken)
    with server as url, pytest.raises(RunError, match=r"no trial was begun: .*unnorm_key not"):
        probe(url, {"timeouts": QUICK}, look=True)


def test_vllm_and_lingbot_are_told_of_a_trial_and_have_names_of_their_own() -> None:
    done = {"status": "reset successful"}
    server = preset("vllm", {"image_resolution": [1, 1]}, done, np.ones((50, 32), np.float32))
    assert answered(server).shape == (50, 14)
    assert server.requests[0] == {"endpoint": "reset"}
    assert server.requests[1]["images"]["observation.images.base_0_rgb"].shape == (240, 320, 3)
    server = preset("lingbot", {}, {"action": None}, {"action": joint_chunk()})
    assert np.array_equal(answered(server), joint_chunk().astype(np.float32))
    assert server.requests[0] == {"reset": True, "robo_name": "robotwin"}
    names = [f"observation.images.cam_{name}" for name in ("high", "left_wrist", "right_wrist")]
    assert sorted(server.requests[1]) == sorted([*names, "observation.state", "task"])


def test_gr00t_behind_vllm_is_refused_by_name() -> None:
    greeting = {"image_resolution": [180, 320], "action_keys": ["eef_9d"]}
    with pytest.raises(HandshakeError, match=r"serves GR00T.* use gr00t://"):
        answered(preset("vllm", greeting))


@pytest.mark.parametrize("of", ["last", "start"])
def test_changes_of_joints_are_added_up_over_a_trial(of: str) -> None:
    changes = np.full((1, 3, 14), 0.25)
    server = preset("starvla", STARVLA, *[{"data": {"actions": changes}}] * 3)
    with talking(server, f"?deltas={of}&execute=2") as policy:
        for step, before in ((0, 0), (2, 2), (0, 0)):
            if step == 0:
                policy.reset(TRIAL)
            chunk = policy.infer(observation(step, state=STATE + np.float32(step)))
            rows = np.arange(1, 4) + before if of == "last" else np.ones(3)
            assert np.allclose(chunk, STATE + 0.25 * rows[:, None], atol=1e-6)
    assert "state" not in server.requests[0]["examples"][0]


def test_a_period_in_which_the_robot_held_is_no_executed_action() -> None:
    server = preset("starvla", STARVLA, *[{"data": {"actions": np.full((1, 9, 14), 0.25)}}] * 2)
    with talking(server, "?deltas=last&execute=2") as policy:
        policy.infer(observation(executed=0))
        chunk = policy.infer(observation(step=5, executed=2))
    assert np.allclose(chunk[0], STATE + 0.75, atol=1e-6)
    assert server.requests[0].keys() == server.requests[1].keys() - {"executed"}


def test_an_idle_connection_is_made_anew_to_the_same_server_alone() -> None:
    metadata = {"image_resolution": [1, 1], "ckpt": "1"}
    server = preset("vllm", metadata, *[np.ones((1, 14), np.float32)] * 2)
    with talking(server, "?idle=0.01&reset={}") as policy:
        for _ in range(2):
            time.sleep(0.02)
            assert policy.infer(observation()).shape == (1, 14)
        server.metadata = {**metadata, "ckpt": "2"}
        time.sleep(0.02)
        with pytest.raises(ConnectionLost, match="another server"):
            policy.infer(observation())


class Counting(OpenPi):
    """Answers how many queries the connection has had; it is closed after `lasts`."""

    lasts = 10

    def talk(self, socket: Any) -> None:
        socket.send(msgpack.packb(self.metadata))
        for count in range(self.lasts):
            socket.recv()
            socket.send(msgpack.packb({"actions": np.full((1, 14), count)}, default=OPENPI.write))


def until_cut(policy: Any) -> None:
    until(lambda: policy._session._transport._socket.protocol.state is State.CLOSED)


def test_a_connection_for_every_trial_lets_a_server_begin_anew() -> None:
    for query, counts in (("", [0, 1, 2, 3]), ("?connection=trial", [0, 1, 0, 1])):
        found = []
        with talking(Counting(), query) as policy:
            for _ in range(2):
                policy.reset(TRIAL)
                found += [float(policy.infer(observation())[0, 0]) for _ in range(2)]
        assert found == counts


def test_a_connection_cut_between_two_questions_is_made_anew_and_said(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "LONG_IDLE", 0.0)
    server = Counting()
    server.lasts = 1
    with talking(server) as policy:
        policy.reset(TRIAL)
        for _ in range(2):
            assert policy.infer(observation())[0, 0] == 0
            until_cut(policy)
    assert caplog.records[0].message.endswith("; connected again")


@pytest.mark.parametrize(
    ("idle", "told", "greeting"),
    [
        (0.0, {"reset": '{"begin": 1}'}, {}),
        (0.0, {"connection": "trial"}, {}),
        (0.0, {}, {"robospa": {}}),
        (9.0, {}, {}),
    ],
)
def test_but_not_where_a_trial_would_begin_anew_or_a_server_crashed(
    idle: float, told: dict[str, str], greeting: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "LONG_IDLE", idle)
    server = Counting()
    server.lasts, server.metadata = 2 if "reset" in told else 1, greeting
    with talking(server, **told) as policy:
        policy.reset(TRIAL)
        policy.infer(observation())
        until_cut(policy)
        with pytest.raises(ConnectionLost, match="while nothing was asked"):
            policy.infer(observation())
        policy.reconnect()
        policy.reset(TRIAL)
        policy.infer(observation())
        until_cut(policy)
        if told:  # between trials no trial is lost
            policy.reset(TRIAL)
            assert policy.infer(observation())[0, 0] == server.lasts - 1


@pytest.mark.parametrize(
    "answer",
    [
        {"error": "CUDA out of memory"},
        {"status": "error", "ok": False, "error": {"message": "CUDA out of memory"}},
        {"type": "error", "message": "CUDA out of memory"},
    ],
)
def test_an_error_in_a_map_keeps_its_reason(answer: Any) -> None:
    with pytest.raises(ServerError, match="CUDA out of memory"):
        answered(preset("openpi", {}, answer))


def test_a_server_of_ones_own_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('images = ""\nnames = "head:top"\ncameras = "head"\nlayout = "hwc"\n')
    server = preset("openpi", {}, {"actions": joint_chunk()})
    with talking(server, **client_options("openpi://host", file)) as policy:
        policy.infer(observation(images={HEAD: image(HEAD)}))
    assert np.array_equal(server.requests[0]["top"], image(HEAD))
