"""The scene of a recording, as far as the recording has it.

Ours name their trial. Of official ones only those of Cross View Reasoning keep where things lay,
without their turns; the turn of the one that is taken follows from how the gripper closed on it,
the others stand straight. Of all others a seed is kept, which makes the scene in the official code
alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from robospa.geometry import Pose, rotate, yaw_rotation
from robospa.harness.convention_check.episodes import Episode
from robospa.harness.official.recordings import Recording, key_of
from robospa.harness.trial import TrialParts, task_parts
from robospa.schema import Count, Number
from robospa.schema import read as read_as
from robospa.tasks.catalog import task as find_task
from robospa.tasks.objects import object_model
from robospa.tasks.official import official_assets, official_models
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.shapes import ObjectModel
from robospa.trial import REFERENCE, TrialKey
from robospa.workcell import TABLE_TOP

BLOCK = "primitive_block"
"""What official layouts call a cube."""
BLOCK_HALF = 0.015
BLOCK_COLORS = (
    (0.84, 0.22, 0.18), (0.16, 0.58, 0.82), (0.22, 0.67, 0.28),
    (0.90, 0.74, 0.18), (0.58, 0.34, 0.80), (0.28, 0.28, 0.28),
)  # fmt: skip
"""Of its variants (fact sheet)."""
VIEWERS = {"back": "robot", "front": "opposite", "left": "left", "right": "right"}
CLOSED = 0.5
"""A gripper that was told less has closed."""
MOST_OBJECTS = 32


class NotStored(ValueError):
    """The scene of a recording cannot be made from what it keeps; the message says why."""


def rebuilt(recording: Recording, episode: Episode) -> tuple[TrialKey, TrialParts]:
    """The trial of `recording` with its scene made again; raises NotStored."""
    key = key_of(episode)
    if key is not None:
        try:
            return key, task_parts(key)
        except (KeyError, ValueError) as error:
            raise NotStored(f"its trial cannot be made: {error}") from error
    if recording.variant is None:
        raise NotStored("its folder names no task and level, such as Pick_Blocks_Size_5")
    layout = recording.scene.get("layout")
    if not isinstance(layout, dict) or "object_positions" not in layout:
        raise NotStored(
            "where things lay is not stored: its seed makes the scene in the official code alone"
        )
    if len(episode.space.joints) != 2 or set(episode.space.joints) != {6}:
        raise NotStored(f"which robot it is of is not stored, and it is not {REFERENCE}")
    key = TrialKey(*recording.variant, recording.seed or 0, REFERENCE, "clean", "train")
    return key, _parts(key, layout, episode)


def _parts(key: TrialKey, layout: Mapping[str, Any], episode: Episode) -> TrialParts:
    names = read_as(list[str], layout.get("scene_assets"), "scene_assets", NotStored)
    places = read_as(list[list[Number]], layout["object_positions"], "object_positions", NotStored)
    target = read_as(Count, layout.get("target_index"), "target_index", NotStored)
    if not (target < len(names) == len(places) <= MOST_OBJECTS) or any(len(p) != 3 for p in places):
        raise NotStored("its layout names other things than it has places for")
    viewer = VIEWERS.get(str(layout.get("view_name")))
    if viewer is None:
        raise NotStored("its layout names no viewer")
    objects = []
    for number, (name, (x, y, _)) in enumerate(zip(names, places, strict=True)):
        asset, params = _ours(name)
        model = object_model(asset, params)
        yaw = _turn(model, episode) if number == target else 0.0
        pose = Pose((float(x), float(y), TABLE_TOP - model.bottom), yaw_rotation(yaw))
        objects.append(SceneObject(f"object_{number}", asset, pose, params))
    facts = {
        "target": f"object_{target}",
        "extreme": str(layout.get("position_key")),
        "viewpoint": viewer,
        "position": str(layout.get("observed_position_key")),
    }
    scene = Scene(key.task, key.level, key.seed, key.embodiment, key.mode, tuple(objects), facts)
    task = find_task(key.task)
    return TrialParts(scene, task, task.goal(scene), episode.instruction)


def _ours(name: str) -> tuple[str, dict[str, Any]]:
    """Our asset, and its parameters, for an official model such as "071_can/base3"."""
    folder, _, model = name.partition("/base")
    if folder == BLOCK:
        color = BLOCK_COLORS[int(model) % len(BLOCK_COLORS)] if model.isdigit() else BLOCK_COLORS[0]
        return "block", {"half": [BLOCK_HALF] * 3, "color": list(color)}
    looks = [
        (asset, look, one)
        for asset in official_assets()
        for look, one in enumerate(official_models(asset))
        if one.folder == folder
    ]
    if not looks:
        raise NotStored(f"there is nothing here for the official model {name[:60]!r}")
    asset, look, _ = next((row for row in looks if row[2].model == model), looks[0])
    return asset, {"look": look}


def _turn(model: ObjectModel, episode: Episode) -> float:
    """The turn about z [rad] in which the gripper takes `model` as it was taken in `episode`."""
    told = episode.ee[:, :, -1]
    closing = [(int(np.argmax(told[:, arm] < CLOSED)), arm) for arm in (0, 1)
               if (told[:, arm] < CLOSED).any()]  # fmt: skip
    if not closing or not model.grasps:
        return 0.0
    t, arm = min(closing)
    w, x, y, z = (float(v) for v in episode.ee[t, arm, 3:7])
    approach, across = (rotate((w, x, y, z), axis) for axis in ((1, 0, 0), (0, 1, 0)))
    best = (math.inf, 0.0)
    for grasp in model.grasps:
        if math.hypot(*grasp.closing[:2]) < 0.5 or math.hypot(*across[:2]) < 0.5:
            continue
        turn = math.atan2(across[1], across[0]) - math.atan2(grasp.closing[1], grasp.closing[0])
        for yaw in (turn, turn + math.pi):
            error = math.dist(rotate(yaw_rotation(yaw), grasp.approach), approach)
            best = min(best, (error, math.remainder(yaw, 2 * math.pi)))
    return best[1]
