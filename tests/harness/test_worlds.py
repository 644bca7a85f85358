"""Kinds of worlds: found by name, and what each answers to a run."""

import itertools
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from command_line import robospa
from run_fakes import KEYED, SPEC, FakePolicy, FakeWorld, NanPolicy, parts

from robospa.harness import machine_check
from robospa.harness.server_checks import rollouts, trial_for
from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.harness.sim.vulkan import Device
from robospa.harness.trial import new_run_seed, policy_seed, run_trial, salt_hash, trial_id
from robospa.harness.worlds import SAPIEN, WorldKind, open_world, world_kind
from robospa.protocol.client import connect
from robospa.protocol.codec import decode
from robospa.protocol.conformance import CheckResult
from robospa.protocol.messages import Reset, pack
from robospa.protocol.policy import PolicySpec
from robospa.protocol.server import ServerThread
from robospa.registry import UnknownName
from robospa.trial import TrialKey


def settings(**given: Any) -> EvaluationSettings:
    return updated(EvaluationSettings(), given)


def test_a_kind_is_found_by_name_or_by_the_path_of_its_factory() -> None:
    for world in ("sapien", "run_fakes:FakeWorld"):
        assert world_kind(world).name == world
    assert world_kind("official?settle=official").name == "official"


@pytest.mark.parametrize("wrong", ["sapiens", "officials?x", ""])
def test_an_unknown_name_is_refused(wrong: str) -> None:
    with pytest.raises(UnknownName, match="official, sapien"):
        world_kind(wrong)


def test_an_entry_point_has_to_be_a_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robospa.harness.worlds.find", lambda *_: object())
    with pytest.raises(UnknownName, match="WorldKind"):
        world_kind("sapien")


def test_only_the_official_world_has_an_archive_and_vendors_robots() -> None:
    given = settings(robot_assets="official")
    world_kind("official").check(given)
    for kind in (SAPIEN, world_kind("run_fakes:FakeWorld")):
        with pytest.raises(SettingsError, match="robot_assets"):
            kind.check(given)
        with pytest.raises(SettingsError, match="assets"):
            kind.check(settings(assets="."))
    with pytest.raises(SettingsError, match="sapien takes no options"):
        SAPIEN.check(settings(world="sapien?settle=official"))


