"""X-VLA's server: what exactly it is sent, and what becomes of its answers."""

from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, close, color_of, first, install, seen, tensor, trial
from standins import answered, first_request, talking
from standins_http import (
    EE,
    HEAD,
    STATE,
    TRIAL,
    XVla,
    image,
    joint_chunk,
    observation,
    shows,
)

from robospa.clients import xvla
from robospa.clients.model_policy import ModelMissing
from robospa.protocol.errors import PolicyAnswerError, ProtocolViolation, ServerError


def ee6d(length: int = 2) -> Any:
    """(T, 20): both arms at the origin, not turned by the plain reading of the six numbers."""
    arm = [0.1, 0.2, 0.3, 1, 0, 0, 1, 0, 0, 0.0]
    other = [0.4, 0.5, 0.6, 1, 0, 0, 1, 0, 0, 1.0]
    return np.array([[*arm, *other]] * length)


def test_xvla_is_sent_what_its_server_reads() -> None:
    sent = first_request(XVla(lambda seen: ee6d()))
    images = ("image0", "image1", "image2")
    assert sent.keys() == {*images, "proprio", "language_instruction", "domain_id", "steps"}
    shows(sent, *images)
    assert sent["language_instruction"] == "pick the red block"
    assert sent["domain_id"] == 6
    assert sent["steps"] == 10
    proprio = sent["proprio"].reshape(2, 10)
    assert sent["proprio"].dtype == np.float64
    assert np.array_equal(proprio[:, :3], EE[:, :3])
    assert proprio[:, 9].tolist() == [0.5, -0.5]  # 1 - 2 g


@pytest.mark.parametrize(
    ("query", "six"),
    [
        ("", [1, 0, 0, 0, 0, 1]),  # w x y z read as x y z w: the official slip
        ("?quaternions=wxyz", [0, -1, 1, 0, 0, 0]),
        ("?quaternions=wxyz&rotation=columns", [0, 1, 0, -1, 0, 0]),
    ],
)
def test_xvla_rotations_in_every_order(query: str, six: list[float]) -> None:
    """Of the second arm, whose w x y z are (0.7071, 0, 0, 0.7071)."""
    turned = ee6d()
    turned.reshape(2, 2, 10)[..., 3:9] = (
        [1, 0, 0, 0, 1, 0] if "columns" in query else [1, 0, 0, 1, 0, 0]
    )
    sent = first_request(XVla(lambda seen: turned), query)
    assert sent["proprio"].reshape(2, 10)[1, 3:9] == pytest.approx(six, abs=1e-6)


def test_xvla_poses_come_back_as_ours() -> None:
    """The unturned rotation is q = (w 1, x 0, y 0, z 0); through the slip it is x y z w."""
    for query, quaternion in (("?quaternions=wxyz", [1, 0, 0, 0]), ("", [0, 0, 0, 1])):
        with talking(XVla(lambda seen: ee6d()), query) as policy:
            assert policy.spec.action == "ee"
            chunk = policy.infer(observation())
        assert chunk.shape == (2, 16)
        assert chunk[0, :3] == pytest.approx([0.1, 0.2, 0.3])
        assert chunk[0, 8:11] == pytest.approx([0.4, 0.5, 0.6])
        for start in (3, 11):
            assert chunk[0, start : start + 4] == pytest.approx(quaternion, abs=1e-6)
        assert chunk[0, 7] == 1  # 0.0 says open
        assert chunk[0, 15] == 0  # 1.0 says closed


def test_xvla_is_told_the_last_command_from_the_second_query_on() -> None:
    server = XVla(lambda seen: ee6d() + np.linspace(0, 0.1, 2)[:, None] * (np.arange(20) % 10 < 3))
    with talking(server) as policy:
        policy.reset(TRIAL)
        policy.infer(observation(0))
        policy.infer(observation(2))
        policy.reset(TRIAL)
        policy.infer(observation(0))
    first, second, third = (seen["proprio"].reshape(2, 10) for seen in server.requests)
    assert np.array_equal(first[:, :3], EE[:, :3])
    assert second[0, :3] == pytest.approx([0.2, 0.3, 0.4])
    assert second[0, 3:9] == pytest.approx([1, 0, 0, 1, 0, 0], abs=1e-6)
    assert second[:, 9].tolist() == [-1, 1]  # open, closed
    assert np.array_equal(third, first)


