"""UR5 with a WSG-50 gripper: two arms of six joints, whose fingers never close fully.

Joint origins, axes, limits, bases (the left one stands 0.1 m lower), home, fingers, wrist camera
and end-effector frame are those that the official simulator loads; the distance is what its
maintainers name for this robot. The description counts a finger's travel from -0.0027 m (closed) to
-0.055 m and mirrors it for the other finger; here both count outwards.
"""

from robospa.geometry import Pose, Vec3, look_rotation
from robospa.harness.robots import links
from robospa.harness.robots.embodiment import Arm
from robospa.harness.robots.links import DARK, STEEL
from robospa.tasks.shapes import Box, Color, Shape
from robospa.workcell import Gripper

GREY: Color = (0.48, 0.50, 0.52)
BLUE: Color = (0.13, 0.40, 0.68)


def stand(height: float) -> tuple[Shape, ...]:
    """Base link of an arm that stands `height` [m] above the floor, on its column."""
    return (
        links.rod((0.0, 0.0, 0.0), (0.0, 0.0, 0.03), 0.073, GREY),
        links.box((0.0, 0.0, -height / 2), (0.09, 0.09, height / 2), STEEL),
    )


def _cap(start: Vec3, end: Vec3, radius: float) -> tuple[Shape, ...]:
    x, y, z = (a + 0.25 * (b - a) for a, b in zip(start, end, strict=True))
    return (
        links.rod(start, (x, y, z), 0.97 * radius, DARK),
        links.shell((x, y, z), end, radius, BLUE, 0.3),
    )


LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        links.shell((0.0, 0.0, -0.06), (0.0, 0.0, 0.06), 0.059, GREY, 0.5),
        links.rod((0.0, 0.0, -0.062), (0.0, 0.0, -0.056), 0.0605, DARK),
        links.shell((0.0, -0.05, 0.0), (0.0, 0.062, 0.0), 0.057, GREY),
        *_cap((0.0, -0.05, 0.0), (0.0, -0.07, 0.0), 0.056),
    ),
    (
        links.shell((0.0, -0.06, 0.0), (0.0, 0.062, 0.0), 0.059, GREY),
        *_cap((0.0, 0.060, 0.0), (0.0, 0.082, 0.0), 0.057),
        links.rod((0.0, 0.0, 0.0), (0.0, 0.0, 0.425), 0.045, GREY),
        links.rod((0.0, 0.0, 0.060), (0.0, 0.0, 0.072), 0.0475, STEEL),
        links.rod((0.0, 0.0, 0.345), (0.0, 0.0, 0.357), 0.0475, STEEL),
        links.shell((0.0, -0.06, 0.425), (0.0, 0.060, 0.425), 0.054, GREY),
        *_cap((0.0, 0.058, 0.425), (0.0, 0.078, 0.425), 0.052),
    ),
    (
        links.shell((0.0, -0.055, 0.0), (0.0, 0.053, 0.0), 0.053, GREY),
        links.rod((0.0, 0.0, 0.0), (0.0, 0.0, 0.392), 0.037, GREY),
        links.rod((0.0, 0.0, 0.055), (0.0, 0.0, 0.066), 0.0395, STEEL),
        links.rod((0.0, 0.0, 0.325), (0.0, 0.0, 0.336), 0.0395, STEEL),
        links.shell((0.0, -0.05, 0.392), (0.0, 0.047, 0.392), 0.040, GREY),
        *_cap((0.0, -0.048, 0.392), (0.0, -0.066, 0.392), 0.039),
        links.block((0.0, 0.0, 0.2), (0.038, 0.038, 0.23)),
    ),
    (
        links.shell((0.0, 0.0475, 0.0), (0.0, 0.13, 0.0), 0.039, GREY),
        *_cap((0.0, 0.128, 0.0), (0.0, 0.144, 0.0), 0.038),
        links.rod((0.0, 0.0465, 0.0), (0.0, 0.051, 0.0), 0.040, DARK),
        links.shell((0.0, 0.09, -0.057), (0.0, 0.09, 0.0475), 0.038, GREY),
        links.block((0.0, 0.09, -0.005), (0.037, 0.042, 0.05)),
    ),
    (
        links.shell((0.0, 0.0, 0.049), (0.0, 0.0, 0.133), 0.039, GREY),
        links.rod((0.0, 0.0, 0.047), (0.0, 0.0, 0.052), 0.040, DARK),
        *_cap((0.0, 0.0, 0.131), (0.0, 0.0, 0.147), 0.038),
        links.shell((0.0, -0.057, 0.0913), (0.0, 0.0475, 0.0913), 0.038, GREY),
        *_cap((0.0, -0.055, 0.0913), (0.0, -0.070, 0.0913), 0.037),
        links.block((0.0, -0.005, 0.0913), (0.037, 0.05, 0.042)),
    ),
    (
        links.rod((0.0, 0.047, 0.0), (0.0, 0.082, 0.0), 0.0375, GREY),
        links.box((0.0, 0.1195, 0.0), (0.073, 0.037, 0.025), DARK),
        links.box((0.0, 0.154, 0.0), (0.072, 0.003, 0.012), STEEL),
        # housing of the wrist camera, behind its optical centre
        links.box((0.0, 0.092, 0.072), (0.045, 0.012, 0.0125), STEEL),
        links.box((0.0, 0.088, 0.045), (0.012, 0.005, 0.02), STEEL),
        links.block((0.0, 0.1195, 0.0), (0.073, 0.037, 0.025)),
    ),
)
"""Links 1 to 6; the last one carries the gripper."""


