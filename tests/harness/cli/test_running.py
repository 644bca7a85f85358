"""From options to a request."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from robospa.harness.cli.running import client_options, make_request, run_folder
from robospa.harness.cli.selection import BadChoice
from robospa.trial import TrialKey

KEYS = [TrialKey("A", 1, 0)]
TIMES = {"timeout": 1.0, "first_timeout": 2.0, "wait": 3.0, "patience": 4.0}


def test_a_server_gets_its_deadlines_and_its_token(tmp_path: Path) -> None:
    request = make_request("ws://h:1", KEYS, tmp_path, connection=TIMES, token="t", workers=3)
    timeouts = request.config.options["timeouts"]
    assert (timeouts.infer, timeouts.first_infer, timeouts.wait) == (1.0, 2.0, 4.0)
    assert request.wait == 3.0
    assert request.config.options["token"] == "t"
    assert request.options.workers == 3


def test_the_token_is_nowhere_in_what_is_kept(tmp_path: Path) -> None:
    request = make_request("ws://h:1", KEYS, tmp_path, connection=TIMES, token="hidden")
    assert "hidden" not in json.dumps([request.settings, request.arguments])


def test_client_options_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "client.json"
    path.write_text('{"horizon": 25, "execute": 10, "names": "head:cam"}')
    assert client_options("openpi://h:1", path)["execute"] == 10


@pytest.mark.parametrize("text", ["{", "[]", '{"horizn": 5}', '{"horizon": "x"}', '{"extra": "["}'])
def test_broken_client_options_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "client.json"
    path.write_text(text)
    with pytest.raises(BadChoice, match=r"--client .*client\.json"):
        client_options("openpi://h:1", path)


def test_options_in_a_url_are_checked_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(BadChoice, match="no option 'horizn'"):
        make_request("openpi://h:1?horizn=5", KEYS, tmp_path, connection=TIMES)


@pytest.mark.parametrize("wrong", [{"workers": -1}, {"attempts": 0}, {"trial_seconds": 0.0}])
def test_impossible_numbers_are_refused(tmp_path: Path, wrong: dict[str, float]) -> None:
    with pytest.raises(BadChoice, match="cannot be that small"):
        make_request("hold", KEYS, tmp_path, connection=TIMES, **wrong)  # type: ignore[arg-type]


def test_the_default_folder_is_named_after_the_policy() -> None:
    assert run_folder(None, "ws://host:8000", False).name.startswith("host-8000-")
    with pytest.raises(BadChoice, match="needs --out"):
        run_folder(None, "hold", True)
