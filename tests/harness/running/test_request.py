"""From settings to what the driver runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from robospa.harness.running.request import client_options, make_request, run_folder
from robospa.harness.settings import EvaluationSettings, SettingsError, to_toml, updated
from robospa.trial import TrialKey

KEYS = [TrialKey("A", 1, 0)]


def settings(policy: str, **given: Any) -> EvaluationSettings:
    return updated(EvaluationSettings(), {"policy": policy, **given})


def test_a_server_gets_its_deadlines_and_its_token() -> None:
    asked = settings("ws://h:1", timeout=1, first_timeout=2, wait=3, patience=4, workers=3)
    request = make_request(asked, token="t", keys=KEYS)
    timeouts = request.config.options["timeouts"]
    assert (timeouts.infer, timeouts.first_infer, timeouts.wait) == (1.0, 2.0, 4.0)
    assert request.wait == 3.0
    assert request.config.options["token"] == "t"
    assert request.options.workers == 3


def test_the_token_is_nowhere_in_what_is_kept() -> None:
    asked = settings("ws://h:1", tasks="Pick_Blocks_Size", levels=1, trials=1)
    request = make_request(asked, token="hidden")
    assert request.settings is not None
    kept = json.dumps([request.arguments]) + to_toml(request.settings)
    assert "ws://h:1" in kept and "hidden" not in kept


def test_the_trials_are_those_of_the_settings() -> None:
    request = make_request(settings("hold", tasks="Pick_Blocks_Size", levels=[1, 3], trials=2))
    assert [(key.level, key.task) for key in request.keys] == [
        (1, "Pick_Blocks_Size"), (1, "Pick_Blocks_Size"),
        (3, "Pick_Blocks_Size"), (3, "Pick_Blocks_Size"),
    ]  # fmt: skip


def test_client_options_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "client.json"
    path.write_text('{"horizon": 25, "execute": 10, "names": "head:cam"}')
    assert client_options("openpi://h:1", path)["execute"] == 10


@pytest.mark.parametrize("text", ["{", "[]", '{"horizn": 5}', '{"horizon": "x"}', '{"extra": "["}'])
def test_broken_client_options_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "client.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"--client .*client\.json"):
        client_options("openpi://h:1", path)


def test_options_in_a_url_are_checked_before_the_run() -> None:
    with pytest.raises(SettingsError, match="no option 'horizn'"):
        make_request(settings("openpi://h:1?horizn=5"), keys=KEYS)


@pytest.mark.parametrize(
    ("policy", "reason"),
    [
        ((), "or else --policy-map"),
        (("ws://a", "ws://a"), "ws://a is named twice"),
        (("ws://a", "hold"), "'hold' is no URL"),
    ],
)
def test_servers_that_do_not_go_together_are_refused(policy: tuple[str, ...], reason: str) -> None:
    with pytest.raises(SettingsError, match=reason):
        make_request(EvaluationSettings(policy=policy), keys=KEYS)


def test_the_default_folder_is_named_after_the_policy() -> None:
    folder = run_folder(settings("ws://host:8000"))
    assert folder.name.startswith("host-8000-")
    assert run_folder(settings("ws://host:8000")) != folder, "two runs that start in one second"
    with pytest.raises(SettingsError, match="say with out which one"):
        run_folder(settings("hold"), resume=True)


@pytest.mark.parametrize("scheme", ["robotwin+tcp", "xpolicylab"])
def test_a_server_with_one_state_for_all_gets_one_worker(scheme: str) -> None:
    url = f"{scheme}://h:1"
    request = make_request(settings(url), keys=KEYS)
    assert (request.options.workers, request.options.most) == (1, 1)
    assert request.config.one_trial == {url: "h:1"}
    with pytest.raises(SettingsError, match="workers is 2, but this server keeps one state"):
        make_request(settings(url, workers=2), keys=KEYS)


@pytest.mark.parametrize(
    ("policy", "given", "most"),
    [
        ("ws://h:1", {}, 3),
        ("ws://h:1", {"workers": 8}, 3),
        ("ws://h:1", {"workers": 8, "trials_per_worker": 1}, 1),
        ("ws://h:1", {"workers": 1}, 1),
        ("ws://h:1", {"workers": 1, "trials_per_worker": 2}, 2),
        ("ws://h:1", {"world": "run_fakes:FakeWorld"}, 1),
        ("ws://h:1", {"executor": "ray"}, 1),
        ("robotwin+tcp://h:1", {}, 1),
        ("hold", {}, 1),
    ],
)
def test_how_many_trials_a_worker_holds(policy: str, given: dict[str, Any], most: int) -> None:
    assert make_request(settings(policy, **given), keys=KEYS).options.concurrent_trials == most


def test_more_trials_a_worker_than_can_be_are_refused() -> None:
    with pytest.raises(SettingsError, match="trials_per_worker is 2, but a policy without a serv"):
        make_request(settings("hold", trials_per_worker=2), keys=KEYS)
