"""Kinds of worlds: found by name, and what each answers to a run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.harness.worlds import SAPIEN, WorldKind, open_world, world_kind
from robospa.registry import UnknownName


def settings(**given: Any) -> EvaluationSettings:
    return updated(EvaluationSettings(), given)


@pytest.mark.parametrize(
    ("world", "name"),
    [
        ("sapien", "sapien"),
        ("official?settle=official", "official"),
        ("checkout:/some/where?python=p", "checkout"),
        ("run_fakes:FakeWorld", "run_fakes:FakeWorld"),
    ],
)
def test_a_kind_is_found_by_name_or_by_the_path_of_its_factory(world: str, name: str) -> None:
    assert world_kind(world).name == name


@pytest.mark.parametrize("wrong", ["sapiens", "officials?x", ""])
def test_an_unknown_name_is_refused(wrong: str) -> None:
    with pytest.raises(UnknownName, match="known are checkout, official, sapien"):
        world_kind(wrong)


def test_an_entry_point_has_to_be_a_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robospa.harness.worlds.find", lambda *_: object())
    with pytest.raises(UnknownName, match="WorldKind"):
        world_kind("sapien")


def test_only_the_official_world_has_an_archive_and_vendors_robots() -> None:
    given = settings(robot_assets="official")
    assert world_kind("official").selection(given) == given.selection
    for kind in (SAPIEN, world_kind("run_fakes:FakeWorld")):
        with pytest.raises(SettingsError, match="robot_assets"):
            kind.selection(given)
        with pytest.raises(SettingsError, match="assets"):
            kind.selection(settings(assets="."))


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
