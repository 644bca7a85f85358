"""Which official model each look of our assets stands for."""

import pytest

from robospa.tasks import catalog
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.official import POINTS, needs, official_assets, official_model, official_models

BUILT_IN = {"block", "cover", "garbage", "pad", "t_block"}
"""Boxes and balls officially too, or not published."""


def test_every_asset_but_boxes_has_an_official_model_for_each_look() -> None:
    assert {*official_assets()} == {*assets()} - BUILT_IN
    for asset in official_assets():
        assert len(official_models(asset)) == variant_count(asset), asset


def test_a_model_is_called_as_in_the_official_files() -> None:
    can = official_model("can", 4)
    assert can is not None and can.name == "071_can/base5"
    assert official_model("block", 0) is None
    with pytest.raises(ValueError, match="looks 0 to 5"):
        official_model("can", 6)


@pytest.mark.parametrize("asset", official_assets())
def test_points_belong_to_frames_that_the_asset_has(asset: str) -> None:
    frames = object_model(asset).frames
    for model in official_models(asset):
        assert {*model.points} <= {*frames} & POINTS
        for point in model.points.values():
            kind, _, number = point.partition(" ")
            assert kind in ("contact", "functional") and number.isdigit()
        if model.faces:
            assert model.faces.partition(" = ")[2] in frames


def test_needs_lists_every_task_of_the_benchmark() -> None:
    benchmark = {name for name, task in catalog.tasks().items() if task.dimension != "basic"}
    assert {*needs()} == benchmark
    assert {asset for row in needs().values() for asset in row} <= {*official_assets()}


@pytest.mark.parametrize("task", [*needs()])
def test_scenes_hold_what_needs_lists(task: str) -> None:
    scenes = [catalog.build_scene(task, level, 100_000) for level in catalog.LEVELS]
    held = {item.asset for scene in scenes for item in scene.objects} - BUILT_IN
    assert held <= {*needs()[task]} and bool(held) == bool(needs()[task])
