"""The conformance suite passes what is right and notices what is wrong."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wire_helpers import QUICK, SPEC, Recall, answer, scripted

from robospa.observation import CameraSpec
from robospa.protocol.conformance import CHECKS, check, synthetic_observation, trial_for
from robospa.protocol.connection_limits import ServerOptions
from robospa.protocol.messages import Actions, Hello, Ready, pack
from robospa.protocol.policy import PolicySpec, check_observation


def verdicts(url: str, **options: Any) -> dict[str, bool | None]:
    return {r.name: r.passed for r in check(url, timeouts=QUICK, **options)}


def test_our_server_passes_everything(start: Any) -> None:
    server = start(
        policy_factory=lambda: Recall(replace(SPEC, seeded=True, committed_actions=True))
    )
    found = {result.name: result for result in check(server.url, timeouts=QUICK)}
    assert {name: one.passed for name, one in found.items()} == dict.fromkeys(CHECKS, True)
    assert "speaks robospa.v1, not robospa.v999" in found["foreign version refused"].detail


def test_our_server_passes_in_openpis_dialect(start: Any) -> None:
    from robospa.clients import connect

    url = start(policy_factory=lambda: Recall(replace(SPEC, cameras=(CameraSpec("head"),)))).url
    address = url.replace("ws://", "openpi://") + "?cameras=head"
    found = verdicts(url, connector=lambda: connect(address))
    assert found["handshake"] and found["actions"] and found["concurrent sessions"]
    assert False not in found.values()


def test_nobody_there_and_a_server_of_another_version() -> None:
    with scripted(pack(Hello(0, "99.0", "s", SPEC))) as url:
        for address, why in (("ws://127.0.0.1:9", "nothing listens"), (url, "same major version")):
            (result,) = check(address, timeouts=QUICK)
            assert result.name == "handshake" and result.passed is False
            assert why in result.detail


@pytest.mark.parametrize("bad", [np.full((2, 14), np.nan, "f4"), np.zeros((9, 14), "f4")])
def test_a_bad_chunk_fails_the_check_of_actions(start: Any, bad: Any) -> None:
    server = start(Recall(answer=bad), options=ServerOptions(patience=0.05))
    assert verdicts(server.url)["actions"] is False


def test_actions_of_changing_width_fail_and_end_nothing(start: Any) -> None:
    class Wider(Recall):
        def infer(self, observation: Any) -> Any:
            return np.zeros((2, 14 + observation["step"] % 2), "f4")

    server = start(policy_factory=lambda: Wider(replace(SPEC, action_dim=None)))
    assert verdicts(server.url)["concurrent sessions"] is False


def test_a_broken_promise_of_repeatability(start: Any) -> None:
    class Moody(Recall):
        count = itertools.count()

        def infer(self, observation: Any) -> Any:
            return np.full((1, 14), next(self.count), np.float32)

    server = start(policy_factory=lambda: Moody(replace(SPEC, seeded=True)))
    assert verdicts(server.url)["determinism"] is False


class Remembers(Recall):
    """Counts on over its trials."""

    def infer(self, observation: Any) -> Any:
        return np.full((1, 14), len(self.trials), np.float32)


@pytest.mark.parametrize(("seeded", "passed"), [(True, False), (False, None)])
def test_state_that_is_kept_over_trials(start: Any, seeded: bool, passed: bool | None) -> None:
    url = start(policy_factory=lambda: Remembers(replace(SPEC, seeded=seeded))).url
    found = {result.name: result for result in check(url, timeouts=QUICK)}["determinism"]
    assert found.passed is passed and found.hint is not seeded
    assert "first trial of a connection is answered otherwise" in found.detail


def test_a_server_that_takes_any_order() -> None:
    zeros = np.zeros((2, 14), np.float32)
    careless = [answer(lambda id: Actions(id, zeros)), answer(Ready)] * 2
    with scripted(pack(Hello(0, "1.1", "s", SPEC)), careless) as url:
        assert verdicts(url)["requests in order"] is False


def test_the_synthetic_observation_fits_any_spec() -> None:
    spec = PolicySpec(
        "s",
        cameras=(CameraSpec("head", 8, 6), CameraSpec("third", 4, 4)),
        history=(-1, -10),
        privileged=True,
        environment_state=True,
    )
    check_observation(synthetic_observation(spec), spec)


@pytest.mark.parametrize(
    ("spec", "robot", "joints"),
    [
        (PolicySpec("a"), "aloha-agilex", (6, 6)),
        (PolicySpec("a", embodiments=("franka-panda",)), "franka-panda", (7, 7)),
        (PolicySpec("a", embodiments=("piper", "aloha-agilex")), "aloha-agilex", (6, 6)),
        (PolicySpec("a", embodiments=("ours",), action_dim=15), "ours", (6, 7)),
        (PolicySpec("a", embodiments=("ours",), action_dim=18), "ours", (8, 8)),
        (PolicySpec("a", embodiments=("ours",), action="ee", action_dim=16), "ours", (6, 6)),
    ],
)
def test_the_robot_of_a_made_up_trial(
    spec: PolicySpec, robot: str, joints: tuple[int, int]
) -> None:
    trial = trial_for(spec)
    assert (trial.embodiment, trial.joints) == (robot, joints)
    assert len(synthetic_observation(spec)["state"]) == sum(joints) + 2
    assert type(trial).from_json(trial.to_json()) == trial
