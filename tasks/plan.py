"""Plans are data: a task's expert is a tuple of skill calls computed from its scene.

`robospa.harness.skills` turns each call into joint targets. Objects are named as in the scene;
`arm` None lets the skill choose. Lengths are metres, positions are in the world frame.
"""

from dataclasses import dataclass

from robospa.geometry import Vec3


@dataclass(frozen=True)
class Pick:
    """Grasp `object` and raise it by `lift`."""

    object: str
    lift: float = 0.12
    arm: str | None = None


@dataclass(frozen=True)
class Place:
    """Put the held `object` down with its origin at `position` (upright), release and retreat.

    `on` names an object to place onto instead: then `position` is an offset in its "support" frame
    as it lies at that moment. `drop` lets go that far above. `yaw` [rad] turns the object about z
    in the world; None leaves it as it comes.
    """

    object: str
    position: Vec3 = (0.0, 0.0, 0.0)
    on: str | None = None
    drop: float = 0.003
    yaw: float | None = None
    retreat: float = 0.08
    arm: str | None = None


@dataclass(frozen=True)
class Press:
    """Touch the "press" frame of `object` with the closed gripper from above, then come back up."""

    object: str
    frame: str = "press"
    hover: float = 0.06
    arm: str | None = None


@dataclass(frozen=True)
class Stamp:
    """Grasp `object`, bring it down onto `on` (an object's "support" frame) `times` times, let go.

    Between two stamps it is raised by `lift`; after the last one it stays where it is.
    """

    object: str
    on: str
    times: int = 1
    lift: float = 0.045
    arm: str | None = None


@dataclass(frozen=True)
class Dock:
    """Grasp `object` and set it into frame `frame` of `on`, turned as that frame is, and let go.

    It comes in along the frame's z axis, from `above` [m].
    """

    object: str
    on: str
    frame: str = "support"
    above: float = 0.06
    arm: str | None = None


@dataclass(frozen=True)
class Hang:
    """Grasp `object`, bring its `handle` frame onto the peg at `frame` of `on`, and let go.

    The peg runs along that frame's y axis, from its tip to its root.
    """

    object: str
    on: str
    frame: str = "hang"
    handle: str = "handle"
    arm: str | None = None


@dataclass(frozen=True)
class Pour:
    """Grasp the open `object` and tip it over the container `into`; it stays in the gripper."""

    object: str
    into: str
    arm: str | None = None


@dataclass(frozen=True)
class Drop:
    """Carry the held `object` over the container `into` and open the gripper above its mouth."""

    object: str
    into: str
    height: float = 0.12
    arm: str | None = None


@dataclass(frozen=True)
class Open:
    """Pull the hinged part of `object` by its "handle" to the share `to` of its limit; let go."""

    object: str
    to: float = 0.7
    arm: str | None = None


@dataclass(frozen=True)
class RaiseLower:
    """Lift `object` by `rise` and set it down where it was, `times` times, with every arm of
    `arms` at once.

    One arm takes any grasp of the model; two take its frames "left" and "right".
    """

    object: str
    rise: float = 0.08
    times: int = 1
    arms: tuple[str, ...] = ("left",)


@dataclass(frozen=True)
class Hit:
    """Grasp `tool` and bring its "head" frame down on the "press" frame of each of `targets`."""

    tool: str
    targets: tuple[str, ...]
    arm: str | None = None


@dataclass(frozen=True)
class Wait:
    """Hold still for `seconds` of simulated time."""

    seconds: float


@dataclass(frozen=True)
class Home:
    """Bring `arm` (None: both) back to its home joints."""

    arm: str | None = None


Skill = (
    Pick | Place | Press | Stamp | Dock | Hang | Hit | Pour | Drop | Open | RaiseLower | Wait | Home
)
