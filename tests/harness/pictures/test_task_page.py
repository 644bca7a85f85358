"""The page of all tasks: up to date with the catalog, and right in what it says of the levels."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

import pytest
from drawn_scenes import each_task

from robospa.harness.pictures import task_page
from robospa.tasks.catalog import tasks
from robospa.tasks.task import Task

ROOT = Path(__file__).resolve().parents[3]


WRITTEN = (ROOT / task_page.PAGE).read_text().splitlines()
AGAIN = "run `python -m robospa.harness.pictures.task_page`"


def written_row(task: Task) -> str:
    """The line of a task that the page has."""
    found = [line for line in WRITTEN if f"**{task.name}**" in line]
    assert len(found) == 1, f"{len(found)} lines of {task.name}: {AGAIN}"
    return found[0]


@each_task
def test_the_row_of_a_task_is_what_the_catalog_says(name: str) -> None:
    assert written_row(tasks()[name]) == task_page.row(tasks()[name]), AGAIN


def test_the_rest_of_the_page_is_what_the_catalog_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_page, "row", written_row)
    expected = task_page.page().splitlines()
    differ = [a for a, b in zip_longest(WRITTEN, expected) if a != b]
    assert differ == [], AGAIN


def test_every_task_has_its_picture_and_they_are_small() -> None:
    folder = ROOT / task_page.PICTURES
    assert {p.name for p in folder.iterdir()} == {
        task_page.picture_name(task) for task in tasks().values()
    }
    assert sum(p.stat().st_size for p in folder.iterdir()) < 2_000_000


@pytest.mark.parametrize(
    ("values", "text"),
    [([150] * 5, "150"), ([2, 3, 4, 5, 6], "2 to 6"), ([1, 2, 2, 3, 3], "1, 2, 2, 3, 3")],
)
def test_values_of_five_levels_in_words(values: list[int], text: str) -> None:
    assert task_page.per_level(values) == text


def test_a_row_says_the_limits_of_all_levels() -> None:
    line = task_page.row(tasks()["Click_Can_Place_Items"])
    assert "T 1 to 5<br>limit 200, 400, 600, 800, 1000" in line and line.count("|") == 5
