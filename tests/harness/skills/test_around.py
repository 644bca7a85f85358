"""Stops with which what is held gets around a thing that stands close beside it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from robot_at_home import at_home

from robospa.geometry import Pose
from robospa.harness.robots.kinematics import end_effector
from robospa.harness.skills.around import stop_beside
from robospa.harness.skills.clearance import part_boxes
from robospa.harness.skills.motion import route
from robospa.harness.skills.narrow import Narrow
from robospa.harness.skills.workspace import Array, Workspace
from robospa.tasks.objects import object_model
from robospa.tasks.scene import SceneObject
from robospa.workcell import TABLE_TOP

LIFTED = np.array([0.3, 2.02, -1.67, 0.08, 1.12, -0.38])
"""With these joints a Piper has lifted a phone that lay beside the stand."""
BEFORE = np.array([1.01, 1.94, -1.31, 1.54, -0.96, -1.1])
"""With these it is about to lean it on the stand."""


def holding_a_phone() -> tuple[Workspace, Pose]:
    """A Piper's right arm with a phone beside a phone stand; and how it holds the phone."""
    turned = (0.95, 0.0, 0.0, 0.32)
    phone = SceneObject("phone", "phone", Pose((0.155, -0.035, TABLE_TOP + 0.1), turned))
    stand = SceneObject("stand", "phone_stand", Pose((0.0, 0.019, TABLE_TOP)))
    ws = at_home("piper", phone, stand)
    ws.joints[1], ws.held[1] = LIFTED, "phone"
    return ws, end_effector(ws.chains[1], LIFTED).inverse() * phone.pose


def touched(ws: Workspace, offset: Pose, *stops: Array) -> float:
    """How deep [m] phone and stand are in each other, or the phone in the table, on the lines."""
    stand = part_boxes(ws.models["stand"], ws.pose("stand"))
    deepest = 0.0
    for a, b in pairwise(stops):
        for share in np.linspace(0.0, 1.0, 60):
            body = end_effector(ws.chains[1], a + (b - a) * share) * offset
            phone = part_boxes(ws.models["phone"], body)
            low = TABLE_TOP - float(phone.points()[:, 2].min())
            deepest = max(deepest, stand.depth(phone.points()), phone.depth(stand.points()), low)
    return deepest


def test_a_phone_is_carried_around_the_stand_that_it_lies_beside() -> None:
    ws, offset = holding_a_phone()
    assert not route(ws, 1, BEFORE).free
    assert touched(ws, offset, LIFTED, BEFORE) > 0.0
    stop = stop_beside(Narrow(ws, 1, "stand", offset), BEFORE)
    assert stop is not None
    assert touched(ws, offset, LIFTED, stop, BEFORE) == 0.0


def test_where_every_way_ends_in_the_thing_there_is_no_stop() -> None:
    ws, offset = holding_a_phone()
    x, y, z = end_effector(ws.chains[1], BEFORE).position
    inside = ws.solve(1, Pose((x, y + 0.05, z - 0.05), (ws.snapshot.end_effector[1].rotation)))
    assert inside is not None and touched(ws, offset, inside, inside) > 0.0
    assert stop_beside(Narrow(ws, 1, "stand", offset), inside) is None


@pytest.mark.parametrize("asset", ["phone_stand", "mug", "bottle"])
def test_boxes_of_parts_hold_the_whole_object_and_no_more(asset: str) -> None:
    model = object_model(asset, {"look": 0})
    corners = part_boxes(model, Pose()).points()
    span = corners.max(axis=0) - corners.min(axis=0)
    assert np.all(span <= np.array(model.size) + 2e-3)
    assert span[2] > 0.9 * model.size[2]
    grown = part_boxes(model, Pose(), 0.01)
    assert np.allclose(grown.half, part_boxes(model, Pose()).half + 0.01)
