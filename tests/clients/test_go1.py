"""GO-1's server: what exactly it is sent, and what becomes of its answers."""

from __future__ import annotations

import ssl
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_fakes import COLORS, color_of, first, install, trial
from standins import (
    HEAD,
    LEFT,
    QUICK,
    RIGHT,
    STATE,
    Go1,
    first_request,
    image,
    observation,
)

from robospa.clients import connect, go1
from robospa.clients.model_policy import ModelMissing
from robospa.protocol.errors import ConnectFailed


def test_go1_is_sent_what_its_server_reads() -> None:
    server = Go1()
    sent = first_request(server)
    assert sent.keys() == {"top", "left", "right", "instruction", "state", "ctrl_freqs"}
    for theirs, ours in (("top", HEAD), ("left", LEFT), ("right", RIGHT)):
        assert sent[theirs].dtype == np.uint8
        assert np.array_equal(sent[theirs], image(ours))
    assert sent["state"].shape == (1, 14)
    assert sent["state"].dtype == np.float64
    assert np.array_equal(sent["state"][0], STATE)
    assert sent["ctrl_freqs"].shape == (1,)
    assert sent["ctrl_freqs"].tolist() == [30]
    assert sent["ctrl_freqs"].dtype == np.int64
    assert sent["instruction"] == "pick the red block"
    assert server.content_type == "application/json"


def test_tls_and_a_token(tmp_path: Path) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = [
        *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"),
        *("-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1"),
        *("-keyout", str(key), "-out", str(certificate)),
    ]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("openssl is not installed")
    server = Go1()
    server.tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.tls.load_cert_chain(certificate, key)
    trust = ssl.create_default_context(cafile=certificate)
    with server as plain:
        url = plain.replace("http://", "https://")
        with connect(url, "s3cret", QUICK, ssl=trust) as policy:
            assert policy.infer(observation()).shape == (3, 14)
        with pytest.raises(ConnectFailed, match="CERTIFICATE_VERIFY_FAILED"):
            connect(url, "s3cret", QUICK)
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
    go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(stats)))
    go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path)))
    assert made == [(str(tmp_path), str(stats)), (str(tmp_path), None)]
    with pytest.raises(ModelMissing, match="option stats must name"):
        go1.create(go1.Go1ServerOptions(checkpoint=str(tmp_path), stats=str(tmp_path / "no.json")))
