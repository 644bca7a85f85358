"""The parts of a trial in the official world: our scene with official quirks and objects."""

from __future__ import annotations

from dataclasses import replace

from robospa.harness.official.checkout_options import Episodes
from robospa.harness.official.official_options import OfficialLayout
from robospa.harness.official.sentences import SPLITS, OfficialSentences
from robospa.harness.official.switches import chosen, switched
from robospa.harness.trial import TrialParts
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import instruction
from robospa.trial import TrialKey


def official_world_parts(
    key: TrialKey,
    layout: OfficialLayout,
    episodes: Episodes,
    sentences: OfficialSentences | None = None,
) -> TrialParts:
    """Scene, goal and sentence of `key`; with `sentences` the official ones."""
    told, shown = official_scenes(key, layout, episodes)
    if sentences is not None:
        said = sentences.instruction(told, key.split)
    else:
        ours = {theirs: own for own, theirs in SPLITS.items()}
        said = instruction(told, ours.get(key.split, key.split))
    task = find_task(key.task)
    return TrialParts(shown, task, task.goal(shown), said)


def official_scenes(
    key: TrialKey, layout: OfficialLayout, episodes: Episodes
) -> tuple[Scene, Scene]:
    """The scene of `key` of which its sentence is made, and as it is shown: what only shows is
    switched after the sentence was made, so that colours are named by their words.

    A seed's place among `episodes` is its episode number.
    """
    switches = chosen(layout.switches)
    number = list(episodes.get(key.variant, (key.seed,))).index(key.seed)
    drawn = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)
    told = layout.scatter(layout.pack(switched(drawn, number, switches)))
    shown = switched(told, number, switches, unsaid=True)
    return told, replace(shown, suite=layout.suite)
