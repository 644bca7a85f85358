"""Tasks about blocks' measures, distances and colours: draws, words and goals over many seeds."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable
from functools import cache

import numpy as np
import pytest
from teleport import Teleport

from robospa.tasks.catalog import build_scene, task
from robospa.tasks.events import outcome
from robospa.tasks.families.basic_color.task import COLORS
from robospa.tasks.families.block_measures.task import none_hidden
from robospa.tasks.families.distance import object_sets
from robospa.tasks.objects import look_count, object_model
from robospa.tasks.objects.build import PALETTE
from robospa.tasks.objects.tint import TINTS
from robospa.tasks.plan import Pick, Skill
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import sentences
from robospa.workcell import TABLE_TOP, workcell

CELL = workcell("aloha-agilex")

MEASURES = {"Pick_Blocks_Height": 2, "Pick_Blocks_Length": 0, "Pick_Blocks_Area": 0}
"""Which half size makes the rank."""
DISTANCES = {
    "Pick_Blocks_Distance": object_sets.BLOCKS,
    "Pick_Mugs_Distance": object_sets.MUGS,
    "Pick_Pill_Bottles_Distance": object_sets.PILL_BOTTLES,
    "Pick_Mixed_Objects_Distance_A": object_sets.MIXED_A,
}
COLORED = {f"Basic_Color_{f.name}": f for f in object_sets.FAMILIES}
TASKS = (*MEASURES, *DISTANCES, *COLORED)
LEVELS = range(1, 6)
SEEDS = range(700_000, 700_060)

each_variant = pytest.mark.parametrize(("name", "level"), list(itertools.product(TASKS, LEVELS)))
each_measure = pytest.mark.parametrize(("name", "level"), list(itertools.product(MEASURES, LEVELS)))
each_distance = pytest.mark.parametrize(
    ("name", "level"), list(itertools.product(DISTANCES, LEVELS))
)
each_color = pytest.mark.parametrize(("name", "level"), list(itertools.product(COLORED, LEVELS)))


@cache
def scenes(name: str, level: int) -> tuple[Scene, ...]:
    return tuple(build_scene(name, level, seed) for seed in SEEDS)


def places(scene: Scene) -> np.ndarray:
    """(count, 2) origins [m]."""
    return np.array([o.pose.position[:2] for o in scene.objects])


def index_of(scene: Scene, fact: str = "target") -> int:
    return [o.name for o in scene.objects].index(scene.facts[fact])


def assert_near_uniform(values: Iterable[object], kinds: int) -> None:
    """No kind is off by more than 4.5 standard deviations."""
    counts = Counter(values)
    total = sum(counts.values())
    assert len(counts) <= kinds
    spread = 4.5 * math.sqrt(total / kinds * (1 - 1 / kinds))
    assert all(abs(c - total / kinds) <= spread for c in counts.values()), counts


# Every variant


@each_variant
def test_counts_are_those_of_the_sheets(name: str, level: int) -> None:
    count = level + 1 if name in MEASURES else level + 2
    if "Blocks" in name and name not in MEASURES:
        count = (3, 6, 8, 9, 10)[level - 1]
    facts = task(name).levels[level]
    assert (facts.candidates, facts.subtasks, facts.steps) == (count, 1, 150)
    assert {len(s.objects) for s in scenes(name, level)} == {count}


@each_variant
def test_objects_are_apart_in_view_in_reach_and_on_the_table(name: str, level: int) -> None:
    for scene in scenes(name, level):
        models = [object_model(o.asset, o.params) for o in scene.objects]
        x, y = places(scene).T
        radius = np.array([m.radius for m in models])
        height = np.array([m.size[2] for m in models])
        assert CELL.in_view(x, y, radius, 0.0).all() and CELL.in_view(x, y, 0.0, height).all()
        assert CELL.in_reach(x, y).all()
        low = [o.pose.position[2] + m.bottom for o, m in zip(scene.objects, models, strict=True)]
        assert low == pytest.approx([TABLE_TOP] * len(low))
        for i, j in itertools.combinations(range(len(models)), 2):
            assert math.dist(places(scene)[i], places(scene)[j]) > radius[i] + radius[j]


@each_variant
def test_target_is_any_name(name: str, level: int) -> None:
    found = scenes(name, level)
    assert_near_uniform((index_of(s) for s in found), len(found[0].objects))
    assert [o.name for o in found[0].objects] == [
        f"object_{i}" for i in range(len(found[0].objects))
    ]


@each_variant
def test_only_the_target_carried_by_a_gripper_succeeds(name: str, level: int) -> None:
    scene = scenes(name, level)[level]
    target = scene.facts["target"]
    other = next(o.name for o in scene.objects if o.name != target)

    def trial(*plan: Skill) -> Teleport:
        return Teleport(scene, task(name).goal(scene)).run(plan)

    assert outcome(trial(*task(name).plan(scene)).events, 1).success
    assert not outcome(trial().events, 1).best
    wrong = trial(Pick(other))
    assert not outcome(wrong.events, 1).success
    assert "wrong_object" in [e.kind for e in wrong.events]
    thrown = Teleport(scene, task(name).goal(scene))
    x, y, _ = thrown.poses[target].position
    thrown.poses[target] = type(thrown.poses[target])((x, y, 1.0))
    thrown.tick(5)
    assert not outcome(thrown.events, 1).success


# Measures of blocks


@each_measure
def test_ranks_are_true_uniform_and_the_only_difference(name: str, level: int) -> None:
    found, axis = scenes(name, level), MEASURES[name]
    word = name.rsplit("_", 1)[1].lower()
    assert_near_uniform((s.facts[f"{word}_rank"] for s in found), level + 1)
    for scene in found:
        halves = [o.params["half"] for o in scene.objects]
        order = sorted(range(len(halves)), key=lambda i: -halves[i][axis])
        assert order[scene.facts[f"{word}_rank"] - 1] == index_of(scene)
        assert len({tuple(o.params["color"]) for o in scene.objects}) == 1
        same = [k for k in range(3) if k != axis and (word != "area" or k == 2)]
        assert all(len({h[k] for h in halves}) == 1 for k in same)


@pytest.mark.parametrize("level", LEVELS)
def test_no_block_hides_behind_a_taller_one(level: int) -> None:
    # Independent of the layout's own rule: sight lines to the tops, sampled along their length.
    eye = np.array(CELL.head.position)
    for scene in scenes("Pick_Blocks_Height", level):
        for item, other in itertools.permutations(scene.objects, 2):
            top = np.array(item.pose.position) + np.array([0.0, 0.0, item.params["half"][2]])
            line = eye + np.linspace(0, 1, 400)[:, None] * (top - eye)
            delta = np.abs(line - np.array(other.pose.position))
            half = other.params["half"]
            inside = (delta[:, :2] < 0.0155).all(axis=1) & (delta[:, 2] < half[2])
            assert not inside.any(), (scene.seed, item.name, other.name)


def test_a_short_block_behind_a_tall_one_is_refused() -> None:
    tall, short = (0.016, 0.016, 0.077), (0.016, 0.016, 0.012)
    behind = [(-0.03, -0.05), (-0.03, 0.05)]
    assert not none_hidden(CELL.head, behind, [tall, short])
    assert none_hidden(CELL.head, behind, [short, tall])
    assert none_hidden(CELL.head, [(-0.15, -0.05), (0.1, 0.05)], [tall, short])


# Distances


@each_distance
def test_distance_ranks_are_uniform_clear_and_spaced(name: str, level: int) -> None:
    found, rules = scenes(name, level), DISTANCES[name].rules
    gap, least = rules.gap[level - 1], rules.apart[level - 1]
    assert_near_uniform((s.facts["distance_rank"] for s in found), rules.counts[level - 1] - 1)
    for scene in found:
        p, reference, target = places(scene), index_of(scene, "reference"), index_of(scene)
        far = [math.dist(q, p[reference]) for q in p]
        order = sorted(range(len(far)), key=lambda i: -far[i])
        assert order[scene.facts["distance_rank"] - 1] == target
        others = [d for i, d in enumerate(far) if i not in (reference, target)]
        assert min(abs(d - far[target]) for d in others) >= gap - 1e-9
        assert min(math.dist(a, b) for a, b in itertools.combinations(p, 2)) >= least - 1e-9
        assert (np.ptp(p, axis=0) >= rules.extent[level - 1]).all()


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", ["Pick_Mugs_Distance", "Pick_Pill_Bottles_Distance"])
def test_only_the_reference_has_its_color(name: str, level: int) -> None:
    for scene in scenes(name, level):
        colors = [o.params["tint"] for o in scene.objects]
        assert colors.count(colors[index_of(scene, "reference")]) == 1


# Colours


@each_color
def test_every_object_has_a_color_of_its_own(name: str, level: int) -> None:
    found = scenes(name, level)
    for scene in found:
        words = [color_of(scene, i) for i in range(len(scene.objects))]
        assert len(set(words)) == len(words)
        assert words[index_of(scene)] == scene.facts["color"]
        assert "yellow" not in words or not name.endswith("_B")


def color_of(scene: Scene, index: int) -> str:
    item = scene.objects[index]
    if item.asset == "block":
        return object_sets.block_color(item)
    return "brown" if item.asset == "bread" else str(item.params["tint"])


def test_colors_are_far_apart() -> None:
    for a, b in itertools.combinations(COLORS, 2):
        assert math.dist(PALETTE[a], PALETTE[b]) > 0.15, (a, b)


@pytest.mark.parametrize("asset", TINTS)
def test_a_tint_changes_colors_only(asset: str) -> None:
    for look in range(look_count(asset)):
        plain = object_model(asset, {"look": look})
        tinted = object_model(asset, {"look": look, "tint": "purple"})
        assert (tinted.grasps, tinted.size, tinted.mass) == (plain.grasps, plain.size, plain.mass)
        assert [s.geometry for s in tinted.shapes] == [s.geometry for s in plain.shapes]
        body = [tinted.shapes[i] for i in TINTS[asset].body]
        assert all(s.visual and s.color == PALETTE["purple"] for s in body)
    with pytest.raises(ValueError, match="no colour 'plaid'"):
        object_model(asset, {"tint": "plaid"})


# What is said

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")


def rank_in(text: str) -> int:
    """The only ordinal of a text; 1 if there is none."""
    found = re.findall(rf"\b(\d)(?:st|nd|rd|th)\b|\b({'|'.join(ORDINALS)})\b", text.lower())
    ranks = {int(n) if n else ORDINALS.index(w) + 1 for n, w in found}
    assert len(ranks) <= 1, text
    return ranks.pop() if ranks else 1


@each_measure
@pytest.mark.parametrize("split", ["train", "heldout"])
def test_sentences_say_the_rank(name: str, level: int, split: str) -> None:
    word = name.rsplit("_", 1)[1].lower()
    known = {"height": "tall|high|short|height", "length": "left.*right", "area": "base|area|foot"}
    for scene in scenes(name, level)[:6]:
        for text in sentences(scene, split):
            # These compare all blocks and do not say which one is asked for.
            named = re.sub(r"from \w+( base)? to \w+( base)?,? and|\w+ first\b", "", text)
            last = level == 1 and re.search(r"\b(shorter|shortest|smaller|smallest)\b", named)
            assert (2 if last else rank_in(named)) == scene.facts[f"{word}_rank"], text
            assert re.search(known[word], text), text


@each_distance
@pytest.mark.parametrize("split", ["train", "heldout"])
def test_sentences_say_rank_and_reference(name: str, level: int, split: str) -> None:
    for scene in scenes(name, level)[:4]:
        reference = scene.objects[index_of(scene, "reference")]
        others = {o.asset for o in scene.objects} - {reference.asset}
        for text in sentences(scene, split):
            said = text.lower()
            rank = re.sub(r"identify .*? first;|farthest first", "", said)
            assert rank_in(rank) == scene.facts["distance_rank"], text
            if reference.asset == "block" or "tint" in reference.params:
                word = reference.params.get("tint") or object_sets.block_color(reference)
                assert re.search(rf"\b{word}\b", said), text
                words = [o.params.get("tint") or object_sets.block_color(o) for o in scene.objects]
                assert not any(re.search(rf"\b{w}\b", said) for w in words if w != word), text
            else:
                kinds = {"payment_sign": "sign", "cup": "cup|tumbler", "bread": BREAD}
                kinds["apple"] = "apple|fruit"
                assert re.search(kinds.get(reference.asset, reference.asset), said), text
                assert not any(re.search(rf"\b{kinds.get(o, o)}\b", said) for o in others), text


BREAD = "bread|bun|loaf|roll|baguette|pastry|croissant|toast|crescent"


@each_color
@pytest.mark.parametrize("split", ["train", "heldout"])
def test_sentences_say_the_color_and_no_other(name: str, level: int, split: str) -> None:
    for scene in scenes(name, level)[:4]:
        words = [color_of(scene, i) for i in range(len(scene.objects))]
        for text in sentences(scene, split):
            said = [w for w in words if re.search(rf"\b{w}\b", text, re.IGNORECASE)]
            assert said == [scene.facts["color"]], text