def test_xvla_options_of_view_colour_text_and_domain() -> None:
    query = "?cameras=head&colors=bgr&domain_id=0&steps=5&text=task"
    sent = first_request(XVla(lambda seen: ee6d()), query)
    assert {name for name in sent if name.startswith("image")} == {"image0"}
    assert np.array_equal(sent["image0"], image(HEAD)[..., ::-1])
    assert (sent["domain_id"], sent["steps"]) == (0, 5)
    assert sent["language_instruction"] == "Pick Blocks Size"


@pytest.mark.parametrize(("meaning", "sign"), [("open", 1), ("closed", -1)])
def test_xvla_in_joint_space(meaning: str, sign: int) -> None:
    chunk = joint_chunk()
    chunk[:, [6, 13]] = 0.125
    server = XVla(lambda seen: chunk, proprio=14)
    query = f"?space=joint&joint_grippers={meaning}"
    with talking(server, query) as policy:
        assert policy.spec.action == "joint"
        answer = policy.infer(observation())
    assert answer[:, 6].tolist() == [0.125 if sign == 1 else 0.875] * 3
    assert np.array_equal(answer[:, :6], chunk[:, :6].astype(np.float32))
    grippers = server.requests[0]["proprio"][[6, 13]]
    assert grippers.tolist() == ([0.25, 0.75] if sign == 1 else [0.75, 0.25])
    assert np.array_equal(server.requests[0]["proprio"][:6], STATE[:6])


def test_xvlas_silent_400_points_to_its_log() -> None:
    with talking(XVla(lambda seen: 1 / 0)) as policy:
        with pytest.raises(ServerError, match=r"HTTP 400: Request failed.*its log") as caught:
            policy.infer(observation())
        assert caught.value.retriable


@pytest.mark.parametrize(
    ("answer", "error", "words"),
    [
        ({"action": [[0.0] * 14] * 2}, PolicyAnswerError, "option space"),
        ({"action": [0.0] * 20}, PolicyAnswerError, "option space"),
        ({"action": [[0.0] * 20] * 2}, PolicyAnswerError, "rotation"),
        ({"actions": []}, ProtocolViolation, "did not answer an 'action'"),
    ],
)
def test_xvla_answers_that_cannot_be(answer: Any, error: Any, words: str) -> None:
    with pytest.raises(error, match=words):
        answered(XVla(None, answer))


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


def asked(policy: xvla.Xvla) -> dict[str, Any]:
    """What the model is given at the first query of a trial."""
    first(policy)
    call: dict[str, Any] = policy.model.calls[0]
    return call


@pytest.mark.parametrize(
    ("quaternions", "six"), [("xyzw", [1, 0, 0, 0, 0, 1]), ("wxyz", [0, -1, 1, 0, 0, 0])]
)
def test_one_call_holds_what_the_official_server_would_send(
    torch: Any, quaternions: str, six: list[float]
) -> None:
    call = asked(served(torch, quaternions=quaternions))
    from_processor = {"input_ids", "image_input", "image_mask"}
    assert call.keys() == from_processor | {"proprio", "domain_id", "steps"}
    assert call["steps"] == 10
    assert call["domain_id"].tolist() == [6] and call["domain_id"].dtype == np.int64
    assert call["proprio"].shape == (1, 20) and call["proprio"].dtype == np.float32
    assert call["image_input"].dtype == np.float32
    np.testing.assert_allclose(call["proprio"][0][3:9], six, atol=1e-6)
    np.testing.assert_allclose(call["proprio"][0][[9, 19]], [-1, 1])


@pytest.mark.parametrize("colors", ["rgb", "bgr"])
def test_views_are_head_left_right(torch: Any, colors: str) -> None:
    policy = served(torch, colors=colors)
    asked(policy)
    turn = 1 if colors == "rgb" else -1
    for view, name in zip(policy.processor.views[0], COLORS, strict=True):
        assert view.size == (320, 240)
        assert close(color_of(view), COLORS[name][::turn], 0)


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
    _, chunk = first(policy)
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
