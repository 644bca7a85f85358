"""A scene is a value: what lies where when a trial starts, and nothing else.

Scenes are frozen, compare by value, survive JSON both ways and carry a digest of their canonical
form. They know asset names, not meshes: `robospa.tasks.objects.object_model` turns an asset name
and its parameters into shapes. `Surroundings` (textures, lights, how the head camera stands) are
only seen: they never enter the physics, and their defaults are the clean scene.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from robospa.geometry import Pose, Vec3
from robospa.schema import convert
from robospa.tasks.shapes import Color, Params
from robospa.workcell import TABLE_TOP

SUITE = "robospa-3"
"""Version of scenes, pictures, sentences, robot and rules: a change to any needs a new one."""
SCENES = "robospa-2"
"""What seeds the random streams of scenes, with task, level and seed: the suite that drew them
all anew last. Later ones keep every scene whose task they do not change, and so its seed lists."""


SEEN, UNSEEN, WHITE = "seen", "unseen", "white"
"""Splits of textures: those of training scenes, those of evaluation, and plain white."""
TEXTURES = {SEEN: 10_000, UNSEEN: 1_000, WHITE: 1}
"""How many textures each split has; officially files that are called by their numbers."""


@dataclass(frozen=True)
class Texture:
    """An image on a surface: number `index`, from 0, of its split."""

    split: str
    index: int

    def __post_init__(self) -> None:
        if not 0 <= self.index < TEXTURES.get(self.split, 0):
            known = ", ".join(f"{split} (0 to {n - 1})" for split, n in TEXTURES.items())
            raise ValueError(
                f"no texture {self.index} of the split {self.split!r}; there are {known}"
            )


@dataclass(frozen=True)
class Lights:
    """Colours of the lights, linear RGB: the directional `sun` and the two point `lamps`.

    With `flicker` all of them are drawn anew for every picture, and the ambient light walks; it is
    the seed of these draws. None: the lights stay.
    """

    sun: Color = (0.5, 0.5, 0.5)
    lamps: tuple[Color, Color] = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
    flicker: int | None = None


@dataclass(frozen=True)
class Surroundings:
    """How the room looks; `wall` and `table` without a texture have their plain colours.

    `camera_shift` [m] is how far the head camera stands from its usual place.
    """

    wall: Texture | None = None
    table: Texture | None = None
    lights: Lights = field(default_factory=Lights)
    camera_shift: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SceneObject:
    """One object of a scene.

    `name` identifies it inside the scene and gives no hint of its role. `pose` is the pose of its
    body frame at the start. A `fixed` object cannot move. An object with `appears_at` [s of
    simulated time after the start] does not exist before that.
    """

    name: str
    asset: str
    pose: Pose
    params: Params = field(default_factory=dict)
    fixed: bool = False
    appears_at: float | None = None


@dataclass(frozen=True)
class Scene:
    """The start of a trial as a value: all that a world, a goal, a plan and an instruction need.

    What only some scene modes change has a default and is left out of the JSON form where it has
    that value, so that the digests of all other scenes do not depend on it.
    """

    task: str
    level: int
    seed: int
    embodiment: str
    mode: str
    objects: tuple[SceneObject, ...]
    """In the order in which the world creates them."""
    facts: Mapping[str, Any]
    """What the task drew besides (target, order, reference, ...), as JSON values."""
    table_shift: tuple[float, float] = (0.0, 0.0)
    """How far the table is moved, x and y [m]."""
    suite: str = SUITE
    """Version of the benchmark's scenes."""
    table_rise: float = 0.0
    """How much higher than `TABLE_TOP` the table stands [m]."""
    clutter: tuple[SceneObject, ...] = ()
    """What lies about besides: it exists and moves as objects do, but no task knows of it."""
    surroundings: Surroundings = field(default_factory=Surroundings)
    """What is only seen: textures, lights, the head camera's place."""
    wrist_shifts: tuple[Vec3, Vec3] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """How far the left and the right wrist camera are from their usual places, ahead, to the left
    and up in their pictures [m]."""
    strengths: Mapping[str, float] = field(default_factory=dict)
    """How strongly the mode varies each of its parts, by the part's name."""

    @property
    def everything(self) -> tuple[SceneObject, ...]:
        """The objects and the clutter, in the order in which the world creates them."""
        return (*self.objects, *self.clutter)

    @property
    def table_at(self) -> Vec3:
        """Shift of the table from its usual place, x, y and z [m]."""
        return (*self.table_shift, self.table_rise)

    @property
    def table_top(self) -> float:
        """Height of the table's surface [m]."""
        return TABLE_TOP + self.table_rise

    def object(self, name: str) -> SceneObject:
        """The object, or piece of clutter, called `name`.

        Raises:
            KeyError: There is none; the message names those that exist.
        """
        for item in self.everything:
            if item.name == name:
                return item
        known = [item.name for item in self.everything]
        raise KeyError(f"no object {name!r} in this scene; it has {known}")

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values; `from_json` is the inverse."""
        data: dict[str, Any] = _json_values(self)
        return {k: v for k, v in data.items() if k not in OPTIONAL or v != OPTIONAL[k]}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> Scene:
        """The scene that `to_json` wrote."""
        shift = data["table_shift"]
        return Scene(
            **{
                **data,
                "objects": _objects(data["objects"]),
                "table_shift": (shift[0], shift[1]),
                "clutter": _objects(data.get("clutter", ())),
                "surroundings": convert(data.get("surroundings", {}), Surroundings),
                "wrist_shifts": tuple(map(tuple, data.get("wrist_shifts", Scene.wrist_shifts))),
            }
        )

    @property
    def digest(self) -> str:
        """Hash of the canonical JSON form: equal digests mean equal scenes."""
        text = json.dumps(self.to_json(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def _json_values(value: object) -> Any:
    """As `json.loads(json.dumps(asdict(value)))` makes it, without the copies on the way."""
    if isinstance(value, float):
        return float(value)  # numpy's too
    if isinstance(value, tuple | list):
        return [_json_values(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): _json_values(item) for name, item in value.items()}
    if is_dataclass(value):
        return {part.name: _json_values(getattr(value, part.name)) for part in fields(value)}
    return value


def _objects(rows: Iterable[Mapping[str, Any]]) -> tuple[SceneObject, ...]:
    return tuple(
        SceneObject(
            **{**row, "pose": Pose(tuple(row["pose"]["position"]), tuple(row["pose"]["rotation"]))}
        )
        for row in rows
    )


OPTIONAL: Mapping[str, object] = {
    "table_rise": 0.0,
    "clutter": [],
    "surroundings": _json_values(Surroundings()),
    "strengths": {},
    "wrist_shifts": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
}
"""Fields that the JSON form leaves out where they have this value."""
