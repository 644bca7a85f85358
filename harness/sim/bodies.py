"""From `robospa.tasks.shapes` to SAPIEN: collision bodies, articulated arms, shapes to draw.

Collision and drawing never meet: physics lives in a scene without a render system, and what is
drawn lives in another one (`robospa.harness.sim.renderer`), so that a trial is the same to the bit
whether anybody looks at it or not. Meshes collide as their convex hull.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx

from robospa.geometry import Pose, Quat, axis_rotation, look_rotation, multiply
from robospa.harness.robots.embodiment import Arm, Joint
from robospa.tasks.shapes import Box, Cylinder, Geometry, ObjectModel, Shape, Sphere

Array = NDArray[np.float64]

FRICTION = 0.5
"""Static and dynamic friction of everything that does not say otherwise (official)."""
DENSITY = 1000.0
ROBOT_GROUPS = [1, 1, 1, 1]
"""Links share an ignore group: the robot does not collide with itself."""
HINGED_GROUPS = [1, 1, 2, 2]
"""A door or lid does not collide with the body that it hangs on."""

LINK_MARGIN = 0.03
"""How far a link's mass reaches beyond its joints [m]."""

Z_TO_X: Quat = axis_rotation((0, 1, 0), -math.pi / 2)
"""Turns SAPIEN's cylinders, which lie along x, to stand along z."""


def to_sapien(pose: Pose) -> sapien.Pose:
    """The same pose as a `sapien.Pose`."""
    return sapien.Pose(pose.position, pose.rotation)


def _collision_shape(
    geometry: Geometry, material: physx.PhysxMaterial
) -> physx.PhysxCollisionShape:
    if isinstance(geometry, Box):
        return physx.PhysxCollisionShapeBox(geometry.half, material)
    if isinstance(geometry, Sphere):
        return physx.PhysxCollisionShapeSphere(geometry.radius, material)
    if isinstance(geometry, Cylinder):
        return physx.PhysxCollisionShapeCylinder(geometry.radius, geometry.half_length, material)
    vertices = np.asarray(geometry.vertices, dtype=np.float32)
    return physx.PhysxCollisionShapeConvexMesh(
        vertices=vertices, scale=[1.0, 1.0, 1.0], material=material
    )


def local_pose(shape: Shape) -> sapien.Pose:
    """A shape's pose in SAPIEN's convention for its geometry."""
    pose = shape.pose
    if isinstance(shape.geometry, Cylinder):
        pose = Pose(pose.position, multiply(pose.rotation, Z_TO_X))
    return to_sapien(pose)


def attach_collisions(
    component: physx.PhysxRigidBaseComponent,
    shapes: Iterable[Shape],
    material: physx.PhysxMaterial,
    density: float = DENSITY,
    groups: Sequence[int] | None = None,
) -> None:
    """Add every colliding shape to a PhysX component that is in no scene yet."""
    for shape in shapes:
        if shape.collision:
            collision = _collision_shape(shape.geometry, material)
            collision.local_pose = local_pose(shape)
            collision.density = density
            if groups is not None:
                collision.set_collision_groups(list(groups))
            component.attach(collision)


@lru_cache(maxsize=1024)
def material(friction: float = FRICTION) -> physx.PhysxMaterial:
    """The material of that friction, without bounce. Materials carry no state."""
    return physx.PhysxMaterial(friction, friction, 0.0)


@lru_cache(maxsize=1024)
def _density(shapes: tuple[Shape, ...], mass: float) -> float:
    """Density [kg/m^3] at which the colliding shapes weigh `mass` [kg] together."""
    trial = physx.PhysxRigidDynamicComponent()
    attach_collisions(trial, shapes, material())
    return DENSITY * mass / float(trial.mass)


def dynamic_body(
    model: ObjectModel, name: str, pose: Pose, fixed: bool, density: float | None = None
) -> tuple[sapien.Entity, physx.PhysxRigidBaseComponent]:
    """Entity and PhysX component of an object; neither is in a scene yet.

    Its mass is `model.mass` with the inertia of a body of even density, or follows from `density`
    [kg/m^3]; a `fixed` one is static.
    A fixed one may be there to be seen only. ValueError if one that moves cannot collide.
    """
    if not fixed and not any(shape.collision for shape in model.shapes):
        raise ValueError(
            f"object {name!r} ({model.asset}) has no colliding shape; give it one, or make it fixed"
        )
    component = physx.PhysxRigidStaticComponent() if fixed else physx.PhysxRigidDynamicComponent()
    if density is None:
        density = DENSITY if fixed else _density(model.shapes, model.mass)
    attach_collisions(component, model.shapes, material(model.friction), density)
    return entity_of(component, name, pose), component


