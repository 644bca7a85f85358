"""What users write for tasks, levels and seeds, and what they are told when it is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from robospa.harness.selection import (
    list_trials,
    parse_levels,
    parse_numbers,
    parse_seeds,
    parse_tasks,
)
from robospa.harness.settings import Selection, SettingsError
from robospa.tasks import catalog
from robospa.tasks.task import Task


def test_all_tasks_in_the_papers_order() -> None:
    names = parse_tasks("all")
    assert len(names) == len(set(names)) >= 10
    assert names[0] == "Pick_Blocks_Size"


def test_tasks_by_category_dimension_and_name() -> None:
    assert "Pick_Blocks_Size" in parse_tasks("gac")
    assert set(parse_tasks("spatial")) | set(parse_tasks("procedural")) == set(parse_tasks("all"))
    assert parse_tasks("pick blocks size, GAC")[0] == "Pick_Blocks_Size"
    assert parse_tasks("Pick_Blocks_Size,Pick_Blocks_Size") == ["Pick_Blocks_Size"]


def test_basic_grounding_is_no_part_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(name: str, category: str) -> Task:
        return replace(catalog.task("Pick_Blocks_Size"), name=name, category=category)

    sets = ("CBG", "EPG", "SOI")
    made = [fake("Base", "GAC"), *(fake(f"{c}_{i}", c) for c in sets for i in range(5))]
    monkeypatch.setattr(catalog, "tasks", lambda: {t.name: t for t in made})
    assert parse_tasks("all") == ["Base"]
    assert parse_tasks("basic") == [t.name for t in made[1:]]
    assert parse_tasks("epg") == [f"EPG_{i}" for i in range(5)]
    assert len(parse_tasks("all,basic")) == 16


@pytest.mark.parametrize("text", ["", "Pick_Nothing_At_All", "XYZ"])
def test_unknown_tasks_are_refused(text: str) -> None:
    with pytest.raises(SettingsError):
        parse_tasks(text)


def test_levels() -> None:
    assert parse_levels("1,3-5") == [1, 3, 4, 5]


@pytest.mark.parametrize("text", ["0", "6", "", "2-1", "1-", "-1", "a", "1,,2", "1-99999999"])
def test_levels_that_do_not_exist_are_refused(text: str) -> None:
    with pytest.raises(SettingsError):
        parse_levels(text)


def test_numbers_keep_their_order_and_lose_repetitions() -> None:
    assert parse_numbers("5,3-4,5", "seeds") == [5, 3, 4]
    with pytest.raises(SettingsError, match="is more than"):
        parse_numbers(str(10**23), "seeds")


@pytest.mark.parametrize("text", ["{", '{"A": {"1": [1.5]}}', '{"A": {"1": [-1]}}', "{}"])
def test_bad_seed_files_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "seeds.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"seeds\.json"):
        parse_seeds(str(path))("A", 1)


def test_the_first_seeds_of_every_variant() -> None:
    tasks = "Pick_Blocks_Size,Press_Stapler_Repeat"
    keys = list_trials(Selection(tasks, "1,2", 2, "7-9", "train"))
    assert [(k.task, k.level, k.seed) for k in keys][:3] == [
        ("Pick_Blocks_Size", 1, 7), ("Pick_Blocks_Size", 1, 8), ("Pick_Blocks_Size", 2, 7)
    ]  # fmt: skip
    assert len(keys) == 8
    assert {(k.embodiment, k.mode, k.split) for k in keys} == {("aloha-agilex", "clean", "train")}


def test_a_variant_with_too_few_seeds_is_named() -> None:
    with pytest.raises(SettingsError, match="Pick_Blocks_Size level 1 has 3 seeds, not 4"):
        list_trials(Selection("Pick_Blocks_Size", "1", 4, "7-9,7"))


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (Selection(embodiment="nao"), r"no embodiment 'nao'; known are .*aloha-agilex"),
        (Selection(embodiment="aloha_agilex"), r"did you mean aloha-agilex\?"),
        (Selection(mode="cleen"), r"no scene mode 'cleen'; did you mean clean\?"),
    ],
)
def test_robots_and_modes_that_are_not_installed_are_refused(
    wrong: Selection, sentence: str
) -> None:
    with pytest.raises(SettingsError, match=sentence):
        list_trials(wrong)
