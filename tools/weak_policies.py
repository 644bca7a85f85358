"""Scripted policies with one known weakness each, to be found guilty of it and of nothing else.

    robospa eval tools.weak_policies:blind_to_words --profile all --tasks GAC,CBG --out runs/weak

They plan like the oracle on the exact scene, but hear what is said: without a sentence they guess,
and of what is not there they take nothing. For tasks with a single target (docs/profile.md).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.oracle import Oracle
from robospa.harness.effects import RADIANS_PER_MM
from robospa.observation import Observation
from robospa.protocol.policy import TrialInfo
from robospa.tasks.catalog import build_scene
from robospa.tasks.modes.wording import QUESTIONS
from robospa.tasks.scene import Scene

NOISE = 60.0
"""Millimetres that the noisy policy is off."""
Understood = Callable[[Scene, np.random.Generator], Scene]
"""What a policy makes of its trial's scene: whatever it takes for the target."""


def at(scene: Scene, target: str) -> Scene:
    """`scene` with another target."""
    return replace(scene, facts={**scene.facts, "target": target})


def guessed(scene: Scene, rng: np.random.Generator) -> Scene:
    """Any object of `scene`; never one that a sentence names to measure from."""
    names = [o.name for o in scene.objects if o.name != scene.facts.get("reference")]
    return at(scene, names[int(rng.integers(len(names)))])


def reads(scene: Scene, rng: np.random.Generator) -> Scene:
    """No weakness."""
    return guessed(scene, rng) if "no-sentence" in scene.strengths else scene


def knows_scenes(scene: Scene, rng: np.random.Generator) -> Scene:
    """Takes what the clean scene's sentence asks for, whatever is said."""
    own = build_scene(scene.task, scene.level, scene.seed, scene.embodiment)
    return at(scene, own.facts["target"])


def needs_light(scene: Scene, rng: np.random.Generator) -> Scene:
    """Guesses in another light."""
    return guessed(scene, rng) if "light" in scene.strengths else reads(scene, rng)


def sees_no_colour(scene: Scene, rng: np.random.Generator) -> Scene:
    """Guesses where a colour names the target."""
    return guessed(scene, rng) if "color" in scene.facts else reads(scene, rng)


def knows_one_sentence(scene: Scene, rng: np.random.Generator) -> Scene:
    """Does what the first sentence of its variant asks for, if that can be done."""
    first = build_scene(scene.task, scene.level, 100_000).facts
    make = next(make for fact, make in QUESTIONS.items() if fact in scene.facts)
    kept = {name: value for name, value in first.items() if name != "target"}
    for facts in make(scene):
        asked = {**scene.facts, **facts}
        if all(asked[name] == value for name, value in kept.items() if name != "reference"):
            return at(scene, str(facts["target"]))
    return guessed(scene, rng)


class Weak(Oracle):
    """Acts on what it `understood`, `noise` [mm] off."""

    def __init__(self, name: str, understood: Understood = reads, noise: float = 0.0) -> None:
        super().__init__()
        self.spec = replace(Oracle.spec, name=name)
        self._understood, self._noise = understood, noise

    def reset(self, trial: TrialInfo) -> None:
        """Build the scene of `trial` as it is understood."""
        super().reset(trial)
        assert self._scene is not None, "it was built"
        self._rng = np.random.default_rng(trial.policy_seed)
        self._still = (
            "nothing-here" in self._scene.strengths and self._understood is not knows_scenes
        )
        self._scene = self._understood(self._scene, self._rng)

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The next skill's actions, float32 (T, D)."""
        if self._still:
            return observation["state"][None]
        made = super().infer(observation).copy()
        off = self._rng.standard_normal(made.shape) * self._noise * RADIANS_PER_MM
        off[:, [6, 13]] = 0.0
        return np.asarray(made + off, dtype=np.float32)


no_weakness = partial(Weak, "no-weakness")
blind_to_words = partial(Weak, "blind-to-words", knows_scenes)
blind_to_light = partial(Weak, "blind-to-light", needs_light)
noisy = partial(Weak, "noisy", reads, NOISE)
colour_blind = partial(Weak, "colour-blind", sees_no_colour)
one_sentence = partial(Weak, "one-sentence", knows_one_sentence)
