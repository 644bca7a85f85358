"""Clutter in the simulator: heavy, at rest, in no one's way, and noticed when it is moved."""

from dataclasses import replace

import numpy as np
import pytest

from robospa.geometry import Pose
from robospa.harness.factory import policy_factory
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import SceneObject
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
PLACE = ("Pick_Blocks_Size", 3, 100_003)
ORACLE = "robospa.baselines.oracle:create"


@pytest.fixture(scope="module")
def world() -> SapienWorld:
    return SapienWorld()


def test_objects_come_to_rest_where_they_do_without_it(world: SapienWorld) -> None:
    poses = []
    for mode in ("clean", "randomized:clutter"):
        scene = build_scene(*PLACE, mode=mode)
        world.load(scene)
        there = world.snapshot().poses
        assert set(there) == {item.name for item in scene.everything}
        poses.append(np.array([there[item.name].position for item in scene.objects]))
        for item in scene.clutter:
            assert np.abs(np.subtract(there[item.name].position, item.pose.position)).max() < 3e-3
    assert scene.clutter and np.abs(poses[0] - poses[1]).max() < 1e-5


def test_clutter_weighs_what_its_volume_of_water_does(world: SapienWorld) -> None:
    can = SceneObject("clutter_0", "can", Pose((0.3, 0.2, 0.74)))
    scene = build_scene(*PLACE)
    world.load(replace(scene, clutter=(can,)))
    assert 0.15 < world.loaded().moving["clutter_0"].mass < 0.4  # type: ignore[attr-defined]


def test_a_collision_is_recorded_and_the_trial_goes_on(world: SapienWorld) -> None:
    """Things stand right beside the target, where the opened fingers come down."""
    key = TrialKey(*PLACE, mode="randomized:clutter")

    def crowded(key: TrialKey) -> TrialSetup:
        parts = task_parts(key)
        x, y, _ = parts.scene.object(parts.scene.facts["target"]).pose.position
        row = (-0.055, 0.055)
        clutter = tuple(
            SceneObject(f"clutter_{i}", "glue", Pose((x + dx, y + dy, 0.74)))
            for i, (dx, dy) in enumerate((a, b) for a in (*row, 0.0) for b in (*row, 0.0) if a or b)
        )
        return replace(parts, scene=replace(parts.scene, clutter=clutter))

    record = run_trial(world, policy_factory(ORACLE)(), key, policy_seed=0, parts=crowded)
    moved = record.diagnostics["clutter_moved"]
    told = [e["object"] for e in record.events if e["kind"] == "clutter_moved"]
    assert moved and moved == told and record.diagnostics["clutter"] == 8
    assert record.diagnostics["objects"][moved[0]].endswith("(clutter)")
    assert not any(e["kind"] == "wrong_object" for e in record.events)
