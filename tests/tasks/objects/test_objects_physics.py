"""The object library in the simulator: things stand still, and what is grasped comes along."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robospa.geometry import Pose, Vec3, look_rotation
from robospa.tasks.objects import assets, object_model, variant_count
from robospa.tasks.shapes import Box, Grasp, ObjectModel, Shape

pytestmark = pytest.mark.sim

EVERY = [
    (asset, look)
    for asset in assets()
    for look in range(variant_count(asset))
    if object_model(asset).hinge is None  # what opens is always fixed
    and any(shape.collision for shape in object_model(asset).shapes)
]
SHAPES_DIFFER = {"bread": 7, "glue": 2, "seal": 4}
"""Assets whose looks differ in more than colour, and how many looks show all forms."""
TWO_HANDS = {"kitchen_pot"}
"""Assets that it takes both arms to lift level: their grasps are used together."""
PICKED = [
    (asset, look)
    for asset in assets()
    if object_model(asset).grasps and asset not in TWO_HANDS
    for look in range(SHAPES_DIFFER.get(asset, 1))
]
TIP, FINGER = 0.012, (0.0475, 0.004, 0.010)
"""How far fingertips reach beyond the grasp centre [m]; half sizes of a finger [m]."""


def on_the_ground(model: ObjectModel, above: float = 0.0) -> tuple[Any, Any]:
    import sapien
    from sapien import physx

    from robospa.harness.sim.bodies import dynamic_body, ground_body

    scene = sapien.Scene([physx.PhysxCpuSystem()])
    scene.set_timestep(1 / 250)
    scene.add_entity(ground_body("ground"))
    entity, _ = dynamic_body(model, "thing", Pose((0.0, 0.0, above - model.bottom)), False)
    scene.add_entity(entity)
    return scene, entity


def turned(entity: Any) -> float:
    """Angle [rad] by which the entity has turned from upright, yaw included."""
    return 2 * math.acos(min(1.0, abs(float(entity.pose.q[0]))))


@pytest.mark.parametrize(("asset", "look"), EVERY)
def test_objects_stay_where_they_stand(asset: str, look: int) -> None:
    """Half a second after a fall of 1 mm: not 2 mm away, not 2 degrees turned."""
    model = object_model(asset, {"look": look})
    scene, entity = on_the_ground(model, 0.001)
    for _ in range(125):
        scene.step()
    x, y, z = (float(c) for c in entity.pose.p)
    assert math.hypot(x, y) < 0.002
    assert z == pytest.approx(-model.bottom, abs=0.001)
    assert turned(entity) < math.radians(2)


def floating_gripper(scene: Any, grasp: Grasp, centre: Vec3, opening: float) -> Any:
    """Two fingers on a lift, driven as the robots' are; joints: lift, finger, finger."""
    import sapien
    from sapien.wrapper.articulation_builder import ArticulationBuilder

    from robospa.harness.sim.bodies import attach_collisions, material

    approach, closing = np.array(grasp.approach), np.array(grasp.closing)
    builder = ArticulationBuilder()
    builder.set_scene(scene)
    builder.set_initial_pose(sapien.Pose())
    links = [builder.create_link_builder(None)]
    axes = [np.array([0.0, 0.0, 1.0]), closing, -closing]
    for axis, at in zip(axes, (np.zeros(3), np.array(centre), np.array(centre)), strict=True):
        link = builder.create_link_builder(links[min(len(links) - 1, 1)])
        frame = look_rotation(axis, [1.0, 0.0, 0.0] if abs(axis[2]) > 0.9 else approach)
        limits = [[-1.0, 1.0]]
        link.set_joint_properties("prismatic", limits, sapien.Pose(at, frame), sapien.Pose(q=frame))
        links.append(link)
    for number, link in enumerate(links):
        link.set_name(f"link{number}")
        link.set_joint_name(f"joint{number}")
        link.set_mass_and_inertia(1.0, sapien.Pose(), [0.01] * 3)
    entities = builder.build_entities(fix_root_link=True)
    for entity, sign in zip(entities[2:], (1.0, -1.0), strict=True):
        x, y, z = -0.0355 * approach + sign * FINGER[1] * closing
        pose = Pose((float(x), float(y), float(z)), look_rotation(approach, closing))
        shape = Shape(Box(FINGER), pose)
        attach_collisions(entity.components[0], [shape], material(), groups=[1, 1, 1, 1])
    for entity in entities:
        entity.components[0].mass = 1.0
        entity.components[0].disable_gravity = True
    gripper = entities[0].components[0].articulation
    gripper.active_joints[0].set_drive_properties(1e5, 2e3)
    for joint in gripper.active_joints[1:]:
        joint.set_drive_properties(1000.0, 200.0)
    for entity in entities:
        scene.add_entity(entity)
    gripper.set_qpos([0.0, opening, opening])
    for joint, target in zip(gripper.active_joints, (0.0, opening, opening), strict=True):
        joint.set_drive_target(target)
    return gripper


def lifted(model: ObjectModel, *grasps: Grasp) -> tuple[float, float]:
    """(height gained [m], angle turned [rad]) after closing on `grasps` and rising by 0.12 m."""
    scene, entity = on_the_ground(model)
    hands = []
    for grasp in grasps:
        x, y, z = grasp.point
        centre = (x, y, max(z - model.bottom, TIP * -grasp.approach[2] + 0.003))
        opening = min(0.044, grasp.width / 2 + 0.009)
        hands.append((opening, floating_gripper(scene, grasp, centre, opening).active_joints))
    for step in range(450):
        close, rise = min(1.0, step / 150), max(0.0, (step - 200) / 250)
        for opening, (lift, *fingers) in hands:
            for finger in fingers:
                finger.set_drive_target(opening + (-0.01 - opening) * close)
            lift.set_drive_target(0.12 * rise)
        scene.step()
    return float(entity.pose.p[2]) + model.bottom, turned(entity)


@pytest.mark.parametrize(("asset", "look"), PICKED)
def test_every_grasp_lifts_the_object(asset: str, look: int) -> None:
    model = object_model(asset, {"look": look})
    for grasp in model.grasps:
        height, angle = lifted(model, grasp)
        assert height > 0.105, f"{grasp} slips"
        assert angle < math.radians(12), f"{grasp} tips the object"


@pytest.mark.parametrize("asset", sorted(TWO_HANDS))
def test_two_hands_lift_it_level(asset: str) -> None:
    model = object_model(asset)
    height, angle = lifted(model, *model.grasps)
    assert height > 0.105
    assert angle < math.radians(3)
