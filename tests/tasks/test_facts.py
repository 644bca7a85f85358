"""Facts of a scene: typed in the task, plain JSON in the scene."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pytest

from robospa.tasks import catalog
from robospa.tasks.scene import Scene
from robospa.tasks.task import SceneFacts


@dataclass(frozen=True)
class Facts(SceneFacts):
    order: tuple[str, ...]
    color: str | None
    bell: str = ""
    count: int = 0


def scene_with(facts: SceneFacts) -> Scene:
    return Scene("Any", 1, 0, "robot", "clean", (), json.loads(json.dumps(facts.to_json())))


@pytest.mark.parametrize(
    ("facts", "plain"),
    [
        (Facts(("a", "b"), "red", "c", 2),
         {"order": ["a", "b"], "color": "red", "bell": "c", "count": 2}),
        (Facts((), None), {"order": [], "color": None}),
    ],
)  # fmt: skip
def test_facts_are_plain_in_the_scene_and_come_back(facts: Facts, plain: dict[str, object]) -> None:
    assert facts.to_json() == plain
    assert Facts.of(scene_with(facts)) == facts


def test_a_base_reads_its_own_fields_only() -> None:
    @dataclass(frozen=True)
    class Ordered(SceneFacts):
        order: tuple[str, ...]

    assert Ordered.of(scene_with(Facts(("a",), "red"))) == Ordered(("a",))


@pytest.mark.parametrize("name", catalog.tasks())
def test_facts_of_built_scenes_are_what_json_gives_back(name: str) -> None:
    scene = catalog.build_scene(name, 5, 100000)
    assert json.loads(json.dumps(scene.facts)) == scene.facts
    assert Scene.from_json(scene.to_json()) == scene
