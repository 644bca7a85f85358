"""An exception of a policy is told by type, text and the line of its author's code."""

import json
import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import robospa
from wire_helpers import QUICK, TRIAL, Recall, observation

from robospa.clients import connect, find_endpoint
from robospa.harness.cli.main import sentence
from robospa.protocol.client import connect as connect_ours
from robospa.protocol.errors import (
    ServerError,
    error_sentence,
    json_values,
    policy_traceback,
    without_secrets,
)
from robospa.protocol.policy_host import PolicyHost

HERE = Path(__file__).name


def caught(call: Any) -> BaseException:
    with pytest.raises(Exception) as found:
        call()
    return found.value


def test_the_place_is_in_the_authors_own_code_and_not_in_a_library() -> None:
    error = caught(lambda: json.loads("{"))
    assert error_sentence(error).startswith("JSONDecodeError: Expecting property name")
    assert f"({HERE}:" in error_sentence(error)


def test_an_exception_without_text_or_place_is_still_a_sentence() -> None:
    assert error_sentence(KeyError()) == "KeyError"
    assert policy_traceback(KeyError("x")) == "KeyError: 'x'"


class Wrong(Recall):
    def infer(self, observation: Any) -> Any:
        raise ValueError("no camera 'wrist'\nsecond line")


def test_the_client_reads_the_exception_first_and_the_log_begins_at_the_policy(
    start: Any, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.ERROR, "robospa.server")
    with connect(start(Wrong()).url, timeouts=QUICK) as remote:
        remote.reset(TRIAL)
        with pytest.raises(ServerError) as found:
            remote.infer(observation())
    place = f"({HERE}:"
    assert str(found.value).startswith(f"ValueError: no camera 'wrist' {place}")
    assert "its traceback is in the log of ws://" in str(found.value)
    (entry,) = (record.getMessage() for record in caplog.records)
    assert entry.startswith("the policy failed: ValueError: no camera 'wrist'")
    assert entry.count("  File ") == 1
    assert "second line" in entry


def test_a_policy_that_does_not_say_what_it_reads_is_told_what_to_write() -> None:
    class Mine:
        spec = "ee"

    for policy, found in ((Mine(), "str"), (object(), "NoneType")):
        with pytest.raises(ValueError, match=f"spec is no PolicySpec but {found}: .*PolicySpec"):
            PolicyHost(policy)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="either"):
        PolicyHost()


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
def test_no_command_repeats_or_keeps_one(tmp_path: Path, url: str, command: str) -> None:
    done = robospa(command, url, *(["--out", tmp_path / "run"] if command == "eval" else []))
    assert done.code != 0
    assert "hunter2" not in done.out + done.err
    assert list(tmp_path.iterdir()) == []


def test_the_refusal_says_where_a_token_goes() -> None:
    for made in (find_endpoint, connect):
        with pytest.raises(ValueError, match="--token, ROBOSPA_TOKEN or token="):
            made("ws://me:hunter2@gpu:8000")
    for url in ("ws://me:hunter2@gpu:8000", "http://localhost:1", "localhost:8000", "ws://"):
        with pytest.raises(ValueError, match="not of the form ws://host:port") as refusal:
            connect_ours(url)
        assert "hunter2" not in str(refusal.value)
    assert sentence(ValueError("no ws://a:hunter2@b")) == "no ws://***@b"


def test_arrays_and_numbers_that_json_lacks_can_be_kept() -> None:
    said = {"mean": np.array([1.5, np.nan]), b"x": {1: (np.inf, None)}, "odd": object}
    kept = json_values(said)
    assert kept["mean"] == [1.5, "nan"]
    assert kept["b'x'"] == {"1": ["inf", None]}
    assert json_values({"weights": np.zeros(10**5)}).startswith("left out: ")
