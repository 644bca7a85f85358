"""Typed objects from values of outside, and the sentence about each kind of refusal."""

import threading
import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import pytest
from msgspec import Meta
from numpy.typing import NDArray

from robospa import extras, registry
from robospa.action_space import KINDS, POSE, ActionSpace
from robospa.extras import user_cache
from robospa.schema import Identifier, describe, one_of, pattern, read


class Refused(Exception):
    """The caller's own error."""


@dataclass(frozen=True)
class Camera:
    name: Annotated[str, one_of(("head", "front"))]
    width: Annotated[int, Meta(ge=1, le=8192)] = 320


@dataclass(frozen=True)
class Card:
    """Every kind of field."""

    title: Annotated[str, Meta(max_length=5)]
    cameras: Annotated[tuple[Camera, ...], Meta(max_length=2)] = ()
    file: Identifier = ""
    day: Annotated[str, pattern(r"\d{4}-\d\d-\d\d", "a date such as 2026-01-31")] = "2026-01-31"
    share: float = 0.5
    times: Mapping[str, int | float] = field(default_factory=dict)
    execute: int | None = None
    flag: bool = False
    more: Mapping[str, Any] = field(default_factory=dict)
    array: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if self.flag and not self.cameras:
            raise ValueError("a card with a flag needs a camera")


class Struct(msgspec.Struct, frozen=True):
    number: int


def test_what_fits_is_read() -> None:
    array = np.zeros(2, np.float32)
    value = {
        "title": "a",
        "cameras": [{"name": "front"}, {"name": "head", "width": 8}],
        "share": 1,
        "times": {"a": 1, "b": 1.5},
        "more": {"x": [1, None]},
        "array": array,
        "of a later version": True,
    }
    card = read(Card, value, "card")
    assert card.cameras == (Camera("front"), Camera("head", 8))
    assert (card.share, dict(card.times), card.more) == (1.0, {"a": 1, "b": 1.5}, {"x": [1, None]})
    assert type(card.times["a"]) is int
    assert card.array is array
    assert read(Struct, {"number": 3}, "struct") == Struct(3)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"title": 3}, "card: 'title' must be text, not 3"),
        ({"title": "toolong"}, "card: 'title' must be text of length <= 5, not 'toolong'"),
        ({"cameras": None}, "card: 'cameras' must be a list, not None"),
        ({"cameras": [1]}, "card: 'cameras[0]' must be a map, not 1"),
        ({"cameras": [{}]}, "card: 'cameras[0]' lacks the field 'name'"),
        (
            {"cameras": [{"name": "top"}]},
            "card: 'cameras[0].name' must be one of head, front, not 'top'",
        ),
        (
            {"cameras": [{"name": "head", "width": 0}]},
            "card: 'cameras[0].width' must be a whole number >= 1, not 0",
        ),
        ({"cameras": [{}] * 3}, "card: 'cameras' must be a list of length <= 2, not a list"),
        (
            {"file": "../x"},
            "card: 'file' must be at most 128 letters, digits and _ - . +, and not begin with a "
            "dot, not '../x'",
        ),
        ({"file": "x\n"}, "card: 'file' must be at most 128 letters"),
        ({"day": "today"}, "card: 'day' must be a date such as 2026-01-31, not 'today'"),
        ({"share": "1"}, "card: 'share' must be a number, not '1'"),
        ({"times": {"a": "x"}}, "card: 'times' must be a number"),
        ({"times": {1: 1}}, "card: 'times' must be a map with text keys, not a dict"),
        ({"execute": 1.5}, "card: 'execute' must be a whole number or null, not 1.5"),
        ({"flag": 1}, "card: 'flag' must be true or false, not 1"),
        ({"flag": True}, "card: a card with a flag needs a camera"),
        ({"array": [1]}, "card: 'array' must be an array, not a list"),
        ({3: 3}, "card must be a map with text keys, not a dict"),
    ],
)
def test_a_refusal_names_field_expectation_and_value(changes: Any, sentence: str) -> None:
    with pytest.raises(Refused) as caught:
        read(Card, {"title": "a", **changes}, "card", Refused)
    assert str(caught.value).startswith(sentence)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ({}, "lacks the field 'title'"),
        ([], "must be a map, not a list"),
        (None, "must be a map, not None"),
    ],
)
def test_a_value_that_is_no_such_thing(value: Any, sentence: str) -> None:
    with pytest.raises(ValueError, match=f"^card {sentence}$"):
        read(Card, value, "card")


def test_values_are_described_shortly() -> None:
    assert describe("x" * 500) == repr("x" * 500)[:60]
    assert describe(b"x") == "a bytes"


_WITHIN: list[int] = [0]


def _slow() -> type[int]:
    """What the annotation below is; fails where a second thread works it out meanwhile."""
    _WITHIN[0] += 1
    time.sleep(0.02)
    alone = _WITHIN[0] == 1
    _WITHIN[0] -= 1
    return int if alone else str  # type: ignore[return-value]


