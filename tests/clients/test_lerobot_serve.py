"""A LeRobot policy gets the keys, sizes and widths of its own configuration, through processors."""

from collections import deque
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, first, install, seen, tensor, trial

from robospa.clients import lerobot as lerobot
from robospa.clients.lerobot import match_cameras, print_state
from robospa.clients.model_policy import ModelMissing
from robospa.observation import WIDTH

HEAD = "observation.images.head_camera"
VIEWS = {
    HEAD: (3, 240, 320),
    "observation.images.left_camera": (3, 120, 160),
    "observation.images.right_camera": (3, 224, 224),
}


class Processor:
    """Keeps what passed; `steps` as LeRobot's pipelines have."""

    def __init__(self, *steps: Any) -> None:
        self.steps = list(steps)
        self.seen: list[Any] = []

    def __call__(self, value: Any) -> Any:
        self.seen.append(value)
        return dict(value) if isinstance(value, dict) else value


class OfficialPolicy:
    """Answers the state in every row, plus noise in column 0."""

    def __init__(self, torch: Any, config: Any) -> None:
        self.torch, self.config = torch, config
        self.calls: list[dict[str, Any]] = []
        self._queues: dict[str, Any] = {}

    def reset(self) -> None:
        frames = getattr(self.config, "n_obs_steps", 1)
        keys = ("action", "observation.state", "observation.images")
        self._queues = {key: deque(maxlen=frames) for key in keys}

    def eval(self) -> Any:
        return self

    def predict_action_chunk(self, batch: dict[str, Any]) -> Any:
        self.calls.append(batch)
        rows = len(batch["task"])
        width = self.config.output_features["action"].shape[0]
        answer = np.zeros((rows, self.config.chunk_size, width), np.float32)
        if "observation.state" in batch:
            answer += np.asarray(batch["observation.state"])[:, None, :width]
        answer[..., 0] += np.asarray(self.torch.randn(rows, self.config.chunk_size))
        return tensor(answer)


def config(views: Any = VIEWS, state: int = 14, action: int = 14, **more: Any) -> Any:
    """A configuration as LeRobot has them."""
    features = {key: SimpleNamespace(shape=shape) for key, shape in views.items()}
    inputs = {**features, "observation.state": SimpleNamespace(shape=(state,))}
    values = {
        "type": "pi05",
        "n_obs_steps": 1,
        "chunk_size": 50,
        "n_action_steps": 50,
        "input_features": inputs,
        "image_features": features,
        "output_features": {"action": SimpleNamespace(shape=(action,))},
        **more,
    }
    return SimpleNamespace(**values)


def served(torch: Any, chosen: Any = None, *steps: Any, **given: Any) -> lerobot.LeRobot:
    """A policy behind a processor of these steps."""
    policy = OfficialPolicy(torch, chosen or config())
    options = lerobot.LeRobotServerOptions(path="x", **given)
    return lerobot.LeRobot(policy, Processor(*steps), Processor(), options)


def test_a_batch_is_what_the_data_loader_gives(torch: Any) -> None:
    policy = served(torch)
    observation, _ = first(policy)
    batch = policy.before.seen[0]
    assert set(batch) == {*VIEWS, "observation.state", "task"}
    assert batch["task"] == [trial().instruction]
    assert np.array_equal(batch["observation.state"][0], observation["state"])
    for (key, shape), color in zip(VIEWS.items(), COLORS.values(), strict=True):
        assert batch[key].shape == (1, *shape) and batch[key].dtype == np.float32
        np.testing.assert_allclose(batch[key][0, :, 0, 0], np.array(color) / 255, atol=1e-6)


def test_a_policy_may_read_the_objects_as_numbers(torch: Any) -> None:
    chosen = config({})
    chosen.input_features["observation.environment_state"] = SimpleNamespace(shape=(WIDTH,))
    policy = served(torch, chosen)
    assert policy.spec.environment_state and not policy.spec.cameras
    objects = np.arange(WIDTH, dtype=np.float32)
    policy.reset(trial())
    policy.infer({**seen(policy.spec), "environment_state": objects})
    assert np.array_equal(policy.before.seen[0]["observation.environment_state"], objects[None])


