"""Passwords and tokens in a URL are used nowhere, so they are refused and never repeated."""

from __future__ import annotations

from pathlib import Path

import pytest

from robospa.clients import connect, find_endpoint
from robospa.harness.cli.main import main, sentence
from robospa.protocol.client import connect as connect_ours
from robospa.protocol.errors import without_secrets


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("ws://me:hunter2@gpu:8000/x", "ws://***@gpu:8000/x"),
        ("see 'wss://hunter2@gpu' and ws://a:hunter2@b", "see 'wss://***@gpu' and ws://***@b"),
        ("ws://gpu?token=hunter2&horizon=4", "ws://gpu?token=***&horizon=4"),
        ("ws://gpu?horizon=4&api_key=hunter2", "ws://gpu?horizon=4&api_key=***"),
        ("ws://gpu?PASSWORD=hunter2", "ws://gpu?PASSWORD=***"),
        ("ws://gpu:8000?names=head:cam_top", "ws://gpu:8000?names=head:cam_top"),
        ("write to me@example.org", "write to me@example.org"),
    ],
)
def test_secrets_are_masked_and_nothing_else(text: str, shown: str) -> None:
    assert without_secrets(text) == shown


URLS = (
    "ws://me:hunter2@127.0.0.1:9",
    "go1+http://me:hunter2@127.0.0.1:9",
    "ws://127.0.0.1:9?token=hunter2",
    "wrong://me:hunter2@127.0.0.1:9",
    "ws://me:hunter2@",
)


@pytest.mark.parametrize("url", URLS)
@pytest.mark.parametrize("command", ["eval", "check"])
def test_no_command_repeats_or_keeps_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], url: str, command: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command, url, *(["--out", str(tmp_path / "run")] if command == "eval" else [])])
    said = capsys.readouterr()
    assert stop.value.code != 0
    assert "hunter2" not in said.out + said.err
    assert list(tmp_path.iterdir()) == []


def test_the_refusal_says_where_a_token_goes() -> None:
    for made in (find_endpoint, connect):
        with pytest.raises(ValueError, match="--token, ROBOSPA_TOKEN or token="):
            made("ws://me:hunter2@gpu:8000")
    with pytest.raises(ValueError, match="not of the form ws://host:port") as refusal:
        connect_ours("ws://me:hunter2@gpu:8000")
    assert "hunter2" not in str(refusal.value)
    assert sentence(ValueError("no ws://a:hunter2@b")) == "no ws://***@b"
