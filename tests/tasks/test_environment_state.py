"""The objects as numbers: measured, complete, and silent about their roles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.geometry import Pose, axis_rotation
from robospa.observation import FEATURES, NAMES, SLOTS, WIDTH
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.colors import NAMED
from robospa.tasks.environment_state import EnvironmentState, TooManyObjects, kind_code
from robospa.tasks.objects import assets, object_model
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.snapshot import Snapshot

HOME = (Pose(), Pose())


def scene(*objects: SceneObject) -> Scene:
    built = build_scene("Pick_Blocks_Size", 1, 1_000_000, "aloha-agilex", "clean")
    return replace(built, objects=objects)


def block(name: str, x: float, turn: float = 0.0, color: str = "red") -> SceneObject:
    params = {"half": [0.01, 0.02, 0.03], "color": list(NAMED[color])}
    return SceneObject(name, "block", Pose((x, 0.1, 0.8), axis_rotation((0, 0, 1), turn)), params)


def row(
    of: Scene, *, moved: float = 0.0, hinges: dict[str, float] | None = None
) -> NDArray[np.float32]:
    x_moved = (moved, 0.0, 0.0)
    poses = {
        item.name: Pose(tuple(np.add(item.pose.position, x_moved).tolist()), item.pose.rotation)  # type: ignore[arg-type]
        for item in of.objects
        if item.appears_at is None
    }
    seen = Snapshot(
        0.0, poses, (1.0, 1.0), HOME, grasp_points=((0, 0, 0), (0, 0, 0)), hinges=hinges or {}
    )
    return EnvironmentState(of, object_model).row(seen).reshape(SLOTS, len(FEATURES))


def value(slot: NDArray[np.float32], name: str) -> float:
    return float(slot[FEATURES.index(name)])


def test_a_slot_says_what_lies_where() -> None:
    slot = row(scene(block("a", -0.2, turn=math.pi / 6)), moved=0.05)[0]
    found = dict(zip(FEATURES, slot.tolist(), strict=True))
    assert (found["present"], found["hinge"]) == (1, 0)
    at = [found[name] for name in ("x", "y", "z", "half_x", "half_y", "half_z")]
    assert at == pytest.approx([-0.15, 0.1, 0.8, 0.01, 0.02, 0.03])
    assert (found["cos_yaw"], found["sin_yaw"]) == pytest.approx((math.sqrt(0.75), 0.5))
    assert (found["cos_2yaw"], found["sin_4yaw"]) == pytest.approx((0.5, math.sqrt(0.75)))
    assert [found["up_x"], found["up_y"], found["up_z"]] == pytest.approx([0, 0, 1], abs=1e-6)
    assert [found[c] for c in ("red", "green", "blue")] == pytest.approx(NAMED["red"])
    assert slot[-12:].tolist() == kind_code("block")


def test_slots_are_taken_from_left_to_right_whatever_the_names_and_kept() -> None:
    objects = (block("b", 0.1, color="blue"), block("a", 0.3), block("c", -0.3, color="green"))
    lying, moved = row(scene(*objects)), row(scene(*objects[::-1]), moved=0.5)
    assert [value(slot, "x") for slot in lying[:4]] == pytest.approx([-0.3, 0.1, 0.3, 0.0])
    assert [value(slot, "x") for slot in moved[:3]] == pytest.approx([0.2, 0.6, 0.8])
    assert not lying[3:].any()
    unchanged = [i for i, name in enumerate(FEATURES) if name != "x"]
    assert np.array_equal(lying[:, unchanged], moved[:, unchanged])


def test_what_does_not_exist_yet_is_not_there() -> None:
    later = replace(block("a", -0.3), appears_at=1.0)
    rows = row(scene(later, block("b", 0.2)))
    assert not rows[0].any() and value(rows[1], "present") == 1


def test_a_hinge_has_its_angle() -> None:
    door = SceneObject("m", "microwave", Pose((0.0, 0.1, 0.74)), {"look": 0})
    assert value(row(scene(door), hinges={"m": 0.7})[0], "hinge") == pytest.approx(0.7)


def test_every_asset_has_a_code_of_its_own() -> None:
    codes = {tuple(kind_code(asset)) for asset in assets()}
    assert len(codes) == len(assets())


def test_a_scene_with_too_many_objects_is_refused() -> None:
    many = [block(str(i), i / 100) for i in range(SLOTS + 1)]
    with pytest.raises(TooManyObjects, match="has 21 objects, and an environment state holds 20"):
        EnvironmentState(scene(*many), object_model)


def test_the_fullest_scenes_of_the_suite_fit_and_roles_do_not_show() -> None:
    assert WIDTH == len(NAMES) == len(set(NAMES))
    name = "Observe_Blocks_Move_Memory"
    assert name in tasks()
    built = build_scene(name, 5, 1_000_000, "aloha-agilex", "clean")
    shuffled = replace(built, objects=tuple(reversed(built.objects)))
    assert len(built.objects) <= SLOTS and np.array_equal(row(built), row(shuffled))