def test_images_renamed_in_training_are_sent_under_the_data_sets_names(torch: Any) -> None:
    keys = [f"observation.images.camera{i}" for i in (1, 2, 3)]
    ours = [f"observation.images.{name}" for name in ("head", "left_wrist", "right_wrist")]
    chosen = config(dict.fromkeys(keys, (3, 256, 256)))
    rename = SimpleNamespace(rename_map=dict(zip(ours, keys, strict=True)))
    policy = served(torch, chosen, rename)
    assert [camera.name for camera in policy.spec.cameras] == list(COLORS)
    first(policy)
    batch = policy.before.seen[0]
    assert set(batch) == {*ours, "observation.state", "task"}
    for key, color in zip(ours, COLORS.values(), strict=True):
        assert batch[key].shape == (1, 3, 240, 320), "256x256 was the size of other data"
        np.testing.assert_allclose(batch[key][0, :, 0, 0], np.array(color) / 255, atol=1e-6)


@pytest.mark.parametrize("declared", [6, 20])
def test_the_state_is_as_wide_as_it_was_in_training(torch: Any, declared: int) -> None:
    stats = {"observation.state": {"count": 5.0, "mean": np.zeros(14)}}
    steps = SimpleNamespace(), SimpleNamespace(stats=stats)
    policy = served(torch, config(state=declared), *steps)
    observation, _ = first(policy)
    assert np.array_equal(policy.before.seen[0]["observation.state"][0], observation["state"])
    assert policy.spec.contract[0].startswith("normalisation=")


def test_the_answer_goes_through_the_processor_and_out(torch: Any) -> None:
    policy = served(torch, config(chunk_size=20, n_action_steps=10))
    observation, chunk = first(policy)
    assert policy.after.seen[0].shape == (1, 20, 14)
    assert chunk.shape == (20, 14) and chunk.dtype == np.float32
    np.testing.assert_allclose(chunk[:, 1:], np.tile(observation["state"][1:], (20, 1)))
    assert (policy.spec.horizon, policy.spec.execute, policy.spec.action_dim) == (20, 10, 14)
    assert policy.spec.text_budget is None


@pytest.mark.parametrize(("kind", "tokens", "budget"), [("xvla", 64, 64), ("pi05", 200, 150)])
def test_the_tokens_that_it_reads_are_declared(
    torch: Any, kind: str, tokens: int, budget: int
) -> None:
    policy = served(torch, config(type=kind, tokenizer_max_length=tokens))
    assert policy.spec.text_budget == budget


def test_a_batch_gives_what_singles_give(torch: Any) -> None:
    policy = served(torch)
    for session in range(3):
        policy.reset_session(session, trial(session))
    asked = [seen(policy.spec) for _ in range(3)]
    together = policy.infer_batch(asked, [0, 1, 2])
    assert len(policy.policy.calls) == 1
    for session, one in enumerate(asked):
        np.testing.assert_array_equal(policy.infer_batch([one], [session])[0], together[session])
    assert not np.array_equal(together[0], together[1])


def test_a_policy_with_odd_noise_is_asked_one_by_one(torch: Any) -> None:
    policy = served(torch)

    def odd(batch: Any) -> Any:
        policy.policy.calls.append(batch)
        return tensor(np.tile(np.asarray(torch.randn(14)), (len(batch["task"]), 50, 1)))

    policy.policy.predict_action_chunk = odd
    for session in (1, 2):
        policy.reset_session(session, trial(session))
    one, two = policy.infer_batch([seen(policy.spec)] * 2, [1, 2])
    assert [len(call["task"]) for call in policy.policy.calls] == [2, 1, 1]
    assert not np.array_equal(one, two)


def test_earlier_frames_are_queued_oldest_first(
    torch: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def populate(queues: Any, batch: Any, exclude: Any) -> Any:
        assert exclude == ["action"]
        for key in set(queues) & set(batch):
            queues[key].append(batch[key])
        return queues

    install(monkeypatch, "lerobot.policies.utils", populate_queues=populate)
    policy = served(torch, config({HEAD: (3, 240, 320)}, n_obs_steps=3))
    assert policy.spec.history == (-2, -1)
    policy.reset(trial())
    observation = seen(policy.spec, step=5)
    observation["history"][-2]["state"] = np.full(14, -9, np.float32)
    policy.infer(observation)
    states = policy.policy._queues["observation.state"]
    assert [float(s[0, 13]) for s in states] == [-9.0, 0.5, 1.0]
    images = policy.policy._queues["observation.images"]
    assert [image.shape for image in images] == [(1, 1, 3, 240, 320)] * 3


def test_poses_in_and_out(torch: Any) -> None:
    policy = served(torch, config(state=20, action=20), closed_above=-0.5)
    observation, chunk = first(policy)
    chunk = chunk.reshape(50, 2, 8)
    told = policy.before.seen[0]["observation.state"][0]
    assert told.shape == (20,)
    np.testing.assert_allclose(told[3:9], [1, 0, 0, 0, 0, 1], atol=1e-6)
    assert policy.spec.action == "ee" and policy.spec.action_dim == 16
    np.testing.assert_allclose(chunk[0, 1, :7], observation["ee"][1, :7], atol=1e-6)
    assert chunk[0, :, 7].tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ("keys", "images", "cameras"),
    [
        (("cam_high", "cam_left_wrist", "cam_right_wrist"), None, ["head", "left", "right"]),
        (("image", "image2", "empty_camera_0"), "head:IMAGE,left_wrist:IMAGE2", ["head", "left"]),
        (("top", "wrist_right"), None, ["head", "right"]),
    ],
)
def test_cameras_go_by_names(keys: Any, images: Any, cameras: list[str]) -> None:
    prefix = "observation.images."
    told = images and images.replace("IMAGE", prefix + "image")
    views = match_cameras({prefix + key: (3, 8, 8) for key in keys}, told)
    assert [view.camera.split("_")[0] for view in views] == cameras


