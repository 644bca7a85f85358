"""Sentences and questions that a profile puts in the place of a scene's own."""

import pytest

from robospa.tasks.catalog import build_scene, extensions, tasks
from robospa.tasks.modes.randomized import axes
from robospa.tasks.modes.wording import QUESTIONS
from robospa.tasks.sentences import instruction, sentences

SINGLE = [
    t.name for t in (*tasks().values(), *extensions().values()) if t.dimension != "procedural"
]


@pytest.mark.parametrize("name", SINGLE)
def test_another_target_is_another_object_of_the_same_scene(name: str) -> None:
    """The drawn question is among those that are made of its scene, so the others are right too."""
    for level in range(1, 6):
        scene = build_scene(name, level, 100_001)
        other = build_scene(name, level, 100_001, mode="randomized:other-target")
        assert other.objects == scene.objects
        assert other.facts["target"] != scene.facts["target"]
        make = next(make for fact, make in QUESTIONS.items() if fact in scene.facts)
        back = other if "relation" in scene.facts else scene
        assert any({**back.facts, **facts} == scene.facts for facts in make(back))
        assert instruction(other) != instruction(scene)


def test_rewordings_are_sentences_of_the_scene_and_follow_from_its_seed() -> None:
    def said(mode: str, seed: int = 100_003) -> str:
        return instruction(build_scene("Pick_Mugs_Distance", 2, seed, mode=f"randomized:{mode}"))

    scene = build_scene("Pick_Mugs_Distance", 2, 100_003)
    own, all_of_it = instruction(scene), sentences(scene, "heldout")
    for axis in ("other-words", "other-order", "short", "long"):
        assert said(axis) in all_of_it and said(axis) == said(axis)
    assert said("other-words") != own != said("other-order")
    assert len(said("short")) < len(said("long"))
    assert said("indirect") in sentences(scene, "indirect")
    assert said("lower-case") == own.lower().rstrip(".")
    wrong = said("typos=3")
    assert sum(a != b for a, b in zip(own.split(), wrong.split(), strict=True)) in (1, 2, 3)
    assert sorted(own) == sorted(wrong)
    assert said("no-sentence") == "" and said("nothing-here") != own
    assert "mug" not in said("nothing-here")
    strange = {said("other-scene", seed) for seed in range(100_000, 100_008)}
    assert len(strange) == 8 and own not in strange and said("other-scene") == said("other-scene")


def test_axes_are_named_one_by_one_in_groups_or_all() -> None:
    assert axes("blur=3, grey") == [("blur", 3.0), ("grey", 1.0)]
    assert [strength for name, strength in axes("noise")] == [10, 20, 40]
    assert {name for name, _ in axes("words")} > {"typos", "other-target"}
    assert "latency" not in dict(axes("all")) and "repeat" in dict(axes("all"))
    with pytest.raises(ValueError, match="did you mean blur"):
        axes("blurr")
    with pytest.raises(ValueError, match="no part or axis ''"):
        axes("blur,")  # not "repeat", the one axis of no group
