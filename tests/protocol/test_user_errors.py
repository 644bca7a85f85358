"""An exception of a policy is told by type, text and the line of its author's code."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest
from wire_helpers import QUICK, TRIAL, Recall, observation

from robospa.protocol.client import connect
from robospa.protocol.errors import ServerError, error_sentence, policy_traceback
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