def test_who_opens_a_world_may_say_whether_it_draws_where_it_can(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[dict[str, Any]] = []
    monkeypatch.setattr("robospa.harness.worlds.load", lambda path: lambda **a: seen.append(a))
    open_world("sapien", {"render": None, "control": "x"}, render=True)
    open_world("my:World", {"a": 1}, render=True)
    open_world("sapien", {"render": None})
    assert seen == [{"render": True, "control": "x"}, {"a": 1}, {"render": None}]


def test_actions_at_a_rate_of_their_own_are_an_argument_of_each_simulator() -> None:
    usual = settings()
    timed = replace(usual, timing=replace(usual.timing, action_rate=25.0))
    unknown = WorldKind("my:World", "my:World")
    assert SAPIEN.arguments(usual) == {"render": None, "control": "rest_to_rest"}
    assert SAPIEN.arguments(timed)["action_steps"] == unknown.arguments(timed)["action_steps"] == 10
    assert unknown.arguments(usual) == {}


# ---------------------------------------- what a machine lacks, with healthy and with broken checks


def broken() -> str:
    raise RuntimeError("no device")


@pytest.mark.parametrize(
    ("check", "words"),
    [(broken, "RuntimeError: no device"), (os.abort, "the check itself broke: signal 6")],
)
def test_a_failing_check_says_why(check: Callable[[], str], words: str) -> None:
    found = machine_check._run("driver", check, "install one")
    assert (found.ok, found.detail, found.fix) == (False, words, "install one")


def test_an_old_software_driver_is_recognised() -> None:
    for version in ("22.3.6", "24.2.8", "24.3.0", "25.0.7-2"):
        found = Device("llvmpipe (LLVM 15)", "llvmpipe", f"Mesa {version}").too_old
        assert found is (version < "24.3")
    assert not Device("GeForce", "NVIDIA", "535.1").too_old  # never that of a GPU


@pytest.mark.sim
def test_all_checks_of_this_machine_are_named_and_have_a_fix_if_they_fail() -> None:
    checks = list(machine_check.run_checks())
    names = [c.name for c in checks]
    assert names[:4] == ["processor", "simulator", "physics", "vulkan device"]
    assert all(bool(c.fix) is not c.ok for c in checks)


# -------------------------------------------------- what a policy is sent in place of a trial's key


KEY = TrialKey("Pick_Blocks_Size", 3, 100007)
SALT = "ab" * 32
TOLD = {"task", "embodiment", "instruction", "policy_seed", "id", "extra", "joints"}
"""All that a policy learns of a trial unless it asks for the key."""


def sent(policy: FakePolicy) -> dict[str, object]:
    """The trial as it lies in the bytes of `reset`."""
    run_trial(FakeWorld(), policy, KEY, policy_seed=5, trial_id="a1", parts=parts)
    assert policy.trial is not None
    message = decode(pack(Reset(1, policy.trial)))
    assert isinstance(message, dict)
    found: dict[str, object] = message["trial"]
    return found


def test_no_policy_is_sent_level_seed_mode_or_split() -> None:
    assert sent(FakePolicy()).keys() == TOLD
    assert sent(FakePolicy())["id"] == "a1"


def test_one_that_asks_is_sent_the_key() -> None:
    policy = FakePolicy(KEYED)
    assert sent(policy).keys() == TOLD | {"key"}
    assert policy.trial is not None and policy.trial.key == KEY


def test_ids_and_policy_seeds_follow_from_the_run_and_the_key() -> None:
    """A run of an older version has the seed 0: its bundle must still be what it says."""
    assert policy_seed(KEY, 0) == policy_seed(KEY, "0") == 634677935
    for value in (policy_seed, trial_id):
        mine = new_run_seed()
        made = {value(KEY, mine), value(KEY, 0), value(KEY, "1"), value(KEY, new_run_seed())}
        assert len(made | {value(replace(KEY, seed=100008), mine)}) == 5
        assert value(KEY, mine) in made
    assert 0 <= policy_seed(KEY, SALT) < 2**31
    assert salt_hash(SALT) not in (SALT, salt_hash("cd" * 32))


# ---------------------------------------------------------- `robospa check` runs a real trial twice


def results(make: Callable[[], Any], world: Any = FakeWorld) -> list[CheckResult]:
    with ServerThread(policy_factory=make) as server:
        return list(rollouts(lambda: connect(server.url), 2, make_world=world, parts=parts))


class Moody(FakePolicy):
    """Every trial is another one."""

    count = itertools.count()

    def infer(self, observation: Any) -> Any:
        return super().infer(observation) + 0.1 * next(self.count)


class BrokenPolicy(FakePolicy):
    def infer(self, observation: Any) -> Any:
        raise RuntimeError("out of memory")


class BrokenWorld(FakeWorld):
    def load(self, scene: Any, contacts: bool = False) -> None:
        raise RuntimeError("no device")


def no_world() -> Any:
    raise ImportError("no module named sapien")


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


@pytest.mark.parametrize(
    ("make", "world", "verdicts", "said"),
    [
        (lambda: Moody(replace(SPEC, seeded=True)), FakeWorld, [True, False], "though seeds are h"),
        (Moody, FakeWorld, [True, True], "seeds are not honoured"),
        (NanPolicy, FakeWorld, [False], "nan"),
        (BrokenPolicy, FakeWorld, [False], "out of memory"),
        # A machine that cannot simulate is not the server's fault.
        (FakePolicy, no_world, [None], "there is no simulator here"),
        (FakePolicy, BrokenWorld, [None], "see robospa check"),
    ],
)
def test_trials_that_differ_or_fail(
    make: Callable[[], Any], world: Any, verdicts: list[bool | None], said: str
) -> None:
    found = results(make, world)
    assert len(found) == len(verdicts) + (len(verdicts) > 1)  # the actions are looked at last
    assert [row.passed for row in found[:2]] == verdicts
    assert said in found[len(verdicts) - 1].detail


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
    verdicts: tuple[bool | None, ...], code: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robospa.harness.server_checks.rollouts", rows(*verdicts))
    with ServerThread(policy_factory=FakePolicy) as server:
        done = robospa("check", server.url, "--load-seconds", "0")
    assert done.code == code and f"real trial {len(verdicts)}" in done.out


@pytest.mark.sim
def test_a_real_world_and_a_policy_that_holds_still() -> None:
    class Still(FakePolicy):
        def infer(self, observation: Any) -> Any:
            return np.tile(observation["state"], (50, 1))

    with ServerThread(policy_factory=lambda: Still(replace(SPEC, horizon=50))) as server:
        found = list(rollouts(lambda: connect(server.url), 2))
    assert [row.passed for row in found] == [True, True, True]
    assert "step_limit" in found[0].detail and "to the bit" in found[1].detail
