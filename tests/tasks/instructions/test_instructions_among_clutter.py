"""Sentences of scenes with clutter: the same as without, and still true of one object."""

from __future__ import annotations

import pytest

from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.sentences import ANY_KIND, SPLITS, kinds_clause, sentences

SINGLE = [name for name, task in tasks().items() if task.dimension != "procedural"]


@pytest.mark.parametrize("split", SPLITS)
def test_a_sentence_that_fits_any_thing_ends_in_the_kinds_that_count(split: str) -> None:
    for name in SINGLE[::4]:
        clean, cluttered = (build_scene(name, 2, 3, mode=m) for m in ("clean", "randomized"))
        clause = f" {kinds_clause(cluttered)}"
        for said, here in zip(sentences(clean, split), sentences(cluttered, split), strict=True):
            assert here in (said, said + clause)
            assert here.endswith(clause) or not ANY_KIND.search(said)


def test_sequences_of_actions_are_told_in_the_same_words() -> None:
    for name in set(tasks()) - set(SINGLE):
        clean, cluttered = (build_scene(name, 2, 3, mode=m) for m in ("clean", "randomized"))
        assert sentences(clean, "train") == sentences(cluttered, "train")


@pytest.mark.parametrize(
    ("task", "clause"),
    [
        ("Pick_Mugs_Distance", "Only the mugs count."),
        ("Pick_Tea_Box_Relational", "Only the tea boxes count."),
        ("Pick_Breads_Multi_View", "Only the loaves of bread count."),
    ],
)
def test_the_clause_names_all_kinds(task: str, clause: str) -> None:
    assert kinds_clause(build_scene(task, 3, 3)) == clause
    mixed = build_scene("Pick_Mixed_Objects_Distance_A", 1, 3)
    said = kinds_clause(mixed)
    assert said.count("the ") == len(mixed.objects) and said.startswith("Only the ")