def _finger(side: float) -> tuple[Shape, ...]:
    """A finger in a frame whose x approaches; its inner face is at y = 0, it lies to `side` y."""
    pose = Pose((0.1075, side * 0.006, 0.0))
    return (
        Shape(Box((0.0325, 0.006, 0.010)), pose, visual=False),
        links.drawn(Shape(Box((0.0325, 0.006, 0.010)), pose, STEEL)),
        links.drawn(Shape(Box((0.006, 0.014, 0.012)), Pose((0.08, side * 0.012, 0.0)), DARK)),
    )


FINGER_SHAPES: tuple[tuple[Shape, ...], tuple[Shape, ...]] = (_finger(-1.0), _finger(1.0))


DISTANCE = 0.8
QUARTER = 1.5707963267948966
FULL = (-3.141592653589793, 3.141592653589793)
Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
LEVEL = (0.0, 0.0, 0.0)

CHAIN: tuple[links.Row, ...] = (
    ("shoulder_pan_joint", (0.0, 0.0, 0.089159), LEVEL, Z, (-3.142, 3.142)),
    ("shoulder_lift_joint", (0.0, 0.13585, 0.0), (0.0, QUARTER, 0.0), Y, (-3.142, 0.0)),
    ("elbow_joint", (0.0, -0.1197, 0.425), LEVEL, Y, (-3.142, 3.142)),
    ("wrist_1_joint", (0.0, 0.0, 0.39225), (0.0, QUARTER, 0.0), Y, (-1.75, 1.75)),
    ("wrist_2_joint", (0.0, 0.093, 0.0), LEVEL, Z, FULL),
    ("wrist_3_joint", (0.0, 0.0, 0.09465), LEVEL, Y, FULL),
)
FINGERS = (
    ("base_joint_gripper_left", (0.0, 0.0823, 0.0), -1.0),
    ("base_joint_gripper_right", (0.0, 0.0823, 0.0), 1.0),
)
TOOL = Pose((0.0, 0.0723, 0.0), look_rotation((0, 1, 0), (-1, 0, 0)))

GRIPPER = Gripper(
    grasp_centre=0.12,
    opening=0.11,
    gap=0.0054,
    fingertip=0.03,
    hold=0.012,
    finger_half_width=0.010,
    finger_thickness=0.012,
    radius=0.055,
    palm_back=(0.07, 0.1, 0.13),
    palm_half=(0.073, 0.026),
    hand_back=0.065,
    hand_half=(0.073, 0.026),
    wrist_back=0.2,
    wrist_half=0.07,
)

SEEDS = (
    (-1.57, -1.54, -1.54, -1.58, 1.57, 0.0),
    (0.0, -1.2, 1.8, -0.6, 1.57, 0.0),
    (-1.57, -1.2, -1.9, -1.5, 1.57, 0.0),
    (0.0, -1.9, -1.5, -1.2, -1.57, 0.0),
    (0.0, -1.0, 1.6, -0.6, -1.57, 0.0),
    (0.0, -1.2, 1.8, -2.0, -1.57, 0.0),
)


def _arm(name: str, x: float) -> Arm:
    height = 0.65 if x < 0 else 0.75
    return links.serial_arm(
        CHAIN,
        FINGERS,
        (0.0027, 0.055),
        (stand(height), *LINK_SHAPES, *FINGER_SHAPES),
        TOOL,
        name=name,
        base=Pose((x, -0.65, height)),
        travel=(-0.01, 0.06),
        gripper=GRIPPER,
        home=(-1.5447, -1.5447, -1.5447, -1.5794, 1.5794, 0.0),
        seeds=SEEDS,
        camera=Pose((0.0, 0.105, 0.075), look_rotation((0, 1, 0), (-1, 0, 0))),
    )


UR5_WSG = links.two_arms("ur5-wsg", DISTANCE, _arm)
