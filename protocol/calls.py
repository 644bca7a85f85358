"""Calls of skills: what a policy of the action space "skill" answers in the place of a chunk.

    {"skill": "pick", "at": [0.41, 0.62]}
    {"skill": "place", "at": [0.55, 0.5], "offset": [0.1, 0.0]}

A point is [u, v] in a camera's picture of the last observation: u from 0 at its left edge to 1 at
its right edge, v from 0 at its top edge to 1 at its bottom edge. It means the object that is drawn
there, or the table there. `robospa.harness.skill_calls` says what each skill does.
"""

from collections.abc import Mapping
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from robospa.action_space import ARMS
from robospa.observation import CAMERAS
from robospa.protocol.errors import PolicyAnswerError, printable
from robospa.protocol.policy import POINT, PolicySpec
from robospa.schema import one_of, read

MAX_CALLS = 64
"""Calls of one answer."""

Share = Annotated[float, Meta(ge=0, le=1)]
Point = tuple[Share, Share]
Metres = Annotated[float, Meta(ge=-2, le=2)]
Height = Annotated[float, Meta(ge=0.002, le=0.4)]
Times = Annotated[int, Meta(ge=1, le=20)]
Arm = Annotated[str, one_of(ARMS)]


class Call(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """One call; `FIELDS` says which of its fields each skill takes."""

    skill: str
    at: Point | None = None
    """The object that is meant, or where on the table."""
    to: Annotated[tuple[Point, ...], Meta(min_length=1, max_length=16)] | None = None
    """What it is brought to: one point, for `hit` one or several."""
    camera: Annotated[str, one_of(CAMERAS)] | None = None
    """Whose picture `at` and `to` are in: `head`, or the spec's first camera if it has no head."""
    arm: Arm | None = None
    """Which arm does it; None lets the skill choose."""
    arms: Annotated[tuple[Arm, ...], Meta(min_length=1, max_length=2)] | None = None
    """Which arms lift; None lets the skill choose."""
    offset: tuple[Metres, Metres] | None = None
    """[m] to the right and forward, as the robot sees it, from the point `at`."""
    turn: Annotated[float, Meta(ge=-360, le=360)] | None = None
    """[degrees] anticlockwise, seen from above, against how it stood when it was grasped."""
    lift: Height | None = None
    """How high it is raised [m]."""
    height: Height | None = None
    """How far above its place it is let go [m]."""
    times: Times | None = None
    """How often; once if it is not said."""
    seconds: Annotated[float, Meta(ge=0.2, le=60)] | None = None
    """How long [s, simulated]."""


FIELDS: Mapping[str, tuple[str, str]] = {
    "pick": ("at", "camera arm lift"),
    "place": ("at", "camera arm offset turn height"),
    "drop": ("at", "camera arm height"),
    "press": ("at", "camera arm"),
    "stamp": ("at to", "camera arm times"),
    "hit": ("at to", "camera arm"),
    "pour": ("at to", "camera arm"),
    "hang": ("at to", "camera arm"),
    "dock": ("at to", "camera arm"),
    "open": ("at", "camera arm"),
    "raise_lower": ("at", "camera arms times lift"),
    "handover": ("", "arm"),
    "wait": ("seconds", ""),
    "home": ("", "arm"),
    "done": ("", ""),
    "point": ("at", "camera"),
}
"""Fields that a skill needs, and those that it takes. A policy of the space "point" answers `point`
alone, which no other one answers."""


def read_calls(answer: object, spec: PolicySpec) -> list[Call]:
    """The calls that a policy of `spec` answered, with their cameras; raises PolicyAnswerError."""
    if not isinstance(answer, list | tuple):
        found = getattr(answer, "dtype", type(answer).__name__)
        raise PolicyAnswerError(
            f"the policy answered {printable(str(found), 80)}, not a list of calls of skills"
        )
    if not 1 <= len(answer) <= MAX_CALLS:
        raise PolicyAnswerError(
            f"the policy answered {len(answer)} calls, not 1 to {MAX_CALLS} of them"
        )
    return [_read(one, f"call {number}", spec) for number, one in enumerate(answer, 1)]


def check_calls(answer: object, spec: PolicySpec) -> list[dict[str, object]]:
    """The same as plain values: what goes over the wire and into records."""
    return [plain_call(call) for call in read_calls(answer, spec)]


def plain_call(call: Call) -> dict[str, object]:
    """Its fields as a policy writes them."""
    found: dict[str, object] = msgspec.to_builtins(call)
    if call.to is not None and len(call.to) == 1:
        found["to"] = call.to[0]
    return {k: _plain(v) for k, v in found.items()}


def _read(value: object, what: str, spec: PolicySpec) -> Call:
    skill = value.get("skill") if isinstance(value, Mapping) else None
    known = [name for name in FIELDS if (name == POINT) == (spec.action == POINT)]
    if not isinstance(value, Mapping) or not isinstance(skill, str) or skill not in known:
        said = value if skill is None else skill
        raise PolicyAnswerError(
            f"{what} must be a map whose 'skill' is one of {', '.join(known)}, "
            f"not {printable(repr(said), 80)}"
        )
    what = f"{what} ({skill})"
    given = {name: _plain(one) for name, one in value.items()}
    goal = given.get("to")
    if isinstance(goal, list) and not any(isinstance(one, list) for one in goal):
        given["to"] = [goal]  # one point
    call = read(Call, given, what, PolicyAnswerError)
    needed, taken = (names.split() for names in FIELDS[skill])
    for name in Call.__struct_fields__[1:]:
        there = getattr(call, name) is not None
        if there and name not in (*needed, *taken):
            has = ", ".join((*needed, *taken)) or "none"
            raise PolicyAnswerError(f"{what} has no field {name!r}: its fields are {has}")
        if not there and name in needed:
            raise PolicyAnswerError(f"{what} lacks the field {name!r}")
    if call.to is not None and len(call.to) > 1 and skill != "hit":
        raise PolicyAnswerError(f"{what}: 'to' must be one point, not {len(call.to)}")
    if call.at is None:
        return call
    cameras = [camera.name for camera in spec.cameras]
    camera = call.camera or ("head" if "head" in cameras or not cameras else cameras[0])
    if camera not in cameras:
        raise PolicyAnswerError(
            f"{what}: the policy sees no camera {camera!r}, only {', '.join(cameras) or 'none'}"
        )
    return msgspec.structs.replace(call, camera=camera)


def _plain(value: object) -> object:
    """Numbers and lists of numpy as Python's."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
