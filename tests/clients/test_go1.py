"""GO-1's server: what exactly it is sent, and what becomes of its answers."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, close, color_of, first, install, seen, tensor, trial
from standins import QUICK, first_request
from standins_http import STATE, Go1, observation, shows
from wire_helpers import self_signed

from robospa.clients import connect, go1
from robospa.clients import rdt as rdt
from robospa.clients.model_policy import (
    BLOCK,
    SAMPLES,
    ModelMissing,
    ModelPolicy,
    NotByRow,
    describe_checkpoint,
    import_code,
    seeded_rows,
)
from robospa.clients.rdt import Embeddings
from robospa.protocol.errors import ConnectFailed, HandshakeError
from robospa.protocol.policy import PolicySpec


def test_go1_is_sent_what_its_server_reads() -> None:
    server = Go1()
    sent = first_request(server)
    assert sent.keys() == {"top", "left", "right", "instruction", "state", "ctrl_freqs"}
    shows(sent, "top", "left", "right")
    assert sent["state"].shape == (1, 14)
    assert sent["state"].dtype == np.float64
    assert np.array_equal(sent["state"][0], STATE)
    assert sent["ctrl_freqs"].shape == (1,)
    assert sent["ctrl_freqs"].tolist() == [30]
    assert sent["ctrl_freqs"].dtype == np.int64
    assert sent["instruction"] == "pick the red block"
    assert server.content_type == "application/json"


def test_tls_and_a_token(tmp_path: Path) -> None:
    inside, trust = self_signed(tmp_path)
    server = Go1()
    server.tls = inside
    with server as plain:
        url = plain.replace("http://", "https://")
        with connect(url, "s3cret", QUICK, ssl=trust) as policy:
            assert policy.infer(observation()).shape == (3, 14)
        with pytest.raises(ConnectFailed, match="SSL_CERT_FILE"):
            connect(url, "s3cret", QUICK)
        with pytest.raises(HandshakeError, match="speaks TLS: use https://"):
            connect(plain, "s3cret", QUICK)
    with Go1() as plain, pytest.raises(ConnectFailed, match="no TLS is spoken there"):
        connect(plain.replace("http://", "https://"), timeouts=QUICK)
    assert server.authorization == "Bearer s3cret"


class OfficialGo1:
    """Adds to the payload, copies its arrays, answers the state in 30 rows plus noise."""

    def __init__(self, torch: Any) -> None:
        self.torch = torch
        self.payloads: list[dict[str, Any]] = []

    def inference(self, payload: dict[str, Any]) -> Any:
        self.payloads.append(dict(payload))
        payload["final_prompt"] = payload["instruction"]
        state = payload["state"].copy()
        payload["ctrl_freqs"].copy()
        return np.repeat(state, 30, 0) + np.asarray(self.torch.randn(1, 30, 14))[0]


def served(torch: Any, **given: Any) -> go1.Go1:
    return go1.Go1(OfficialGo1(torch), go1.Go1ServerOptions(checkpoint="x", **given))


@pytest.mark.parametrize(
    ("wrists", "right", "left"),
    [("correct", "right_wrist", "left_wrist"), ("swapped", "left_wrist", "right_wrist")],
)
def test_the_payload(torch: Any, wrists: str, right: str, left: str) -> None:
    policy = served(torch, wrists=wrists)
    observation, _ = first(policy)
    payload = policy.model.payloads[0]
    assert set(payload) == {"top", "right", "left", "instruction", "state", "ctrl_freqs"}
    assert payload["top"].shape == (240, 320, 3) and payload["top"].dtype == np.uint8
    shown = [color_of(payload[name]) for name in ("top", "right", "left")]
    assert shown == [COLORS["head"], COLORS[right], COLORS[left]]
    assert payload["instruction"] == trial().instruction
    assert payload["state"].shape == (1, 14) and payload["state"].dtype == np.float64
    assert np.array_equal(payload["state"][0], observation["state"])
    assert payload["ctrl_freqs"].tolist() == [30] and payload["ctrl_freqs"].dtype == np.int64
    assert "final_prompt" not in observation


def test_the_class_is_made_with_its_files(
    torch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []
    install(monkeypatch, "evaluate.deploy", GO1Infer=lambda *given: made.append(given))
    stats = tmp_path / "dataset_stats.json"
    stats.write_text("{}")
    one = go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(stats)))
    other = go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path)))
    differs = {part.partition("=")[0] for part in {*one.spec.contract} ^ {*other.spec.contract}}
    assert differs == {"normalisation"} and "dtype=bfloat16" in one.spec.contract
    assert made == [(str(tmp_path), str(stats)), (str(tmp_path), None)]
    with pytest.raises(ModelMissing, match="option stats must name"):
        go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(tmp_path / "no.json")))


# ----- RDT gets six pictures, its own gripper units and the right text, and nothing is scored twice


TEXT = trial().instruction


class OfficialRdt:
    """The official class as far as its callers see it."""

    def __init__(self, torch: Any) -> None:
        self.torch = torch
        self.calls: list[tuple[Any, list[Any], Any]] = []

    def step(self, proprio: Any, images: list[Any], text_embeds: Any) -> Any:
        self.calls.append((proprio, images, text_embeds))
        assert proprio.shape == (1, 14) and proprio.dtype == np.float32
        joints = np.array(proprio[0]) / np.array([1] * 6 + [4.7908] + [1] * 6 + [4.7888])
        chunk = np.tile(joints, (1, 64, 1))
        chunk[..., :6] += self.torch.randn(size=(1, 64, 6), dtype=np.float32, device="cpu")
        chunk *= np.array([1] * 6 + [11.8997] + [1] * 6 + [13.9231])
        return tensor(chunk.astype(np.float32))


def embeddings(folder: Path, torch: Any) -> Path:
    """A folder with one official file, of TEXT."""
    folder.mkdir()
    value = {"name": "x", "instruction": TEXT, "embeddings": tensor(np.ones((1, 5, 4096)))}
    torch.save(value, folder / "x.pt")
    return folder


def rdt_of(torch: Any, folder: Path, **given: Any) -> rdt.Rdt:
    texts = Embeddings(embeddings(folder / "e", torch), None, "cpu", np.float32, 1024)
    return rdt.Rdt(OfficialRdt(torch), texts, rdt.RdtServerOptions(checkpoint="x", **given))


@pytest.fixture
def served_rdt(torch: Any, tmp_path: Path) -> rdt.Rdt:
    return rdt_of(torch, tmp_path)


def test_pictures_come_as_head_right_left_before_and_now(served_rdt: rdt.Rdt) -> None:
    served_rdt.reset(trial())
    served_rdt.infer(seen(served_rdt.spec, step=64))
    pictures = served_rdt.model.calls[0][1]
    order = ("head", "right_wrist", "left_wrist")
    assert [p.size for p in pictures] == [(640, 480)] * 6
    assert {"pictures=640x480", "jpeg=True", "dtype=bfloat16"} < {*served_rdt.spec.contract}
    assert all(close(color_of(p), COLORS[n]) for p, n in zip(pictures[3:], order, strict=True))
    past = [[c // 2 for c in COLORS[name]] for name in order]
    assert all(close(color_of(p), c) for p, c in zip(pictures[:3], past, strict=True))


def test_gripper_factors_cancel(served_rdt: rdt.Rdt) -> None:
    observation, chunk = first(served_rdt)
    np.testing.assert_allclose(served_rdt.model.calls[0][0][0, 6], 0.25 * 4.7908, rtol=1e-6)
    np.testing.assert_allclose(served_rdt.model.calls[0][0][0, 13], 4.7888, rtol=1e-6)
    assert chunk.shape == (64, 14)
    np.testing.assert_allclose(chunk[:, 6:], np.tile(observation["state"][6:], (64, 1)), rtol=1e-5)


def test_a_fork_without_factors_gets_none(torch: Any, tmp_path: Path) -> None:
    policy = rdt_of(torch, tmp_path, grippers="none")
    first(policy)
    assert float(policy.model.calls[0][0][0, 13]) == 1.0


def test_an_unknown_text_is_refused_at_reset(served_rdt: rdt.Rdt) -> None:
    with pytest.raises(ModelMissing, match=r"no file in .* has the embedding of 'Wave'"):
        served_rdt.reset(trial(instruction="Wave"))


def test_noise_follows_from_seed_and_step(served_rdt: rdt.Rdt) -> None:
    def chunk(seed: int, step: int) -> Any:
        served_rdt.reset(trial(seed))
        return served_rdt.infer(seen(served_rdt.spec, step=step))[:, :6]

    assert np.array_equal(chunk(1, 0), chunk(1, 0))
    assert not np.array_equal(chunk(1, 0), chunk(2, 0))
    assert not np.array_equal(chunk(1, 0), chunk(1, 64))


def test_a_live_text_is_made_once_and_kept(
    torch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []

    class T5:
        @classmethod
        def from_pretrained(cls, name: str, **options: Any) -> Any:
            assert name == "t5-folder"
            return cls()

        def to(self, device: str) -> Any:
            return self

        def eval(self) -> Any:
            return self

        def __call__(self, tokens: Any) -> Any:
            assert tokens.shape == (1, 3)
            return type("Out", (), {"last_hidden_state": tensor(np.full((1, 3, 8), 2.0))})

    class Words:
        @classmethod
        def from_pretrained(cls, name: str) -> Any:
            return cls()

        def __call__(self, text: str, **options: Any) -> Any:
            assert options == {
                "return_tensors": "pt",
                "padding": "longest",
                "truncation": True,
                "max_length": 1024,
            }
            made.append(text)
            return {"input_ids": tensor([[1, 2, 3]])}

    install(monkeypatch, "transformers", T5EncoderModel=T5, AutoTokenizer=Words)
    for _ in range(2):
        texts = Embeddings(tmp_path / "kept", "t5-folder", "cpu", np.float32, 1024)
        assert texts.find("Wave").shape == (1, 3, 8)
        assert texts.find("Wave").shape == (1, 3, 8)
    assert made == ["Wave"]


def test_the_model_is_made_as_its_own_script_does(
    torch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, Any] = {}
    install(monkeypatch, "yaml", safe_load=lambda text: {"dataset": {"tokenizer_max_length": 7}})
    install(monkeypatch, "scripts.agilex_model", create_model=lambda **given: made.update(given))
    config, weights = tmp_path / "base.yaml", tmp_path / "w.pt"
    config.write_text("")
    weights.write_text("")
    folder = embeddings(tmp_path / "e", torch)
    rdt.create(
        rdt.RdtServerOptions(
            checkpoint=str(weights), config=str(config), embeddings=str(folder), t5=None
        )
    )
    assert made == {
        "args": {
            "dataset": {"tokenizer_max_length": 7},
            "arm_dim": {"left_arm_dim": 6, "right_arm_dim": 6},  # RoboTwin's fork needs it
        },
        "dtype": torch.bfloat16,
        "device": "cuda",
        "pretrained": str(weights),
        "pretrained_vision_encoder_name_or_path": "google/siglip-so400m-patch14-384",
        "control_frequency": 25,
    }


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "checkpoint is needed"),
        ({"checkpoint": "x", "t5": None}, "embeddings and t5 are both none"),
        ({"checkpoint": "x", "execute": 0}, "execute is 0"),
    ],
)
def test_options_that_cannot_be(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        rdt.RdtServerOptions(**given)


# --------------------------- noise belongs to rows: a batch draws what its members would draw alone


def test_rows_are_those_of_singles(torch: Any) -> None:
    with seeded_rows([5, 6]):
        together = torch.randn(2, 3)
    with seeded_rows([6]):
        alone = torch.randn(size=(1, 3))
    np.testing.assert_array_equal(together[1:], alone)


@pytest.mark.parametrize("shape", [(1, 4), (7,)])
def test_draws_of_one_row_differ_and_repeat_whatever_their_shape(torch: Any, shape: Any) -> None:
    drawn = []
    for _ in range(2):
        with seeded_rows([5]):
            drawn.append((torch.rand(*shape), torch.randn(*shape), torch.rand(*shape)))
    assert not np.array_equal(drawn[0][0], drawn[0][2])
    np.testing.assert_array_equal(drawn[0], drawn[1])


def test_a_draw_that_belongs_to_no_row_is_refused_for_several(torch: Any) -> None:
    with pytest.raises(NotByRow), seeded_rows([5, 6]):
        torch.randn(7)
    with pytest.raises(NotByRow), seeded_rows([5, 6]):
        torch.randperm(2)


def test_a_generator_of_the_model_is_left_alone(torch: Any) -> None:
    with seeded_rows([5, 6]):
        given = torch.randn(9, generator=torch.Generator("cpu").manual_seed(3))
    assert given.shape == (9,)


class Counting(ModelPolicy):
    """Answers how often its trial was asked before."""

    spec = PolicySpec("counting", cameras=(), horizon=1)

    def predict(self, asks: Any) -> list[Any]:
        for ask in asks:
            ask.memory["n"] = ask.memory.get("n", 0) + 1
        return [np.full((1, 14), ask.memory["n"], np.float32) for ask in asks]


def test_memory_belongs_to_a_trial_of_a_session() -> None:
    policy, observation = Counting(), seen(Counting.spec)
    policy.reset_session(1, trial())
    policy.reset_session(2, trial())

    def ask(session: int) -> float:
        return float(policy.infer_batch([observation], [session])[0][0, 0])

    assert [ask(1), ask(1), ask(2)] == [1, 2, 1]
    policy.reset_session(1, trial())
    assert ask(1) == 1


class Failing(Counting):
    """Cannot answer several at once, which shows when it has answered some of them."""

    def predict(self, asks: Any) -> list[Any]:
        answers = super().predict(asks)
        if len(asks) > 1:
            raise ValueError("one of them cannot be answered")
        return answers


def test_a_call_that_fails_for_one_is_forgotten_by_the_others() -> None:
    policy, observation = Failing(), seen(Counting.spec)
    for session in (1, 2):
        policy.reset_session(session, trial())
    with pytest.raises(ValueError):
        policy.infer_batch([observation] * 2, [1, 2])
    assert policy.infer_batch([observation], [1])[0][0, 0] == 1


def test_code_that_is_missing_is_named() -> None:
    with pytest.raises(ModelMissing, match=r"cannot import no_such_model .* with a checkout of X"):
        import_code("no_such_model", None, "a checkout of X")


def weights(folder: Path, byte: int) -> Path:
    folder.mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    data = bytearray(2 * SAMPLES * BLOCK)
    data[-1] = byte
    (folder / "model.safetensors").write_bytes(data)
    return folder


def test_the_name_follows_the_weights_and_not_the_place(tmp_path: Path) -> None:
    first = describe_checkpoint(str(weights(tmp_path / "a" / "29999", 1)))
    other = describe_checkpoint(str(weights(tmp_path / "b" / "29999", 2)))
    moved = tmp_path / "c" / "29999"
    shutil.copytree(tmp_path / "a" / "29999", moved)
    assert first.startswith("29999 sample:")
    assert describe_checkpoint(str(moved)) == first != other
