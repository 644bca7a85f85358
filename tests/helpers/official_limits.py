"""The numbers of the official rules, and how to get just this side and that side of each.

Where a rule has no number of ours in it, a subtask is done on one side of the official limit and
not on the other. Nothing is held here: objects are laid where they are asked to be.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hands import Hands
from snapshots_by_hand import AWAY

from robospa.geometry import Pose, Vec3, axis_rotation, multiply, vec3, yaw_rotation
from robospa.tasks.snapshot import Contact

Do = Callable[[Hands, float], object]


@dataclass(frozen=True)
class Limit:
    """`do(hands, value)` meets the rule on the near side of `value` and misses it beyond.

    With `least` the rule is met above the limit. The side that meets it has `done` subtasks.
    """

    task: str
    level: int
    what: str
    value: float
    do: Do
    least: bool = False
    done: int = 1


def lay_off(h: Hands, fact: str, at: Vec3, axis: int, value: float) -> None:
    """Lays an object so far off a place along an axis."""
    h.lay(fact, vec3([x + value * (k == axis) for k, x in enumerate(at)]))


def beside(fact: str, target: str, frame: str = "support", axis: int = 0) -> Do:
    """Lays an object on a frame of another one, but so far off along an axis."""

    def do(h: Hands, value: float) -> None:
        x, y, z = h.point(target, frame)
        lay_off(h, fact, (x, y, z - h.models[h.named(fact)].bottom), axis, value)

    return do


def place(fact: str, x: float | None, y: float | None) -> Do:
    """Lays an object at a place of which None is the value, at its first height."""

    def do(h: Hands, value: float) -> None:
        h.lay(fact, (value if x is None else x, value if y is None else y, h.at(fact)[2]))

    return do


def nudged(fact: str, axis: int, after: Callable[[Hands], object] = lambda h: None) -> Do:
    """Lays an object so far off its place along an axis."""

    def do(h: Hands, value: float) -> None:
        after(h)
        lay_off(h, fact, h.scene.object(h.named(fact)).pose.position, axis, value)

    return do


def tapped(fact: str, axis: int) -> Do:
    """Touches an object so far off its press point."""
    return lambda h, value: h.touch(fact, off=vec3(value * np.eye(3)[axis]))


def pot(h: Hands, z: float) -> None:
    """The pot upright with its origin at a height, both hands at its handles; then they go."""
    h.poses[h.named("thing")] = Pose((*h.at("thing")[:2], z))
    h.grasp = [h.point("thing", arm) for arm in ("left", "right")]
    h.tick(2)
    h.grasp = list(AWAY)


def in_line(h: Hands, fact: str, frame: str, goal: Vec3, axis: int, value: float) -> None:
    """Lays an object with its frame at the goal, so far off along an axis."""
    at = np.add(h.at(fact), goal) - h.point(fact, frame)
    lay_off(h, fact, vec3(at), axis, value)


def on_block(h: Hands, upper: str, lower: str, dz: float, dx: float = 0.0) -> None:
    """Lays the upper block so far over the lower one, and so far aside."""
    x, y, z = h.at(lower)
    h.lay(upper, (x + dx, y, z + dz))


def hung(h: Hands, axis: int, value: float) -> None:
    """Lays the mug with its handle at the peg, so far off along an axis (z: at that height)."""
    peg = h.point("rack", "hang")
    in_line(h, "mug", "handle", peg, axis, value - peg[2] if axis == 2 else value)


def docked(h: Hands, axis: int, value: float) -> None:
    """Lays the phone's end at the stand's, so far off along an axis."""
    in_line(h, "phone", "end", h.point("phone_stand", "end"), axis, value)


def struck(h: Hands, axis: int, value: float) -> None:
    """The hammer's head touches the first block, so far off the middle of its top."""
    top = h.point("order 0", "press")
    in_line(h, "hammer", "head", top, axis, value)
    h.tick(2, [Contact(h.named("order 0"), h.named("hammer"), top)])


def left_of(h: Hands, dx: float, dy: float = 0.0) -> None:
    """Lays the thing so far to the left of the other one."""
    x, y, _ = h.at("reference")
    h.lay("object", (x - dx, y + dy, h.at("object")[2]))


