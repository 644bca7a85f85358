"""Official quirks of a scene that our suite has mended, switched back one by one.

A switch changes a finished scene: what lies where is still drawn by our samplers, which are bounded
and keep everything in view and in reach. What follows from the draw itself cannot be switched back
(docs/official-world.md lists it).
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robospa.geometry import Pose
from robospa.tasks.colors import NAMED
from robospa.tasks.families.cross_view import EXTREMES, SEEN_AS, VIEWS, leaders
from robospa.tasks.families.memory import STAND_Z
from robospa.tasks.official import official_models
from robospa.tasks.scene import Scene, SceneObject

IDS: Mapping[str, tuple[int, ...]] = {
    "Pick_Tea_Box_Relational": (0, 1, 2, 3, 4, 5),
    "Pick_Cans_Relational": (0, 1, 2, 3, 5, 6),
    "Pick_Soaps_Relational": (0, 1, 2, 3),
    "Pick_Sauce_Can_Multi_View": (0, 2, 4, 6),
    "Pick_Seals_Multi_View": (1, 2, 3, 4, 6),
    "Pick_Breads_Multi_View": (0, 1, 2, 3, 4, 5, 6),
}
"""Official models of the tasks with equal things, in the order of episodes."""
MULTI_VIEW = (
    "Pick_Sauce_Can_Multi_View", "Pick_Seals_Multi_View", "Pick_Breads_Multi_View",
    "Pick_Mixed_Objects_Multi_View_A", "Pick_Mixed_Objects_Multi_View_B",
)  # fmt: skip
MICROWAVE = "Click_Bell_Open_Microwave_Place_Object"
MICROWAVE_RISE = 0.06
"""The official microwave stands in the air [m]."""
STANDS = {"Observe_Blocks_Move_Memory": 0.85, "Observe_Objects_Click_Memory": 0.8}
"""Tasks in which something is shown on a stand, and its official grey."""
HIDING = (*STANDS, "Remember_Orientation_Restore")
WALL_HALF, WALL_Z = 0.2, 0.95
"""Half height and middle [m] of the official wall: it ends 1 cm above the table."""
SAME_HEIGHT = 1e-6
PURE: Mapping[str, tuple[float, float, float]] = {
    "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "yellow": (1, 1, 0),
    "cyan": (0, 1, 1), "magenta": (1, 0, 1), "orange": (1, 0.5, 0), "purple": (0.5, 0, 0.5),
    "white": (1, 1, 1), "black": (0.1, 0.1, 0.1), "brown": (0.6, 0.3, 0.1),
    "pink": (1, 0.75, 0.8),
}  # fmt: skip
OWN_PURE: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    "Pick_Blocks_Distance": {
        "purple": (0.55, 0, 0.85), "pink": (1, 0.4, 0.7), "brown": (0.55, 0.27, 0.07),
        "gray": (0.5, 0.5, 0.5),
    },
    "Rank_Blocks_Color": {"purple": (1, 0, 1)},
    "Hit_Blocks_Hammer_Order": {"purple": (1, 0, 1)},
    "Stack_Blocks_Color_Order": {"purple": (0.6, 0.2, 0.8)},
}  # fmt: skip
"""Official values of colour words as the renderer's linear input, and where a task has its own."""

Change = Callable[[Scene, int], Scene]
"""A scene and its episode number to the scene with the quirk."""


@dataclass(frozen=True)
class Switch:
    """A quirk of `tasks`, of all if there are none. `unsaid`: it only shows, and is switched after
    the sentence was made."""

    name: str
    tasks: tuple[str, ...]
    change: Change
    unsaid: bool = False


def switched(scene: Scene, episode: int, switches: Iterable[Switch], unsaid: bool = False) -> Scene:
    """`scene` with the quirks of `switches` that are `unsaid`, or those that are not."""
    for switch in switches:
        if switch.unsaid is unsaid and (not switch.tasks or scene.task in switch.tasks):
            scene = switch.change(scene, episode)
    return scene


