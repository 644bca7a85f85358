"""RDT gets six pictures, its own gripper units and the right text, and nothing is scored twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, close, color_of, first, install, seen, tensor, trial

from robospa.clients import rdt as rdt
from robospa.clients.model_policy import ModelMissing
from robospa.clients.rdt import Embeddings

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


@pytest.fixture
def served(torch: Any, tmp_path: Path) -> rdt.Rdt:
    options = rdt.RdtServerOptions(checkpoint="x")
    texts = Embeddings(embeddings(tmp_path / "e", torch), None, "cpu", np.float32, 1024)
    return rdt.Rdt(OfficialRdt(torch), texts, options)


def test_pictures_come_as_head_right_left_before_and_now(served: rdt.Rdt) -> None:
    served.reset(trial())
    served.infer(seen(served.spec, step=64))
    pictures = served.model.calls[0][1]
    order = ("head", "right_wrist", "left_wrist")
    assert [p.size for p in pictures] == [(640, 480)] * 6
    assert all(close(color_of(p), COLORS[n]) for p, n in zip(pictures[3:], order, strict=True))
    past = [[c // 2 for c in COLORS[name]] for name in order]
    assert all(close(color_of(p), c) for p, c in zip(pictures[:3], past, strict=True))


def test_gripper_factors_cancel(served: rdt.Rdt) -> None:
    observation, chunk = first(served)
    np.testing.assert_allclose(served.model.calls[0][0][0, 6], 0.25 * 4.7908, rtol=1e-6)
    np.testing.assert_allclose(served.model.calls[0][0][0, 13], 4.7888, rtol=1e-6)
    assert chunk.shape == (64, 14)
    np.testing.assert_allclose(chunk[:, 6:], np.tile(observation["state"][6:], (64, 1)), rtol=1e-5)


def test_a_fork_without_factors_gets_none(torch: Any, tmp_path: Path) -> None:
    texts = Embeddings(embeddings(tmp_path / "e", torch), None, "cpu", np.float32, 1024)
    policy = rdt.Rdt(
        OfficialRdt(torch), texts, rdt.RdtServerOptions(checkpoint="x", grippers="none")
    )
    first(policy)
    assert float(policy.model.calls[0][0][0, 13]) == 1.0


def test_an_unknown_text_is_refused_at_reset(served: rdt.Rdt) -> None:
    with pytest.raises(ModelMissing, match=r"no file in .* has the embedding of 'Wave'"):
        served.reset(trial(instruction="Wave"))


def test_noise_follows_from_seed_and_step(served: rdt.Rdt) -> None:
    def chunk(seed: int, step: int) -> Any:
        served.reset(trial(seed))
        return served.infer(seen(served.spec, step=step))[:, :6]

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
