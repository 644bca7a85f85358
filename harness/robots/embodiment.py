"""A two-armed robot as data: joint chains, link shapes, grippers and camera mounts.

Adding a robot means writing one module like `aloha_agilex.py` and naming it among the entry points
(docs/adding-a-robot.md); nothing else changes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from robospa.action_space import ActionSpace
from robospa.geometry import Pose, Vec3
from robospa.tasks.shapes import Shape
from robospa.workcell import FixedCamera, Gripper


@dataclass(frozen=True)
class Joint:
    """`origin` places the joint's frame in its parent link; `axis` is in the joint's frame.

    Limits are radians for "revolute" and metres for "prismatic" joints.
    """

    name: str
    parent: str
    child: str
    origin: Pose
    axis: Vec3
    lower: float
    upper: float
    kind: str = "revolute"


@dataclass(frozen=True)
class Arm:
    """One arm with a parallel gripper.

    `base` is the world pose of the first link. `joints` are the arm's own joints in order,
    `fingers` the prismatic ones, both driven to the same travel. `travel` is what is commanded of
    them [m] for the gripper values 0 (closed) and 1 (open); at travel 0 the fingers touch, or would
    if their limits let them. `tool` is the end-effector frame in the last arm link: x is the
    approach direction, y the closing direction; `gripper` has the rest. `stiffness` and `damping`
    are the drives', every link weighs `link_mass` [kg], `wrist_fov` [rad] is the wrist camera's
    vertical field of view.
    `home` are joint angles [rad]; `seeds` are postures from which inverse kinematics starts, and
    `working` are lower and upper limits [rad] within which it looks, none: those of the joints.
    `shapes` maps every link to what it is made of, in its frame.
    """

    name: str
    base: Pose
    base_link: str
    joints: tuple[Joint, ...]
    fingers: tuple[Joint, ...]
    travel: tuple[float, float]
    gripper: Gripper
    tool: Pose
    home: tuple[float, ...]
    seeds: tuple[tuple[float, ...], ...]
    shapes: Mapping[str, tuple[Shape, ...]] = field(hash=False)
    camera: Pose
    """Wrist camera in the last arm link: x looks forward, z is up in the image."""
    working: tuple[tuple[float, float], ...] = ()
    geometry: str = "any"
    """"arx" if the closed form in `kinematics` gives this arm to a few mm, else "any"."""
    stiffness: float = 1000.0
    damping: float = 200.0
    link_mass: float = 1.0
    wrist_fov: float = 0.6457718

    @property
    def links(self) -> tuple[str, ...]:
        """All link names, base first, in creation order."""
        return (self.base_link, *(joint.child for joint in self.all_joints))

    @property
    def all_joints(self) -> tuple[Joint, ...]:
        """Joints and fingers, in creation order."""
        return (*self.joints, *self.fingers)

    def gripper_value(self, opening: float) -> float:
        """The gripper value, 0..1, at which the fingers are `opening` [m] apart."""
        closed, opened = self.travel
        return min(1.0, max(0.0, (opening / 2 - closed) / (opened - closed)))

    @property
    def last_link(self) -> str:
        """The link that carries the gripper and the wrist camera."""
        return self.joints[-1].child


@dataclass(frozen=True)
class Embodiment:
    """A robot: two arms and its fixed cameras, of which one is called "head".

    The bases stand `distance` [m] apart, at x = -distance / 2 and distance / 2: another distance
    makes another robot (`robospa.harness.robots`). One whose arms stand on one stand has none.
    """

    name: str
    arms: tuple[Arm, Arm]
    cameras: Mapping[str, FixedCamera] = field(hash=False)
    distance: float | None = None
    travel_height: float = 0.17
    """Skills move grasp centres sideways at least so high above the table [m]."""
    highest: float = 0.3
    """Skills need not bring grasp centres higher above the table than this [m]."""
    body: tuple[Shape, ...] = field(default=())
    """What stands still beside the arms (stand, columns), in the world frame: only drawn."""

    @property
    def grippers(self) -> tuple[Gripper, Gripper]:
        """The grippers of the left and the right arm."""
        return self.arms[0].gripper, self.arms[1].gripper

    def action_space(self, kind: str) -> ActionSpace:
        """The columns of this robot's actions of a `kind`; ValueError for one that does not exist.

        A state has those of a "joint" action.
        """
        left, right = self.arms
        return ActionSpace(kind, (len(left.joints), len(right.joints)))