def restored(h: Hands, degrees: float = 0.0, dx: float = 0.0, dz: float = 0.0) -> None:
    """The near block as its partner lies, but tilted about x or moved by so much."""
    h.wait(2.2)
    x, y, z = h.at("near 0")
    tilt = axis_rotation((1.0, 0.0, 0.0), math.radians(degrees))
    turned = multiply(yaw_rotation(-math.pi / 2 * h.scene.facts["turns"][0]), tilt)
    h.poses[h.named("near 0")] = Pose((x + dx, y, z + dz), turned)
    h.tick(3)


def waited(do: Do) -> Do:
    """The same once the wall or the covers are there."""

    def later(h: Hands, value: float) -> None:
        h.wait(2.2)
        do(h, value)

    return later


def behind(axis: int) -> Do:
    """The due cover so far off its place behind its block."""

    def do(h: Hands, value: float) -> None:
        x, y, z = h.at("covers 0")
        lay_off(h, "covers 0", (x, y + 0.13, z), axis, value)

    return waited(do)


def held(h: Hands, rise: float, grip: float = 0.1, other: float = 0.0) -> None:
    """The target goes up by `rise`, after another object went up by `other`."""
    if other:
        h.take_other(other)
    h.take("target", rise, "left", grip)
    h.click_lifted()


