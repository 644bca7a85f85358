"""Which entries of the leaderboard are ranked against which: never the paper's against ours."""

from __future__ import annotations

import html
import json
from dataclasses import replace

import pytest
from site_fakes import many_entries

from robospa.leaderboard.entries import Entry, Group, group, published_entries, ranks
from robospa.leaderboard.site import index_page, model_data
from robospa.results.paper.origin import ORIGIN

PAPER = "paper, aloha-agilex, clean, paper"


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    """The four published models and 30 made-up ones of robospa-1."""
    return many_entries(30)


def test_the_published_models_share_a_group_with_each_other_alone(entries: list[Entry]) -> None:
    groups: dict[str, list[str]] = {str(group(entry)): [] for entry in entries}
    for entry in entries:
        groups[str(group(entry))].append(entry.name)
    assert groups.pop(PAPER) == ["RDT", "GO-1", "π0.5", "X-VLA"]
    assert {name: len(found) for name, found in groups.items()} == {
        "robospa-1, aloha-agilex, clean, heldout": 15,
        "robospa-1, aloha-agilex, randomised, heldout": 15,
    }


def test_published_models_have_no_rank(entries: list[Entry]) -> None:
    assert [bool(ranks(entry)) for entry in entries] == [False] * 4 + [True] * 30


def test_who_was_not_reproduced_on_hidden_scenes_is_a_claim(entries: list[Entry]) -> None:
    entry = replace(entries[5], cells=())
    assert group(entry) and not model_data(entry)["ranks"]


def test_the_page_is_given_groups_and_who_is_ranked(entries: list[Entry]) -> None:
    """The page's script ranks by these two fields and by nothing else."""
    made = [model_data(entry) for entry in (*entries[:5], replace(entries[5], split=""))]
    assert [(one["group"], bool(one["ranks"])) for one in made] == [
        *[(PAPER, False)] * 4,
        ("robospa-1, aloha-agilex, clean, heldout", True),
        ("", False),
    ]


def test_the_page_shows_one_part_for_each_group_the_papers_last(entries: list[Entry]) -> None:
    page = index_page(entries)
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert [one["key"] for one in data["groups"]] == [
        "robospa-1, aloha-agilex, clean, heldout",
        "robospa-1, aloha-agilex, randomised, heldout",
        PAPER,
    ]
    assert [bool(one["note"]) for one in data["groups"]] == [False, False, True]
    assert {model["group"] for model in data["models"]} == {one["key"] for one in data["groups"]}
    assert data["groups"][-1]["title"].startswith("Numbers printed in the paper")
    assert "other object meshes, another renderer" in data["apart"]["paper"]
    assert ORIGIN in html.unescape(page)


@pytest.mark.parametrize("part", ["suite", "embodiment", "mode", "split"])
def test_what_is_not_stated_equals_nothing(part: str) -> None:
    entry = replace(published_entries()[0], **{part: ""})
    assert group(entry) is None
    assert not ranks(entry)


@pytest.mark.parametrize("part", ["suite", "embodiment", "mode", "split"])
def test_one_other_part_is_another_group(part: str) -> None:
    one = Group("robospa-1", "aloha-agilex", "clean", "heldout")
    assert replace(one, **{part: "another"}) != one


def test_skills_are_ranked_among_themselves_and_paired_with_no_joints(entries: list[Entry]) -> None:
    def said_to_be(entry: Entry, track: str) -> Entry:
        results = entry.column.results
        setting = replace(results.setting, track=(track,))
        return replace(
            entry, column=replace(entry.column, results=replace(results, setting=setting))
        )

    first, second = (entry for entry in entries[4:7:2])
    skills = said_to_be(second, "skills")
    assert group(first) == group(second) != group(skills) and ranks(skills)
    shown = [model_data(one)["group"] for one in (first, skills)]
    assert shown[1] == f"{shown[0]}, skills"
    found = group(skills)
    assert found and found.title.startswith("Track of skills, robospa-1")


def test_nobody_is_ranked_in_a_suite_that_still_changes(entries: list[Entry]) -> None:
    draft = replace(entries[-1], suite="robospa-3-draft")
    found = group(draft)
    assert not ranks(draft)
    assert found is not None and "draft" in found.note
