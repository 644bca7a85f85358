"""The object library in the simulator: things stand still, and what is grasped comes along."""

import math
from typing import Any

import numpy as np
import pytest

from robospa.geometry import Pose, Vec3, axis_rotation, look_rotation, rotate, yaw_rotation
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


class Bench:
    """The ground and what is put there, without a robot; `fixed` things stay at the origin."""

    def __init__(self, *fixed: ObjectModel) -> None:
        import sapien
        from sapien import physx

        from robospa.harness.sim.bodies import ground_body

        self.scene: Any = sapien.Scene([physx.PhysxCpuSystem()])
        self.scene.set_timestep(1 / 250)
        self.scene.add_entity(ground_body("ground"))
        for model in fixed:
            self.put(model, Pose(), fixed=True)

    def put(self, model: ObjectModel, pose: Pose | None = None, fixed: bool = False) -> Any:
        """The body there; without a pose, standing on the ground."""
        from robospa.harness.sim.bodies import dynamic_body

        pose = pose or Pose((0.0, 0.0, -model.bottom))
        entity, _ = dynamic_body(model, model.asset, pose, fixed)
        self.scene.add_entity(entity)
        return entity

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds * 250)):
            self.scene.step()


def turned(entity: Any) -> float:
    """Angle [rad] by which the entity has turned from upright, yaw included."""
    return 2 * math.acos(min(1.0, abs(float(entity.pose.q[0]))))


@pytest.mark.parametrize(("asset", "look"), EVERY)
def test_objects_stay_where_they_stand(asset: str, look: int) -> None:
    """Half a second after a fall of 1 mm: not 2 mm away, not 2 degrees turned."""
    model = object_model(asset, {"look": look})
    bench = Bench()
    entity = bench.put(model, Pose((0.0, 0.0, 0.001 - model.bottom)))
    bench.wait(0.5)
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
    bench = Bench()
    entity = bench.put(model)
    hands = []
    for grasp in grasps:
        x, y, z = grasp.point
        centre = (x, y, max(z - model.bottom, TIP * -grasp.approach[2] + 0.003))
        opening = min(0.044, grasp.width / 2 + 0.009)
        hands.append((opening, floating_gripper(bench.scene, grasp, centre, opening).active_joints))
    for step in range(450):
        close, rise = min(1.0, step / 150), max(0.0, (step - 200) / 250)
        for opening, (lift, *fingers) in hands:
            for finger in fingers:
                finger.set_drive_target(opening + (-0.01 - opening) * close)
            lift.set_drive_target(0.12 * rise)
        bench.scene.step()
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
    bench = Bench(rack)
    entity = bench.put(mug, put_by(handle, (x + off, y, z), yaw))
    bench.wait(3.0)
    end = pose_of(entity).apply(handle)
    assert abs(end[0] - x) < 0.02 and abs(end[1] - y) < 0.02
    assert end[2] > 0.12
    # by its handle, leaning on the post
    assert rotate(pose_of(entity).rotation, (1, 0, 0))[2] > 0.5


@pytest.mark.parametrize("look", range(variant_count("phone")))
def test_a_phone_on_its_stand_stays(look: int) -> None:
    stand, phone = object_model("phone_stand"), object_model("phone", {"look": look})
    frame = stand.frames["support"]
    bench = Bench(stand)
    x, y, z = rotate(frame.rotation, (0.0, 0.0, 0.004))
    a, b, c = frame.position
    entity = bench.put(phone, Pose((a + x, b + y, c + z), frame.rotation))
    bench.wait(2.0)
    assert np.abs(np.subtract(pose_of(entity).position, frame.position)).max() < 0.005
    slope = rotate(pose_of(entity).rotation, (0, 1, 0))[2]
    assert slope == pytest.approx(rotate(frame.rotation, (0, 1, 0))[2], abs=0.05)


def test_bowls_nest_at_the_frame() -> None:
    plate, bowl = object_model("plate"), object_model("bowl")
    bench = Bench(plate)
    nest, floor = bowl.frames["nest"].position[2], plate.frames["support"].position[2]
    stack = [bench.put(bowl, Pose((0.0, 0.0, floor + 0.001 + nest * i))) for i in range(5)]
    bench.wait(2.0)
    heights = [pose_of(entity).position[2] for entity in stack]
    assert heights == pytest.approx([floor + nest * i for i in range(5)], abs=0.002)


def test_a_bin_keeps_its_garbage_until_it_is_turned_over() -> None:
    trash_bin, ball = object_model("table_trash_bin"), object_model("garbage")
    bench = Bench(trash_bin)
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
    bench = Bench(tray)
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