@dataclass(frozen=True)
class Late:
    """Its annotations cost time, at the first reading."""

    value: _slow()  # type: ignore[valid-type]


def test_threads_read_a_new_type_one_at_a_time() -> None:
    """msgspec 0.22 ends the process if two of them meet a dataclass for the first time at once."""
    begin, read_by = threading.Barrier(4), []

    def first_reading() -> None:
        begin.wait()
        read_by.append(read(Late, {"value": 1}, "late").value)

    threads = [threading.Thread(target=first_reading) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert read_by == [1, 1, 1, 1]


# ------------------------ the columns of an action, for arms of equal and of different joint counts


UNEQUAL = (6, 7)


def test_two_arms_of_six_joints() -> None:
    space = ActionSpace("joint")
    left, right = space.arms
    assert (left.name, left.all, left.body, left.gripper) == ("left", slice(0, 7), slice(0, 6), 6)
    assert (right.all, right.body, right.gripper) == (slice(7, 14), slice(7, 13), 13)
    assert (space.width, space.grippers) == (14, [6, 13])


def test_arms_of_different_joint_counts() -> None:
    space = ActionSpace("joint", UNEQUAL)
    assert (space.width, space.grippers) == (15, [6, 14])
    assert space.arms[1].body == slice(7, 14)
    assert space.labels[5:9] == ["left joint 6", "left gripper", "right joint 1", "right joint 2"]


@pytest.mark.parametrize("kind", ["ee", "delta_ee"])
def test_poses_have_the_same_columns_whatever_the_arms(kind: str) -> None:
    space = ActionSpace(kind, UNEQUAL)
    row = list(range(space.width))
    right = space.arms[1]
    assert (space.width, space.grippers) == (16, [7, 15])
    assert row[right.position] == [8, 9, 10] and row[right.quaternion] == [11, 12, 13, 14]
    assert space.labels[8:] == [f"right {part}" for part in (*POSE, "gripper")]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("joints", [(6, 6), UNEQUAL, (7, 7)])
def test_every_column_belongs_to_one_part(kind: str, joints: tuple[int, int]) -> None:
    space = ActionSpace(kind, joints)
    row = list(range(space.width))
    assert [c for arm in space.arms for c in (*row[arm.body], arm.gripper)] == row
    assert sorted(space.bodies + space.grippers) == row
    assert len(space.labels) == len(set(space.labels)) == space.width


def test_a_joint_action_has_no_pose() -> None:
    arm = ActionSpace("joint").arms[1]
    row = list(range(14))
    assert row[arm.position] == row[arm.quaternion] == []


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'cartesian'.*joint, ee and delta_ee"):
        ActionSpace("cartesian")


# ------------- optional packages: every one has an extra, and the sentence names what pip was given


ROOT = Path(__file__).resolve().parents[2]


class Installed:
    """A distribution whose installer left a note of where it came from."""

    def __init__(self, note: str | None) -> None:
        self._note = note

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return self._note


@pytest.mark.parametrize(
    ("note", "expected"),
    [
        ('{"url": "file:///home/me/robospa", "dir_info": {}}', "/home/me/robospa"),
        ('{"url": "https://example.org/robospa.whl"}', "robospa"),
        (None, "robospa"),
        ("no json", "robospa"),
    ],
)
def test_a_remedy_names_where_robospa_came_from(
    note: str | None, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metadata, "distribution", lambda name: Installed(note))
    assert extras.remedy("pandas") == f"install it with: pip install '{expected}[notebook]'"
    assert "pip install torch --index-url https://download.pytorch" in extras.remedy("torch")


def test_every_extra_that_is_named_exists() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(extras.EXTRAS.values()) <= set(project["optional-dependencies"])


def test_a_package_that_is_there_but_lacks_one_of_its_own_is_not_called_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "halfway.py").write_text("import nothing_of_that_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="nothing_of_that_name") as found:
        extras.need("halfway")
    assert not isinstance(found.value, extras.MissingPackage)


def test_a_part_of_ours_that_lacks_an_extra_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError("No module named 'sapien'", name="sapien")

    monkeypatch.setattr(registry.importlib, "import_module", missing)
    with pytest.raises(registry.UnknownName, match=r"sapien is not installed; .*\[sim\]'"):
        registry.load("robospa.harness.sim.sapien_world:SapienWorld")
    with pytest.raises(registry.UnknownName, match="cannot load 'mine:Policy': No module named"):
        registry.load("mine:Policy")


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {}, "home/.cache/robospa"),
        ("linux", {"XDG_CACHE_HOME": "/x"}, "/x/robospa"),
        ("darwin", {"XDG_CACHE_HOME": "/x"}, "home/Library/Caches/robospa"),
        ("win32", {}, "home/AppData/Local/robospa"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local/robospa"),
        ("linux", {"ROBOSPA_CACHE": "/mine", "XDG_CACHE_HOME": "/x"}, "/mine"),
    ],
)
def test_the_folder_of_caches(
    platform: str, variables: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROBOSPA_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"HOME": "home", **variables}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.platform", platform)
    assert user_cache() == Path(expected)
