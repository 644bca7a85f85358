"""X-VLA gets views, proprioception and domain as its own server would give them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, close, color_of, install, seen, tensor, trial

from robospa.clients import xvla
from robospa.clients.model_policy import ModelMissing
from robospa.protocol.errors import PolicyAnswerError


class OfficialXvla:
    """Answers the proprioception it was given, in all 30 rows, positions moved by noise."""

    def __init__(self, torch: Any) -> None:
        self.torch = torch
        self.calls: list[dict[str, Any]] = []

    def parameters(self) -> Any:
        return iter([tensor(np.zeros(1, np.float32))])

    def to(self, *where: Any) -> Any:
        return self

    def eval(self) -> Any:
        return self

    def generate_actions(self, **given: Any) -> Any:
        self.calls.append(given)
        told = np.asarray(given["proprio"])
        noise = self.torch.randn(*told.shape[:1], 30, told.shape[1], dtype=np.float32)
        answer = np.repeat(told[:, None], 30, axis=1)
        answer[..., :3] += np.asarray(noise)[..., :3]
        for column in (9, 19) if told.shape[1] == 20 else (6, 13):
            answer[..., column] = told[:, None, column] > 0
        return tensor(answer)


class Processor:
    """Keeps the views; ids are the lengths of the texts."""

    def __init__(self) -> None:
        self.views: list[Any] = []

    def __call__(self, images: list[Any], text: str) -> dict[str, Any]:
        self.views.append(images)
        return {
            "input_ids": tensor(np.full((1, 50), len(text))),
            "image_input": tensor(np.zeros((1, 3, 3, 224, 224))),
            "image_mask": tensor(np.arange(3)[None] < len(images)),
        }


def served(torch: Any, **given: Any) -> xvla.Xvla:
    return xvla.Xvla(
        OfficialXvla(torch), Processor(), xvla.XvlaServerOptions(checkpoint="x", **given)
    )


def test_one_call_holds_what_the_official_server_would_send(torch: Any) -> None:
    policy = served(torch)
    policy.reset(trial())
    policy.infer(seen(policy.spec))
    call = policy.model.calls[0]
    assert set(call) == {
        "input_ids",
        "image_input",
        "image_mask",
        "proprio",
        "domain_id",
        "steps",
    }
    assert call["steps"] == 10
    assert call["domain_id"].tolist() == [6] and call["domain_id"].dtype == np.int64
    assert call["proprio"].shape == (1, 20) and call["proprio"].dtype == np.float32
    assert call["image_input"].dtype == np.float32


def test_the_official_slip_and_the_grippers_in_proprioception(torch: Any) -> None:
    policy = served(torch)
    policy.reset(trial())
    policy.infer(seen(policy.spec))
    told = policy.model.calls[0]["proprio"][0]
    np.testing.assert_allclose(told[3:9], [1, 0, 0, 0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(told[[9, 19]], [-1, 1])


def test_the_correct_quaternion_order_on_request(torch: Any) -> None:
    policy = served(torch, quaternions="wxyz")
    policy.reset(trial())
    policy.infer(seen(policy.spec))
    told = policy.model.calls[0]["proprio"][0]
    np.testing.assert_allclose(told[3:9], [0, -1, 1, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize("colors", ["rgb", "bgr"])
def test_views_are_head_left_right(torch: Any, colors: str) -> None:
    policy = served(torch, colors=colors)
    policy.reset(trial())
    policy.infer(seen(policy.spec))
    turn = 1 if colors == "rgb" else -1
    for view, name in zip(policy.processor.views[0], COLORS, strict=True):
        assert view.size == (320, 240)
        assert close(color_of(view), COLORS[name][::turn], 0)


def test_poses_come_back_as_they_went(torch: Any) -> None:
    policy = served(torch)
    policy.reset(trial())
    observation = seen(policy.spec)
    chunk = policy.infer(observation).reshape(30, 2, 8)
    ee = observation["ee"]
    assert chunk.dtype == np.float32
    np.testing.assert_allclose(chunk[:, 1, :3], np.tile(ee[1, :3], (30, 1)), atol=1e-6)
    np.testing.assert_allclose(
        np.abs(np.sum(chunk[..., 3:7] * ee[:, 3:7], axis=-1)), 1.0, atol=1e-5
    )
    assert chunk[:, :, 7].tolist() == [[1.0, 0.0]] * 30  # the left gripper is open


def test_the_last_command_stands_for_the_robot(torch: Any) -> None:
    policy = served(torch)
    policy.reset(trial())
    first = policy.infer(seen(policy.spec)).reshape(30, 2, 8)
    policy.infer(seen(policy.spec, step=12))
    np.testing.assert_allclose(policy.model.calls[1]["proprio"][0][:3], first[11, 0, :3], rtol=1e-6)
    policy.reset(trial())
    policy.infer(seen(policy.spec, step=0))
    np.testing.assert_allclose(policy.model.calls[2]["proprio"][0][:3], [-0.3, 0.1, 0.9], rtol=1e-6)


def test_a_batch_gives_what_singles_give(torch: Any) -> None:
    policy = served(torch)
    for session in range(3):
        policy.reset_session(session, trial(session))
    asked = [seen(policy.spec, instruction="a" * n) for n in (1, 2, 3)]
    together = policy.infer_batch(asked, [0, 1, 2])
    assert policy.model.calls[0]["input_ids"][:, 0].tolist() == [1, 2, 3]
    for session, one in enumerate(asked):
        policy.reset_session(session, trial(session))
        np.testing.assert_array_equal(policy.infer_batch([one], [session])[0], together[session])
    assert not np.array_equal(together[0], together[1])


def test_a_joint_fine_tune(torch: Any) -> None:
    policy = served(torch, space="joint")
    policy.reset(trial())
    observation = seen(policy.spec)
    chunk = policy.infer(observation)
    told = policy.model.calls[0]["proprio"][0]
    assert told.shape == (14,) and told[6] == 0.5 and told[13] == -1.0
    assert chunk.shape == (30, 14) and policy.spec.action == "joint"
    assert chunk[0, 13] == 1.0  # said closed: no


def test_a_fine_tune_in_another_space_is_named(torch: Any) -> None:
    policy = served(torch)
    policy.model.generate_actions = lambda **given: tensor(np.zeros((1, 30, 14)))
    policy.reset(trial())
    with pytest.raises(PolicyAnswerError, match="another space"):
        policy.infer(seen(policy.spec))


def test_a_processor_that_lacks_something(torch: Any) -> None:
    policy = served(torch)
    policy.processor = lambda images, text: {"input_ids": 0}
    policy.reset(trial())
    with pytest.raises(ModelMissing, match="no image_input, image_mask"):
        policy.infer(seen(policy.spec))


def test_the_model_is_loaded_as_its_own_server_does(
    torch: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    class Loads:
        @classmethod
        def from_pretrained(cls, path: str, **given: Any) -> Any:
            asked.append((path, given))
            return OfficialXvla(torch)

    install(monkeypatch, "models.modeling_xvla", XVLA=Loads)
    install(monkeypatch, "models.processing_xvla", XVLAProcessor=Loads)
    xvla.create(xvla.XvlaServerOptions(checkpoint="here"))
    assert asked == [("here", {}), ("here", {"torch_dtype": np.float32})]


@pytest.mark.parametrize(
    "given",
    [{"cameras": "head,head"}, {"domain_id": 30}, {"batch": 0}, {"horizon": 30, "execute": 31}],
)
def test_options_that_cannot_be(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"option"):
        xvla.XvlaServerOptions(checkpoint="x", **given)