def hinged_body(
    model: ObjectModel, name: str, pose: Pose, fixed: bool
) -> tuple[sapien.Entity, sapien.Entity, physx.PhysxArticulation]:
    """Entities of a body and of its hinged part, and their articulation; in no scene yet.

    Both entities carry the object's name, so that a touch of the door is a touch of the object.
    ValueError if the body is not `fixed`: nothing that opens is carried about.
    """
    from sapien.wrapper.articulation_builder import ArticulationBuilder

    hinge = model.hinge
    if hinge is None or not fixed:
        raise ValueError(f"object {name!r} ({model.asset}) must be fixed and have a hinged part")
    builder = ArticulationBuilder()
    builder.set_initial_pose(to_sapien(pose))
    body = builder.create_link_builder(None)
    part = builder.create_link_builder(body)
    side = np.eye(3)[int(np.argmin(np.abs(hinge.axis)))]
    at = to_sapien(Pose(hinge.point, look_rotation(hinge.axis, side)))
    part.set_joint_properties("revolute", [[0.0, hinge.upper]], at, at)
    part.set_joint_name(f"{name} hinge")
    entities = builder.build_entities(fix_root_link=True)
    for entity, shapes, mass in zip(
        entities, (model.shapes, hinge.shapes), (model.mass, hinge.mass), strict=True
    ):
        component = entity.components[0]
        density = _density(shapes, mass)
        attach_collisions(component, shapes, material(model.friction), density, HINGED_GROUPS)
        component.name = entity.name = name
    articulation = entities[0].components[0].articulation
    for joint in articulation.active_joints:
        joint.set_drive_properties(0.0, hinge.damping)
        joint.friction = hinge.friction
    return entities[0], entities[1], articulation


def static_body(shapes: Iterable[Shape], name: str, pose: Pose) -> sapien.Entity:
    """A static entity made of `shapes`."""
    component = physx.PhysxRigidStaticComponent()
    attach_collisions(component, shapes, material())
    return entity_of(component, name, pose)


def ground_body(name: str) -> sapien.Entity:
    """The endless floor at z = 0."""
    component = physx.PhysxRigidStaticComponent()
    plane = physx.PhysxCollisionShapePlane(material())
    plane.local_pose = sapien.Pose(q=look_rotation((0, 0, 1), (0, 1, 0)))
    component.attach(plane)
    return entity_of(component, name, Pose())


def entity_of(component: sapien.Component, name: str, pose: Pose) -> sapien.Entity:
    """An entity holding `component`; both carry the name."""
    component.name = name
    entity = sapien.Entity()
    entity.add_component(component)
    entity.name = name
    entity.pose = to_sapien(pose)
    return entity


def _link_inertia(arm: Arm, link: str) -> tuple[sapien.Pose, Array]:
    """Centre of mass (as pose) and principal inertia (3,) of a link's mass spread over it.

    A block from the link's own joint to those that it carries: it follows from the joints alone, so
    that what a robot looks like does not change how it moves.
    """
    carried = [joint.origin.position for joint in arm.all_joints if joint.parent == link]
    points = np.array([(0.0, 0.0, 0.0), *carried])
    low, high = points.min(axis=0) - LINK_MARGIN, points.max(axis=0) + LINK_MARGIN
    x, y, z = high - low
    inertia = arm.link_mass / 12.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return sapien.Pose((low + high) / 2), inertia


@lru_cache(maxsize=256)
def _joint_frames(joint: Joint) -> tuple[sapien.Pose, sapien.Pose]:
    """Poses of the joint in parent and child; SAPIEN's joints move about or along their x axis."""
    axis = np.asarray(joint.axis, dtype=float)
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    turn = Pose(rotation=look_rotation(axis, side))
    return to_sapien(joint.origin * turn), to_sapien(turn)


def build_arm(scene: sapien.Scene, arm: Arm, prefix: str) -> physx.PhysxArticulation:
    """A fixed-base articulation of `arm` in `scene`, its links as in `arm.links`.

    The fingers, whose contacts goals ask for, are named `prefix`_gripper, all other links
    `prefix`_arm. Robot links feel no gravity; all weigh `arm.link_mass`.
    """
    from sapien.wrapper.articulation_builder import ArticulationBuilder, LinkBuilder

    builder = ArticulationBuilder()
    builder.set_scene(scene)
    builder.set_initial_pose(to_sapien(arm.base))
    fingers = {finger.child for finger in arm.fingers}
    made: dict[str, LinkBuilder] = {}
    incoming = {joint.child: joint for joint in arm.all_joints}
    for link in arm.links:
        joint = incoming.get(link)
        record = builder.create_link_builder(made[joint.parent] if joint else None)
        record.set_name(f"{prefix}_gripper" if link in fingers else f"{prefix}_arm")
        record.set_joint_name(joint.name if joint else "")
        if joint:
            in_parent, in_child = _joint_frames(joint)
            limits = [[joint.lower, joint.upper]]
            record.set_joint_properties(joint.kind, limits, in_parent, in_child)
        made[link] = record
    entities = builder.build_entities(fix_root_link=True)
    for entity, link in zip(entities, arm.links, strict=True):
        component = entity.components[0]
        attach_collisions(component, arm.shapes[link], material(), groups=ROBOT_GROUPS)
        component.mass = arm.link_mass
        component.cmass_local_pose, component.inertia = _link_inertia(arm, link)
        component.disable_gravity = True
    articulation = entities[0].components[0].articulation
    for joint in articulation.active_joints:
        joint.set_drive_properties(arm.stiffness, arm.damping)
        joint.friction = 0.0
    for entity in entities:
        scene.add_entity(entity)
    return articulation