LIMITS = (
    *(Limit(task, level, f"{fact}, axis {axis}", size[axis], tapped(fact, axis))
      for task, level, fact, size in (
          ("Press_Stapler_Repeat", 3, "stapler", (0.03, 0.03, 0.03)),
          ("Click_Bell_Repeat", 3, "bell", (0.025, 0.025, 0.03)),
          ("Click_Bell_Clockwise_Order", 1, "order 0", (0.025, 0.025, 0.03)),
          ("Click_Objects_Order", 1, "order 0", (0.03, 0.03, 0.03)),
          ("Click_Can_Place_Items", 1, "can", (0.03, 0.03, 0.04)),
          ("Place_Object_Scale_Click", 3, "cards", (0.03, 0.03, 0.03)),
          ("Place_Burger_Fries_Click_Bell", 3, "bell", (0.025, 0.025, 0.03)),
          ("Click_Bell_Open_Microwave_Place_Object", 1, "bell", (0.025, 0.025, 0.03)),
          ("Stamp_Seals_Press_Stapler", 5, "stapler", (0.03, 0.03, 0.03)),
          ("Place_Phone_Press_Stapler", 2, "stapler", (0.03, 0.03, 0.03)),
      ) for axis in (0, 1, 2)),
    Limit("Lift_Fan_Repeat", 1, "lifted", 0.05,
          lambda h, v: (nudged("thing", 2)(h, v), nudged("thing", 2)(h, 0.0)), least=True),
    *(Limit("Lift_Fan_Repeat", 1, f"home, axis {axis}", 0.04,
            nudged("thing", axis, after=lambda h: nudged("thing", 2)(h, 0.1)))
      for axis in (0, 1, 2)),
    Limit("Lift_Pot_Repeat", 1, "lifted", 0.82,
          lambda h, v: (pot(h, v), nudged("thing", 2)(h, 0.0)), least=True),
    Limit("Lift_Pot_Repeat", 1, "aside", 0.08, nudged("thing", 0, after=lambda h: pot(h, 0.9))),
    Limit("Lift_Pot_Repeat", 1, "down", 0.07, nudged("thing", 2, after=lambda h: pot(h, 0.9))),
    Limit("Move_Blocks_Apart", 2, "right", 0.1, place("right 0", None, 0.0), least=True),
    Limit("Move_Blocks_Apart", 2, "left", -0.1, place("left 0", None, 0.0)),
    Limit("Move_Playing_Cards_Away", 2, "right", 0.23, place("boxes 0", None, 0.0), least=True),
    Limit("Move_Playing_Cards_Away", 2, "left", -0.23, place("boxes 0", None, 0.0)),
    Limit("Separate_Fries_Bread", 2, "forward", -0.08, place("forward 0", 0.0, None), least=True),
    Limit("Separate_Fries_Bread", 2, "backward", -0.17, place("backward 0", 0.0, None)),
    Limit("Place_Bowls_Plates", 2, "on the plate", 0.05, beside("bowls 0", "plate")),
    Limit("Place_Bowls_Plates", 2, "in the bowl", 0.04, lambda h, v: (
          beside("bowls 0", "plate")(h, 0.0), beside("bowls 1", "bowls 0", "nest")(h, v)), done=2),
    Limit("Place_Bowls_Plates", 2, "above the bowl", 0.08, lambda h, v: (
          beside("bowls 0", "plate")(h, 0.0),
          h.lay("bowls 1", (*h.at("bowls 0")[:2], h.at("bowls 0")[2] + v))), done=2),
    Limit("Rank_Blocks_Color", 2, "line", 0.03, lambda h, v: (
          place("order 0", -0.1, -0.15)(h, 0), place("order 1", 0.1, None)(h, v - 0.15)), done=2),
    Limit("Rank_Blocks_Color", 2, "order", 0.0, lambda h, v: (
          place("order 0", 0.0, -0.15)(h, 0), place("order 1", None, -0.15)(h, v)), True, 2),
    Limit("Rank_Blocks_Color", 1, "near", -0.08, place("order 0", 0.0, None)),
    Limit("Rank_Blocks_Color", 1, "middle", 0.05, place("order 0", None, -0.15)),
    Limit("Stack_Blocks_Color_Order", 2, "aside", 0.025, lambda h, v:
          h.tower((0.0, -0.15), (0, 1), step=v), done=2),
    Limit("Stack_Blocks_Color_Order", 2, "height", 0.02, lambda h, v:
          on_block(h, "order 1", "order 0", 0.036 + v), done=2),
    Limit("Hang_Mug_Stack_Blocks", 2, "area, x", -0.05, place("red", None, -0.15)),
    Limit("Hang_Mug_Stack_Blocks", 2, "area, y", -0.1, place("red", -0.16, None)),
    Limit("Hang_Mug_Stack_Blocks", 3, "area, x", 0.0, place("red", None, -0.15)),
    Limit("Hang_Mug_Stack_Blocks", 3, "area, y", -0.05, place("red", -0.16, None)),
    Limit("Hang_Mug_Stack_Blocks", 3, "on the red block, x", 0.015, lambda h, v: (
          h.move("red", (-0.16, -0.13)), on_block(h, "green", "red", 0.03, v)), done=2),
    Limit("Hang_Mug_Stack_Blocks", 3, "on the red block, z", 0.007, lambda h, v: (
          h.move("red", (-0.16, -0.13)), on_block(h, "green", "red", 0.03 + v)), done=2),
    *(Limit("Hang_Mug_Stack_Blocks", 1, f"peg, axis {axis}", 0.02,
            lambda h, v, axis=axis: hung(h, axis, v)) for axis in (0, 1)),
    Limit("Hang_Mug_Stack_Blocks", 1, "peg, height", 0.86, lambda h, v: hung(h, 2, v), least=True),
    *(Limit("Hit_Blocks_Hammer_Order", 2, f"head, axis {axis}", 0.02,
            lambda h, v, axis=axis: struck(h, axis, v)) for axis in (0, 1)),
    *(Limit("Place_Phone_Press_Stapler", 1, f"stand, axis {axis}", value,
            lambda h, v, axis=axis: docked(h, axis, v))
      for axis, value in enumerate((0.045, 0.04, 0.04))),
    Limit("Place_Bottle_Cup", 4, "coaster", 0.035, beside("cup_0", "coaster_0")),
    Limit("Place_Bottle_Cup", 4, "coaster, height", 0.015, beside("cup_0", "coaster_0", axis=2)),
    Limit("Place_Object_Scale_Click", 2, "scale", 0.035, beside("bell", "scale")),
    Limit("Place_Object_Scale_Click", 2, "stand", 0.035, beside("object", "stand")),
    Limit("Place_Object_Scale_Click", 4, "back", 0.005, nudged("bell", 2, after=lambda h:
          beside("bell", "scale")(h, 0.0)), done=2),
    Limit("Place_Burger_Fries_Click_Bell", 1, "tray", 0.08, beside("burger", "tray", "left")),
    Limit("Place_Burger_Fries_Click_Bell", 4, "back, x", 0.04, nudged("burger", 0, after=lambda h:
          beside("burger", "tray", "left")(h, 0.0)), done=2),
    Limit("Place_Burger_Fries_Click_Bell", 4, "back, z", 0.005, nudged("burger", 2, after=lambda h:
          beside("burger", "tray", "left")(h, 0.0)), done=2),
    Limit("Click_Can_Place_Items", 2, "basket", 0.05, beside("bread", "basket")),
    Limit("Click_Can_Place_Items", 4, "pad", 0.03, beside("pill_bottle", "pad")),
    Limit("Click_Can_Place_Items", 4, "pad, height", 0.005,
          beside("pill_bottle", "pad", axis=2)),
    Limit("Click_Bell_Open_Microwave_Place_Object", 3, "door", 0.6 * math.pi / 2,
          lambda h, v: h.door(v), least=True),
    Limit("Click_Bell_Open_Microwave_Place_Object", 4, "least distance", 0.08,
          lambda h, v: left_of(h, v), least=True),
    Limit("Click_Bell_Open_Microwave_Place_Object", 4, "most distance", 0.2,
          lambda h, v: left_of(h, v)),
    Limit("Click_Bell_Open_Microwave_Place_Object", 4, "row", 0.05,
          lambda h, v: left_of(h, 0.12, v)),
    *(Limit("Stamp_Seals_Press_Stapler", 1, f"stamp, axis {axis}", 0.01,
            beside("left_seal", "left_pad", axis=axis)) for axis in (0, 1)),
    Limit("Stamp_Seals_Press_Stapler", 1, "stamp, height", 0.01,
          lambda h, v: on_block(h, "left_seal", "left_pad", v)),
    *(Limit("Stamp_Seals_Order", 1, f"stamp, axis {axis}", 0.01,
            beside("seal", "order 0", axis=axis)) for axis in (0, 1)),
    *(Limit("Remember_Color_Cover", 2, f"open place, axis {axis}", value, behind(axis))
      for axis, value in enumerate((0.045, 0.045, 0.005))),
    Limit("Observe_Blocks_Move_Memory", 2, "strip, y", -0.11,
          waited(place("targets 0", 0.0, None))),
    Limit("Observe_Blocks_Move_Memory", 2, "strip, x", 0.26,
          waited(place("targets 0", None, -0.18))),
    Limit("Remember_Orientation_Restore", 1, "turn", 15.0, lambda h, v: restored(h, v)),
    Limit("Remember_Orientation_Restore", 1, "place", 0.03, lambda h, v: restored(h, dx=v)),
    Limit("Remember_Orientation_Restore", 1, "height", 0.014, lambda h, v: restored(h, dz=v)),
    *(Limit(task, 1, "stillness", 0.03, lambda h, v: (h.stir(v), h.plan(), h.finish()))
      for task in ("Observe_Blocks_Move_Memory", "Observe_Objects_Click_Memory",
                   "Remember_Color_Cover", "Remember_Orientation_Restore")),
    *(Limit(task, 3, "height", 0.82, lambda h, v: held(h, v - h.at("target")[2]), least=True)
      for task in ("Pick_Blocks_Size", "Pick_Blocks_Height", "Pick_Blocks_Length",
                   "Pick_Blocks_Area", "Pick_Blocks_Distance", "Pick_Mugs_Distance",
                   "Pick_Mixed_Objects_Distance_B")),
    *(Limit(task, 3, "rise", 0.04, held, least=True)
      for task in ("Pick_Blocks_Canonical", "Pick_Cups_Canonical", "Pick_Rubik_Cubes_Canonical",
                   "Pick_Mixed_Objects_Canonical_A")),
    Limit("Pick_Blocks_Canonical", 3, "others", 0.025, lambda h, v: held(h, 0.08, other=v)),
    Limit("Pick_Cups_Canonical", 3, "others", 0.03, lambda h, v: held(h, 0.08, other=v)),
    *(Limit(task, 3, "rise", 0.06, held, least=True)
      for task in ("Pick_Tea_Box_Relational", "Pick_Cans_Relational", "Pick_Soaps_Relational",
                   "Pick_Mixed_Objects_Relational_A", "Pick_Seals_Multi_View",
                   "Pick_Mixed_Objects_Multi_View_B")),
    *(Limit(task, 3, "closed gripper", 0.2, lambda h, v: held(h, 0.08, v))
      for task in ("Pick_Tea_Box_Relational", "Pick_Seals_Multi_View")),
)  # fmt: skip
