"""`robospa check` runs a real trial twice."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from run_fakes import SPEC, FakePolicy, FakeWorld, NanPolicy, parts

from robospa.harness.cli.main import main
from robospa.harness.server_checks import rollouts, trial_for
from robospa.protocol.client import connect
from robospa.protocol.conformance import CheckResult
from robospa.protocol.policy import PolicySpec
from robospa.protocol.server import ServerThread


def results(make: Callable[[], Any], world: Any = FakeWorld) -> list[CheckResult]:
    with ServerThread(policy_factory=make) as server:
        return list(rollouts(lambda: connect(server.url), 2, make_world=world, parts=parts))


class Moody(FakePolicy):
    """Every trial is another one."""

    count = itertools.count()

    def infer(self, observation: Any) -> Any:
        return super().infer(observation) + 0.1 * next(self.count)


def test_a_correct_policy_gives_the_same_result_twice() -> None:
    first, second, executed = results(FakePolicy)
    assert (first.passed, second.passed) == (True, True)
    assert "success after" in first.detail and "equal to the first to the bit" in second.detail
    assert executed == CheckResult("executed actions", True, "all 2 actions were executed as sent")


def test_actions_that_the_robot_cannot_execute_are_a_hint() -> None:
    class Degrees(FakePolicy):
        def infer(self, observation: Any) -> Any:
            return super().infer(observation) * 57.3

    *trials, executed = results(Degrees)
    assert [row.passed for row in trials] == [True, True] and executed.passed is None
    assert executed.detail.startswith(
        "2 of 2 actions (100 %) send a joint beyond its limits, where it stops: "
        "are joints absolute, in radians, in the order of the state? First: Pick_Blocks_Size-L1-"
    )
    assert "action 1: left joint 1 is asked to go to 57.3" in executed.detail


def test_a_broken_promise_of_seeds_fails() -> None:
    found = results(lambda: Moody(replace(SPEC, seeded=True)))
    assert [row.passed for row in found][:2] == [True, False]
    assert "though seeds are honoured" in found[1].detail


def test_without_a_promise_it_is_only_reported() -> None:
    assert "seeds are not honoured" in results(Moody)[1].detail


def test_a_policy_error_fails_and_ends_it() -> None:
    (row,) = results(NanPolicy)
    assert row.passed is False and "nan" in row.detail


def test_a_server_that_fails_is_reported() -> None:
    class Fails(FakePolicy):
        def infer(self, observation: Any) -> Any:
            raise RuntimeError("out of memory")

    (row,) = results(Fails)
    assert row.passed is False and "out of memory" in row.detail


def test_a_machine_that_cannot_simulate_is_not_the_servers_fault() -> None:
    def missing() -> Any:
        raise ImportError("no module named sapien")

    def broken() -> Any:
        raise RuntimeError("no device")

    assert [row.passed for row in results(FakePolicy, missing)] == [None]
    (row,) = results(FakePolicy, lambda: Unhappy())
    assert row.passed is None and "robospa check" in row.detail


class Unhappy(FakeWorld):
    def load(self, scene: Any, contacts: bool = False) -> None:
        raise RuntimeError("no device")


def test_the_trial_fits_the_robot_of_the_policy() -> None:
    assert trial_for(PolicySpec("p")).embodiment == "aloha-agilex"
    assert trial_for(PolicySpec("p", embodiments=("franka-panda",))).embodiment == "franka-panda"


def rows(*verdicts: bool | None) -> Callable[..., Iterator[CheckResult]]:
    return lambda opened, count: (
        CheckResult(f"real trial {n}", passed, "seen")
        for n, passed in enumerate(verdicts[:count], 1)
    )


@pytest.mark.parametrize(
    ("verdicts", "code"), [((True, True), 0), ((True, False), 1), ((None,), 0)]
)
def test_the_command_counts_them(
    verdicts: tuple[bool | None, ...],
    code: int,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("robospa.harness.server_checks.rollouts", rows(*verdicts))
    with ServerThread(policy_factory=FakePolicy) as server, pytest.raises(SystemExit) as end:
        main(["check", server.url, "--load-seconds", "0"])
    assert (end.value.code or 0) == code
    assert f"real trial {len(verdicts)}" in capsys.readouterr().out


@pytest.mark.sim
def test_a_real_world_and_a_policy_that_holds_still(monkeypatch: pytest.MonkeyPatch) -> None:
    class Still(FakePolicy):
        def infer(self, observation: Any) -> Any:
            return np.tile(observation["state"], (50, 1))

    with ServerThread(policy_factory=lambda: Still(replace(SPEC, horizon=50))) as server:
        found = list(rollouts(lambda: connect(server.url), 2))
    assert [row.passed for row in found] == [True, True, True]
    assert "step_limit" in found[0].detail and "to the bit" in found[1].detail
