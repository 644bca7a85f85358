"""The page of all tasks: up to date with the catalog, and right in what it says of the levels."""

from __future__ import annotations

from pathlib import Path

import pytest
import task_page

from robospa.tasks.catalog import tasks

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_what_the_catalog_says() -> None:
    again = "run `python tools/task_page.py --text`"
    assert (ROOT / task_page.PAGE).read_text() == task_page.page(ROOT), again


def test_every_task_has_its_picture_and_they_are_small() -> None:
    folder = ROOT / task_page.PICTURES
    assert {p.name for p in folder.iterdir()} == {
        task_page.picture_name(task) for task in tasks().values()
    }
    assert sum(p.stat().st_size for p in folder.iterdir()) < 2_000_000


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([150] * 5, "150"),
        ([200, 400, 600, 800, 1000], "200 to 1000"),
        ([1, 2, 2, 3, 3], "1, 2, 2, 3, 3"),
    ],
)
def test_values_of_five_levels_in_words(values: list[int], text: str) -> None:
    assert task_page.per_level(values) == text


def test_a_row_says_the_limits_of_all_levels() -> None:
    rates = {"hold": "0/0/20"}
    line = task_page.row(tasks()["Click_Can_Place_Items"], True, rates, ["hold", "other"])
    assert "T 1 to 5<br>limit 200 to 1000" in line and line.endswith("| 0/0/20 | - |")
