"""GO-1's official class gets the payload that its own server would hand it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, color_of, install, seen, trial

from robospa.clients import go1
from robospa.clients.model_policy import ModelMissing


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
    policy.reset(trial())
    observation = seen(policy.spec)
    policy.infer(observation)
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


def test_noise_follows_from_the_policy_seed(torch: Any) -> None:
    policy, chunks = served(torch), []
    for seed in (1, 1, 2):
        policy.reset(trial(seed))
        chunks.append(policy.infer(seen(policy.spec)))
    assert chunks[0].shape == (30, 14) and chunks[0].dtype == np.float32
    assert np.array_equal(chunks[0], chunks[1])
    assert not np.array_equal(chunks[0], chunks[2])


def test_connections_keep_their_own_trials(torch: Any) -> None:
    policy = served(torch)
    policy.reset_session(1, trial(1))
    policy.reset_session(2, trial(2))
    one, two = policy.infer_batch([seen(policy.spec)] * 2, [1, 2])
    assert not np.array_equal(one, two)
    policy.end_session(1)
    with pytest.raises(KeyError):
        policy.infer_batch([seen(policy.spec)], [1])


def test_the_class_is_made_with_its_files(
    torch: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []
    install(monkeypatch, "evaluate.deploy", GO1Infer=lambda *given: made.append(given))
    stats = tmp_path / "dataset_stats.json"
    stats.write_text("{}")
    go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(stats)))
    go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path)))
    assert made == [(str(tmp_path), str(stats)), (str(tmp_path), None)]
    with pytest.raises(ModelMissing, match="option stats must name"):
        go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(tmp_path / "no.json")))


@pytest.mark.parametrize(
    "given", [{"ctrl_freq": 0.0}, {"horizon": 30, "execute": 31}, {"horizon": 0}]
)
def test_options_that_cannot_be(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="option"):
        go1.Go1ServerOptions(checkpoint="x", **given)