def chosen(text: str) -> tuple[Switch, ...]:
    """The switches that `text` names: all, none, or names, comma separated; ValueError."""
    if text in ("all", "none"):
        return SWITCHES if text == "all" else ()
    known = {switch.name: switch for switch in SWITCHES}
    names = text.split(",")
    if wrong := [name for name in names if name not in known]:
        raise ValueError(f"there is no switch {wrong[0]!r}; there are {', '.join(known)}")
    return tuple(switch for switch in SWITCHES if switch.name in names)


def _changed(scene: Scene, changes: Mapping[str, SceneObject]) -> Scene:
    return replace(scene, objects=tuple(changes.get(o.name, o) for o in scene.objects))


def _with(item: SceneObject, **params: Any) -> SceneObject:
    return replace(item, params={**item.params, **params})


def _by_episode(scene: Scene, episode: int) -> Scene:
    points = np.array([[item.pose.position[:2] for item in scene.objects]])
    extreme = episode % len(EXTREMES)
    target = scene.objects[int(leaders(points)[0][0][extreme])].name
    block = f"{scene.task}/{scene.level}/{episode // len(VIEWS)}"
    seed = int.from_bytes(hashlib.sha256(block.encode()).digest()[:8], "big")
    order = np.random.default_rng(seed).permutation(len(VIEWS))
    view = VIEWS[int(order[episode % len(VIEWS)])]
    facts = {
        **scene.facts,
        "target": target,
        "extreme": EXTREMES[extreme],
        "viewpoint": view,
        "position": SEEN_AS[view][extreme],
    }
    return replace(scene, facts=facts)


def _model_by_episode(scene: Scene, episode: int) -> Scene:
    ids = IDS[scene.task]
    model = str(ids[episode % len(ids)])
    models = [one.model for one in official_models(scene.objects[0].asset)]
    if model not in models:  # no look of ours stands for it
        return scene
    look = models.index(model)
    return replace(scene, objects=tuple(_with(item, look=look) for item in scene.objects))


def _microwave(scene: Scene, episode: int) -> Scene:
    name = scene.facts.get("microwave")
    if not name:
        return scene
    item = scene.object(name)
    x, y, z = item.pose.position
    risen = Pose((x, y, z + MICROWAVE_RISE), item.pose.rotation)
    return _changed(scene, {name: replace(item, pose=risen)})


def _left_one(scene: Scene, episode: int) -> Scene:
    one, other = scene.facts.get("object"), scene.facts.get("reference")
    if not one or not other:
        return scene
    left, right = sorted((one, other), key=lambda name: scene.object(name).pose.position[0])
    return replace(scene, facts={**scene.facts, "object": left, "reference": right})


def _wall(scene: Scene, episode: int) -> Scene:
    item = scene.object(scene.facts["wall"])
    x, y, _ = item.pose.position
    half = [*item.params["half"][:2], WALL_HALF]
    at = Pose((x, y, WALL_Z + scene.table_rise), item.pose.rotation)
    raised = replace(_with(item, half=half), pose=at)
    return _changed(scene, {item.name: raised})


def _stand(scene: Scene, episode: int) -> Scene:
    grey = [STANDS[scene.task]] * 3
    stands = [
        item
        for item in scene.objects
        if item.fixed and abs(item.pose.position[2] - scene.table_rise - STAND_Z) < SAME_HEIGHT
    ]
    return _changed(scene, {item.name: _with(item, color=grey) for item in stands})


def _colors(scene: Scene, episode: int) -> Scene:
    pure = {**PURE, **OWN_PURE.get(scene.task, {})}
    words = {NAMED[word]: word for word in pure}
    changes = {}
    for item in scene.objects:
        word = words.get(tuple(item.params.get("color", ())))
        if item.asset == "block" and word and item.name != scene.facts.get("wall"):
            changes[item.name] = _with(item, color=[float(v) for v in pure[word]])
    return _changed(scene, changes)


SWITCHES = (
    Switch("extreme-by-episode", MULTI_VIEW, _by_episode),
    Switch("model-by-episode", tuple(IDS), _model_by_episode),
    Switch("left-thing-moves", (MICROWAVE,), _left_one),
    Switch("floating-microwave", (MICROWAVE,), _microwave),
    Switch("gap-under-wall", HIDING, _wall),
    Switch("pale-stand", tuple(STANDS), _stand, unsaid=True),
    Switch("pure-colors", (), _colors, unsaid=True),
)
"""In the order in which they are switched."""
