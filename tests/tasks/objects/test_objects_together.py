"""Things that belong together, in the simulator: what hangs, leans, nests, or is poured out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robospa.geometry import Pose, Vec3, axis_rotation, rotate, yaw_rotation
from robospa.tasks.objects import object_model, variant_count
from robospa.tasks.shapes import ObjectModel

pytestmark = pytest.mark.sim


class Bench:
    """The ground and what is put there, without a robot."""

    def __init__(self) -> None:
        import sapien
        from sapien import physx

        from robospa.harness.sim.bodies import ground_body

        self.scene: Any = sapien.Scene([physx.PhysxCpuSystem()])
        self.scene.set_timestep(1 / 250)
        self.scene.add_entity(ground_body("ground"))

    def put(self, model: ObjectModel, pose: Pose, fixed: bool = False) -> Any:
        from robospa.harness.sim.bodies import dynamic_body

        entity, _ = dynamic_body(model, model.asset, pose, fixed)
        self.scene.add_entity(entity)
        return entity

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds * 250)):
            self.scene.step()


def pose_of(entity: Any) -> Pose:
    p, q = entity.pose.p.tolist(), entity.pose.q.tolist()
    return Pose((p[0], p[1], p[2]), (q[0], q[1], q[2], q[3]))


def put_by(frame: Vec3, at: Vec3, yaw: float) -> Pose:
    """The pose of a body turned by `yaw` whose point `frame` is at `at`."""
    x, y, z = rotate(yaw_rotation(yaw), frame)
    return Pose((at[0] - x, at[1] - y, at[2] - z), yaw_rotation(yaw))


@pytest.mark.parametrize("look", range(variant_count("mug")))
@pytest.mark.parametrize(("yaw", "off"), [(0.0, -0.003), (math.pi, 0.003)])
def test_a_mug_let_go_on_the_peg_hangs_there(look: int, yaw: float, off: float) -> None:
    rack, mug = object_model("mug_rack"), object_model("mug", {"look": look})
    x, y, z = rack.frames["hang"].position
    handle = mug.frames["handle"].position
    bench = Bench()
    bench.put(rack, Pose(), fixed=True)
    entity = bench.put(mug, put_by(handle, (x + off, y, z), yaw))
    bench.wait(3.0)
    end = pose_of(entity).apply(handle)
    assert abs(end[0] - x) < 0.02 and abs(end[1] - y) < 0.02
    assert end[2] > 0.12
    assert (
        rotate(pose_of(entity).rotation, (1, 0, 0))[2] > 0.5
    )  # by its handle, leaning on the post


@pytest.mark.parametrize("look", range(variant_count("phone")))
def test_a_phone_on_its_stand_stays(look: int) -> None:
    stand, phone = object_model("phone_stand"), object_model("phone", {"look": look})
    frame = stand.frames["support"]
    bench = Bench()
    bench.put(stand, Pose(), fixed=True)
    x, y, z = rotate(frame.rotation, (0.0, 0.0, 0.004))
    a, b, c = frame.position
    entity = bench.put(phone, Pose((a + x, b + y, c + z), frame.rotation))
    bench.wait(2.0)
    assert np.abs(np.subtract(pose_of(entity).position, frame.position)).max() < 0.005
    slope = rotate(pose_of(entity).rotation, (0, 1, 0))[2]
    assert slope == pytest.approx(rotate(frame.rotation, (0, 1, 0))[2], abs=0.05)


def test_bowls_nest_at_the_frame() -> None:
    plate, bowl = object_model("plate"), object_model("bowl")
    bench = Bench()
    bench.put(plate, Pose(), fixed=True)
    nest, floor = bowl.frames["nest"].position[2], plate.frames["support"].position[2]
    stack = [bench.put(bowl, Pose((0.0, 0.0, floor + 0.001 + nest * i))) for i in range(5)]
    bench.wait(2.0)
    heights = [pose_of(entity).position[2] for entity in stack]
    assert heights == pytest.approx([floor + nest * i for i in range(5)], abs=0.002)


def test_a_bin_keeps_its_garbage_until_it_is_turned_over() -> None:
    trash_bin, ball = object_model("table_trash_bin"), object_model("garbage")
    bench = Bench()
    bench.put(trash_bin, Pose(), fixed=True)
    high = Pose((0.3, 0.0, 0.3), axis_rotation((1, 0, 0), 2.0))
    bench.put(trash_bin, high, fixed=True)
    kept = bench.put(ball, Pose((0.008, -0.006, 0.04)))
    poured = bench.put(ball, Pose(high.apply((0.0, 0.0, 0.02))))
    bench.wait(1.5)
    assert math.hypot(*pose_of(kept).position[:2]) < 0.025
    assert pose_of(poured).position[2] < 0.02  # it rolls, and is not quite round


@pytest.mark.parametrize("name", ["left", "right"])
@pytest.mark.parametrize("asset", ["hamburger", "french_fries"])
def test_the_tray_has_two_places(asset: str, name: str) -> None:
    tray, food = object_model("tray"), object_model(asset)
    x, y, z = tray.frames[name].position
    bench = Bench()
    bench.put(tray, Pose(), fixed=True)
    entity = bench.put(food, Pose((x, y, z + 0.002)))
    bench.wait(0.5)
    assert pose_of(entity).position == pytest.approx((x, y, z), abs=0.001)


def test_the_hammer_strikes_with_the_face_it_stands_on() -> None:
    head = object_model("hammer").frames["head"].position
    block = object_model("block", {"half": [0.025, 0.025, 0.025]})
    bench = Bench()
    bench.put(block, Pose((0.0, 0.0, 0.025)), fixed=True)
    hammer = bench.put(object_model("hammer"), Pose((-head[0], -head[1], 0.0505)))
    bench.wait(0.2)
    contacts = bench.scene.physx_system.get_contacts()
    touching = {body.name for contact in contacts for body in contact.bodies}
    assert {"block", "hammer"} <= touching
    assert np.hypot(*pose_of(hammer).apply(head)[:2]) < 0.02
