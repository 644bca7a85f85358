"""Randomised scenes: the official variations of a scene's surroundings, each a part of its own.

`docs/runs.md` lists the parts with their strengths. Every part draws from a generator of its own:
leaving one out, or changing its strength, leaves the others as they were. Evaluation takes unseen
textures, training scenes (mode `randomized-seen`) seen ones; nothing else differs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from robospa.geometry import Array, Vec3
from robospa.registry import did_you_mean
from robospa.tasks.modes import Part, shifted, with_table_raised
from robospa.tasks.modes.clutter import clutter, look_alikes
from robospa.tasks.modes.wording import REWORDED, other_target
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.sampling.turns import usable
from robospa.tasks.scene import SEEN, TEXTURES, UNSEEN, WHITE, Lights, Scene, Texture
from robospa.tasks.shapes import Color
from robospa.workcell import WORKCELL

FLICKERING = 0.02
"""Probability that the lights of a scene change from picture to picture (official)."""
SEEDS = 2**32
WAYS = 16
"""Directions in which all objects may be moved together."""
OTHERS = range(32)
"""Seeds that no evaluation has: where their scenes have objects is the usual area of a variant."""


@dataclass(frozen=True)
class Variation:
    """A part of the mode: what it does at a strength up to `most`, usually `usual`.

    `draw(scene, part, strength, textures)` makes the varied scene. One with `whole` strengths
    counts things. One that is not `official` is left out unless it is named. A `tangible` one
    changes where bodies are. `profile` are the strengths at which a profile measures it, `of` the
    group that it stands in there: words, eyes, hands, scene or, of "repeat", which changes nothing
    but the policy's seed, none.
    """

    name: str
    usual: float
    most: float
    draw: Callable[[Scene, Part, float, str], Scene]
    whole: bool = False
    official: bool = True
    tangible: bool = False
    profile: tuple[float, ...] = ()
    of: str = "scene"


def _height(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    return with_table_raised(scene, -float(part("table height").uniform(0.0, strength)))


def _texture(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    rng = part("textures")
    drawn = [Texture(textures, int(rng.integers(TEXTURES[textures]))) for _ in range(2)]
    wall, table = (texture if rng.random() < strength else None for texture in drawn)
    return replace(scene, surroundings=replace(scene.surroundings, wall=wall, table=table))


def _light(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    rng = part("lights")
    flickers = rng.random() < FLICKERING
    usual = Lights()

    def mixed(color: Color) -> Color:
        r, g, b = (c + strength * (rng.random() - c) for c in color)
        return (r, g, b)

    sun, left, right = (mixed(color) for color in (usual.sun, *usual.lamps))
    seed = int(rng.integers(SEEDS))
    lights = Lights(sun, (left, right), seed if flickers else None)
    return replace(scene, surroundings=replace(scene.surroundings, lights=lights))


def _clutter(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    return replace(scene, clutter=clutter(scene, part("clutter"), int(strength)))


def _camera(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    shift = _anywhere(part("head camera"), strength)
    return replace(scene, surroundings=replace(scene.surroundings, camera_shift=shift))


def _wrist_camera(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    rng = part("wrist cameras")
    return replace(scene, wrist_shifts=(_anywhere(rng, strength), _anywhere(rng, strength)))


def _anywhere(rng: np.random.Generator, most: float) -> Vec3:
    """A vector in any direction, of any length up to `most`."""
    way = rng.standard_normal(3)
    x, y, z = (way / np.linalg.norm(way) * rng.uniform(0.0, most)).tolist()
    return (x, y, z)


def _displaced(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    """All objects moved together by `strength` [m], in the one of WAYS that takes the target
    farthest out of the variant's usual area and leaves every object in view and in reach; `scene`
    itself if there is none, or no single target."""
    if "target" not in scene.facts:
        return scene
    low, high = _area(scene.task, scene.level)
    target = scene.object(scene.facts["target"]).pose.position[:2]
    angles = part("displaced").uniform(0.0, math.tau) + math.tau / WAYS * np.arange(WAYS)
    ways = strength * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    places = target + ways
    beyond = np.maximum(low - places, places - high).max(axis=1)
    for x, y in ways[np.argsort(-beyond)].tolist():
        objects = tuple(shifted(item, (x, y, 0.0)) for item in scene.objects)
        if all(usable(WORKCELL, item) for item in objects):
            return replace(scene, objects=objects)
    return scene


@cache
def _area(task: str, level: int) -> tuple[Array, Array]:
    """Corners (2,) [m] of the rectangle that holds all objects of other scenes of a variant."""
    from robospa.tasks.catalog import build_scene

    points = []
    for seed in OTHERS:
        with suppress(LayoutError):
            points += [o.pose.position[:2] for o in build_scene(task, level, seed).objects]
    return np.min(points, axis=0), np.max(points, axis=0)


def _white_table(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    return replace(scene, surroundings=replace(scene.surroundings, table=Texture(WHITE, 0)))


def _look_alikes(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    more = look_alikes(scene, part("look-alikes"), int(strength))
    return replace(scene, clutter=(*scene.clutter, *more))


def _other_target(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    return other_target(scene, part("other target"))


def _elsewhere(scene: Scene, part: Part, strength: float, textures: str) -> Scene:
    """What is changed is not in the scene: who speaks, draws or moves reads its strength."""
    return scene


def _axis(of: str, name: str, *profile: float, most: float = 1, whole: bool = True) -> Variation:
    """A part that is not in the scene, usually of the middle strength of its profile."""
    profile = profile or (1.0,)
    return Variation(
        name, profile[len(profile) // 2], most, _elsewhere, whole, False, profile=profile, of=of
    )


VARIATIONS = {
    v.name: v
    for v in (
        Variation("height", 0.03, 0.05, _height, tangible=True, profile=(0.03,)),
        Variation("texture", 0.98, 1.0, _texture, profile=(0.98,)),
        Variation("light", 1.0, 1.0, _light, profile=(0.5, 1.0)),
        Variation("displaced", 0.05, 0.15, _displaced, False, False, True, profile=(0.05, 0.1)),
        Variation("clutter", 10.0, 20.0, _clutter, whole=True, tangible=True, profile=(5.0, 10.0)),
        Variation("camera", 0.02, 0.1, _camera, official=False, profile=(0.02, 0.05)),
        Variation("wrist-camera", 0.01, 0.05, _wrist_camera, official=False, profile=(0.01, 0.02)),
        Variation("white-table", 1.0, 1.0, _white_table, whole=True, official=False),
        Variation("look-alikes", 2.0, 5.0, _look_alikes, True, False, True, profile=(2.0,)),
        _axis("eyes", "blur", 1, 2, 4, most=10, whole=False),
        _axis("eyes", "noise", 10, 20, 40, most=100, whole=False),
        _axis("eyes", "jpeg", 80, 95, most=99),
        _axis("eyes", "bright", 1, 2, most=4, whole=False),
        _axis("eyes", "dark", 1, 2, most=4, whole=False),
        _axis("eyes", "grey"),
        _axis("eyes", "wrist-shift", 8, 16, most=80),
        _axis("eyes", "no-wrists"),
        _axis("hands", "start", 2, 5, most=20, whole=False),
        _axis("hands", "action-noise", 2, 5, 10, most=50, whole=False),
        _axis("hands", "action-bias", 5, 10, most=50, whole=False),
        _axis("hands", "weak-grip", 80, 95, most=99, whole=False),
        _axis("hands", "latency", 100, 200, 400, most=10_000, whole=False),
        *(_axis("words", name) for name in REWORDED[:-1]),
        _axis("words", "typos", 1, 3, most=20),
        *(_axis("words", name) for name in ("indirect", "no-sentence", "nothing-here")),
        _axis("words", "other-scene"),
        replace(_axis("words", "other-target"), draw=_other_target),
        _axis("", "repeat"),
    )
}
"""By name, in the order in which they are applied: clutter stands on the table as it is then."""

OF_TARGETS = ("other-target", "displaced")
"""Those that leave scenes without a single target, procedures, as they are."""
OFFICIAL = {v.name: v.usual for v in VARIATIONS.values() if v.official}
UNNUMBERED = {
    v.name: v.usual for v in VARIATIONS.values() if v.draw is not _elsewhere or not v.profile[1:]
}
"""Strengths that a mode's name leaves out: not those of a table's several rows."""


def axes(text: str) -> list[tuple[str, float]]:
    """The parts and strengths that a profile of `text` measures: parts with all the strengths of
    their profile, or with one of their own ("blur=3"), groups of parts (words, eyes, hands, scene)
    or "all", which leaves out what needs a real clock. ValueError for what is none of these."""
    found: list[tuple[str, float]] = []
    for word in (w.strip() for w in text.split(",")):
        members = [v for v in VARIATIONS.values() if v.name != "latency"]
        group = [v for v in members if word in ("all", v.of or "all")]
        group = [VARIATIONS[word]] if word in VARIATIONS else group
        found += [(v.name, strength) for v in group for strength in v.profile or (v.usual,)]
        found += [] if group else [_part(word, text)]
    return list(dict.fromkeys(found))


@dataclass(frozen=True)
class Randomized:
    """A mode that varies some parts, each by its strength, with textures of one split."""

    textures: str
    strengths: Mapping[str, float] = field(default_factory=lambda: dict(OFFICIAL))

    def __call__(self, scene: Scene, part: Part) -> Scene:
        """The scene with its parts varied, and their strengths in it."""
        for name, strength in self.strengths.items():
            scene = VARIATIONS[name].draw(scene, part, strength, self.textures)
        return replace(scene, strengths=dict(self.strengths))

    def chosen(self, parts: str) -> Randomized:
        """The mode of these parts alone: names, each with "=strength" if that is not the usual.

        ValueError, in one sentence, for what is no part of it.
        """
        asked = [_part(text, parts) for text in parts.split(",")]
        strengths = dict(asked)
        if len(strengths) < len(asked):
            raise ValueError(f"the scene mode's parts {parts!r} name a part twice")
        return replace(self, strengths={n: strengths[n] for n in VARIATIONS if n in strengths})

    @property
    def parts(self) -> str:
        """Its parts in their order with their unusual strengths; empty for the official ones."""
        if self.strengths == OFFICIAL:
            return ""
        return ",".join(
            n if s == UNNUMBERED.get(n) else f"{n}={s:g}" for n, s in self.strengths.items()
        )

    @property
    def tangible(self) -> str:
        """ "clean", "randomized", or "randomized:" with the parts that change where bodies are."""
        bodies = _tangible(self.strengths)
        if not bodies or bodies == _tangible(OFFICIAL):
            return "randomized" if bodies else "clean"
        return f"randomized:{Randomized(UNSEEN, bodies).parts}"


def _tangible(strengths: Mapping[str, float]) -> dict[str, float]:
    return {name: s for name, s in strengths.items() if VARIATIONS[name].tangible}


def _part(text: str, parts: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    found = VARIATIONS.get(name)
    if found is None:
        hint = did_you_mean(name, tuple(VARIATIONS))
        raise ValueError(
            f"no part or axis {name!r} in {parts!r}; {hint}there are {', '.join(VARIATIONS)}"
        )
    if not equals:
        return name, found.usual
    strength = float(number) if re.fullmatch(r"\d{1,6}(\.\d{1,4})?", number) else math.nan
    if not 0.0 < strength <= found.most or (found.whole and strength % 1):
        kind = "a whole number" if found.whole else "a number with at most 4 decimals,"
        raise ValueError(
            f"the strength of {name!r} in {parts!r} must be {kind} above 0 and at most "
            f"{found.most:g}, not {number!r}"
        )
    return name, strength


EVALUATION = Randomized(UNSEEN)
TRAINING = Randomized(SEEN)