@pytest.mark.parametrize(
    ("keys", "images", "words"),
    [
        (("image",), None, "does not tell which camera"),
        (("left_head",), None, "does not tell which camera"),
        (("head", "top"), None, "the same camera"),
        (("image",), "hat:observation.images.image", "no camera:key"),
        (("image",), "head:observation.images.other", "no camera:key"),
    ],
)
def test_cameras_that_cannot_be_told(keys: Any, images: Any, words: str) -> None:
    features = {f"observation.images.{key}": (3, 8, 8) for key in keys}
    with pytest.raises(ValueError, match=words):
        match_cameras(features, images)


@pytest.mark.parametrize("width", [14, 32])
def test_both_sides_of_the_state_prompt_change(torch: Any, width: int) -> None:
    class Pi05PrepareStateTokenizerProcessorStep:
        max_state_dim = 32

    step = Pi05PrepareStateTokenizerProcessorStep()
    before = Processor(object(), step)
    print_state(before, width)
    assert before.steps[2] is step and step.max_state_dim == width
    state = tensor(np.ones((2, 14), np.float32))
    transition = {"observation": {"observation.state": state}, "task": ["a", "b"]}
    padded = before.steps[1](transition)["observation"]["observation.state"]
    assert padded.shape == (2, width) and float(padded.sum()) == 28.0
    assert transition["observation"]["observation.state"].shape == (2, 14)


def test_loading_offline(torch: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}
    chosen = config(tokenizer_name="facebook/bart-large")
    domain = SimpleNamespace(domain_id=0)

    class Policies:
        @classmethod
        def from_pretrained(cls, path: str, config: Any) -> Any:
            asked["device"] = config.device
            return OfficialPolicy(torch, config)

    def processors(config: Any, path: str, preprocessor_overrides: Any) -> Any:
        asked["overrides"] = preprocessor_overrides
        return Processor(domain), Processor()

    configs = SimpleNamespace(from_pretrained=lambda path: chosen)
    install(monkeypatch, "lerobot.configs.policies", PreTrainedConfig=configs)
    install(
        monkeypatch,
        "lerobot.policies.factory",
        get_policy_class=lambda name: Policies,
        make_pre_post_processors=processors,
    )
    lerobot.create(
        lerobot.LeRobotServerOptions(path="x", device="cpu", tokenizer="words", domain_id=6)
    )
    assert asked["device"] == "cpu" and domain.domain_id == 6
    assert chosen.tokenizer_name == "words"
    assert asked["overrides"] == {
        "device_processor": {"device": "cpu"},
        "tokenizer_processor": {"tokenizer_name": "words"},
    }
    with pytest.raises(ValueError, match=r"state_prompt is for pi0\.5"):
        lerobot.create(lerobot.LeRobotServerOptions(path="x", state_prompt=32))


def test_a_checkpoint_that_is_not_there(torch: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(path: str) -> Any:
        raise FileNotFoundError("no config.json")

    configs = SimpleNamespace(from_pretrained=nothing)
    install(monkeypatch, "lerobot.configs.policies", PreTrainedConfig=configs)
    install(monkeypatch, "lerobot.policies.factory")
    with pytest.raises(ModelMissing, match=r"cannot load x: no config\.json"):
        lerobot.create(lerobot.LeRobotServerOptions(path="x"))


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        (config(action=7), "action has 7 numbers"),
        (config(state=9), "state has 9 numbers"),
        (config({**VIEWS, "observation.environment_state": (3,)}), "environment_state"),
        (config(state=20, action=20, n_obs_steps=2), "earlier poses"),
    ],
)
def test_policies_that_are_not_for_this_robot(torch: Any, chosen: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        served(torch, chosen)
