"""What a reader calls the objects of a scene."""

import pytest

from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.descriptions import describe_objects


def test_objects_that_look_alike_are_counted_from_the_left() -> None:
    scene = build_scene("Basic_Ordinal_Blocks", 1, 100000)
    row = sorted(scene.objects, key=lambda o: o.pose.position[0])
    found = describe_objects(scene)
    assert [found[o.name] for o in row] == [
        f"the block, {place} from the left" for place in ("1st", "2nd", "3rd")
    ]


@pytest.mark.parametrize(
    ("task", "level", "axis", "names"),
    [
        ("Pick_Blocks_Size", 1, 0, ["the larger block", "the smaller block"]),
        ("Pick_Blocks_Height", 1, 2, ["the taller block", "the shorter block"]),
        (
            "Pick_Blocks_Length",
            3,
            0,
            ["the longest block", "the 2nd longest block", "the 3rd longest block",
             "the shortest block"],
        ),
        (
            "Pick_Blocks_Area",
            2,
            0,
            ["the block with the largest base", "the block with the 2nd largest base",
             "the block with the smallest base"],
        ),
    ],
)  # fmt: skip
def test_objects_that_differ_in_size_alone_are_called_by_it(
    task: str, level: int, axis: int, names: list[str]
) -> None:
    scene = build_scene(task, level, 100000)
    found = describe_objects(scene)
    ranked = sorted(scene.objects, key=lambda o: -o.params["half"][axis])
    assert [found[o.name] for o in ranked] == names


def test_a_colour_that_has_a_word_is_named() -> None:
    found = describe_objects(build_scene("Stack_Blocks_Color_Order", 3, 100000))
    assert set(found.values()) == {"the red block", "the green block", "the blue block"}


def test_an_object_of_its_own_look_needs_no_place() -> None:
    found = describe_objects(build_scene("Press_Stapler_Repeat", 1, 100000))
    assert found == {"object_0": "the yellow stapler"}


@pytest.mark.parametrize(
    ("task", "names"),
    [
        ("Observe_Blocks_Move_Memory", {"the stand", "the wall"}),
        ("Observe_Objects_Click_Memory", {"the stand", "the wall"}),
        ("Remember_Orientation_Restore", {"the wall"}),
        ("Click_Can_Place_Items", set()),
    ],
)
def test_what_shows_and_hides_something_to_remember_is_no_block(task: str, names: set[str]) -> None:
    found = set(describe_objects(build_scene(task, 5, 100000)).values())
    assert found & {"the stand", "the wall"} == names
    assert not found & {"the block", "the gray block"}


@pytest.mark.parametrize("name", sorted(tasks()))
def test_no_two_objects_of_a_scene_are_called_alike(name: str) -> None:
    scene = build_scene(name, 5, 100000)
    found = describe_objects(scene)
    assert list(found) == [o.name for o in scene.objects]
    assert len(set(found.values())) == len(found)
