"""Randomised scenes: parts, their names and streams, and what they leave alone."""

import json
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scene_checks import RULES, cluttered, unseen
from snapshots_by_hand import run
from teleport import Teleport

from robospa.geometry import Pose
from robospa.schema import read
from robospa.tasks import catalog
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.modes import canonical, clutter, for_training, tangible, with_table_raised
from robospa.tasks.modes.randomized import OFFICIAL, VARIATIONS
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene, SceneObject, Surroundings, Texture
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.tasks.task import Tracker
from robospa.trial import TrialKey
from robospa.workcell import WORKCELL

PLACE = ("Stack_Blocks_Size_Order", 3)


def scene_of(mode: str, seed: int = 7) -> Scene:
    return build_scene(*PLACE, seed, mode=mode)


@pytest.mark.parametrize(
    ("name", "spelling"),
    [
        ("clean", "clean"),
        ("randomized", "randomized"),
        ("randomized:texture,light=1,clutter=10,height=0.03", "randomized"),
        ("randomized:clutter,light", "randomized:light,clutter"),
        ("randomized-seen:camera=0.05,clutter=5", "randomized-seen:clutter=5,camera=0.05"),
    ],
)
def test_every_choice_of_parts_has_one_name(name: str, spelling: str) -> None:
    assert canonical(name) == canonical(spelling) == spelling == scene_of(name).mode
    assert read(TrialKey, {"task": "A", "level": 1, "seed": 0, "mode": spelling}, "key")


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("clean:light", "scene mode 'clean' has no parts to choose"),
        ("randomized:", "no part or axis ''"),
        ("randomized:lihgt", "did you mean light\\? there are height, texture, light"),
        ("randomized:light,light", "name a part twice"),
        ("randomized:clutter=2.5", "must be a whole number above 0 and at most 20, not '2.5'"),
        ("randomized:light=2", "above 0 and at most 1, not '2'"),
        ("randomized:height=-0.1", "above 0 and at most 0.05, not '-0.1'"),
        ("randomized:height=nan", "not 'nan'"),
    ],
)
def test_wrong_parts_are_refused_in_one_sentence(name: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        canonical(name)


def test_a_file_can_be_called_after_a_trial_in_any_mode() -> None:
    key = TrialKey(*PLACE, 7, "piper+franka-panda:0.6", "randomized:light=0.5,clutter")
    assert key.slug == (
        "Stack_Blocks_Size_Order-L3-7-piper-franka-panda-0.6-randomized-light-0.5-clutter-heldout"
    )


def test_the_task_is_the_same_in_both_modes() -> None:
    for seed in range(20):
        clean, varied = scene_of("clean", seed), scene_of("randomized", seed)
        assert clean.facts == varied.facts
        for a, b in zip(clean.objects, varied.objects, strict=True):
            assert (a.asset, a.params, a.pose.rotation) == (b.asset, b.params, b.pose.rotation)
            assert a.pose.position[:2] == b.pose.position[:2]
            assert b.pose.position[2] == pytest.approx(a.pose.position[2] + varied.table_rise)


def test_every_part_has_a_stream_of_its_own() -> None:
    """A part draws the same alone and among the others; no other part is touched."""
    whole, plain = scene_of("randomized"), scene_of("clean")
    alone = {name: scene_of(f"randomized:{name}") for name in VARIATIONS}
    for name, scene in alone.items():
        full = whole.surroundings if VARIATIONS[name].official else scene.surroundings
        none = plain.surroundings
        there = scene.surroundings
        textured = full if name == "texture" else none
        table = Texture("white", 0) if name == "white-table" else textured.table
        assert (there.wall, there.table) == (textured.wall, table)
        assert there.lights == (full if name == "light" else none).lights
        assert (there.camera_shift != none.camera_shift) == (name == "camera")
        assert (scene.wrist_shifts != plain.wrist_shifts) == (name == "wrist-camera")
        assert scene.table_rise == (whole.table_rise if name == "height" else 0.0)
        assert bool(scene.clutter) == (name in ("clutter", "look-alikes"))
        assert scene.strengths == {name: VARIATIONS[name].usual}
    assert whole.surroundings.camera_shift == (0.0, 0.0, 0.0)
    assert whole.strengths == OFFICIAL


def test_strengths_are_what_they_say() -> None:
    for seed in range(30):
        scene = scene_of("randomized:height=0.01,light=0.1,clutter=2,camera=0.05", seed)
        assert -0.01 <= scene.table_rise <= 0.0 and len(scene.clutter) <= 2
        assert sum(v * v for v in scene.surroundings.camera_shift) <= 0.05**2
        assert all(abs(c - 0.5) <= 0.05 for c in scene.surroundings.lights.sun)


@pytest.mark.parametrize("name", ["Pick_Blocks_Size", "Pick_Mugs_Distance", "Basic_Ordinal_Cups"])
def test_displaced_things_move_together_out_of_their_area_to_where_scenes_may_have_them(
    name: str,
) -> None:
    moved = outside = 0
    for seed in range(100_000, 100_008):
        clean, there = (
            build_scene(name, 3, seed, mode=m) for m in ("clean", "randomized:displaced")
        )
        ways = [np.subtract(b.pose.position, a.pose.position)
                for a, b in zip(clean.objects, there.objects, strict=True)]  # fmt: skip
        assert np.ptp(ways, axis=0).max() < 1e-9
        assert not [text for rule in RULES.values() for text in rule(there)]
        moved += np.linalg.norm(ways[0]) == pytest.approx(0.05)
        at = there.object(there.facts["target"]).pose.position[:2]
        usual = [o.pose.position[:2] for n in range(90, 130)
                 for o in build_scene(name, 3, n).objects]  # fmt: skip
        outside += bool((at < np.min(usual, axis=0)).any() or (at > np.max(usual, axis=0)).any())
    assert moved >= 7 and outside >= 3


def test_training_takes_seen_textures_and_nothing_else_is_different() -> None:
    for seed in range(20):
        new, old = scene_of("randomized", seed), scene_of("randomized-seen", seed)
        assert new.clutter == old.clutter and new.table_rise == old.table_rise
        assert new.surroundings.lights == old.surroundings.lights
        for a, b in ((new.surroundings.wall, old.surroundings.wall),
                     (new.surroundings.table, old.surroundings.table)):  # fmt: skip
            assert (a is None) == (b is None)
            assert a is None or b is None or (a.split, b.split) == ("unseen", "seen")


@pytest.mark.parametrize(
    ("name", "bodies"),
    [
        ("clean", "clean"),
        ("randomized", "randomized"),
        ("randomized-seen", "randomized"),
        ("randomized-seen:light,texture,camera", "clean"),
        ("randomized:light,clutter=4", "randomized:clutter=4"),
        ("randomized:clutter,height", "randomized"),
    ],
)
def test_modes_with_the_same_bodies_share_one_name(name: str, bodies: str) -> None:
    assert tangible(name) == bodies
    one, other = scene_of(name), scene_of(bodies)
    assert one.everything == other.everything and one.table_rise == other.table_rise


def test_what_is_recorded_for_training_has_seen_textures() -> None:
    assert for_training("randomized:clutter,texture") == "randomized-seen:texture,clutter"
    for name in ("clean", "randomized-seen"):
        assert for_training(name) == name


def test_scenes_survive_json_and_clean_ones_say_nothing_of_it() -> None:
    scene = scene_of("randomized:height,texture,light,clutter,camera,wrist-camera")
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    added = {"clutter", "surroundings", "strengths", "wrist_shifts"}
    assert not added & set(scene_of("clean").to_json())


def test_a_texture_that_no_split_has_is_refused() -> None:
    with pytest.raises(ValueError, match="no texture 1000 of the split 'unseen'; there are seen"):
        Texture("unseen", 1000)
    assert Surroundings().wall is None


FIRST_SEED = 300_000


@pytest.mark.parametrize("name", sorted(catalog.tasks()))
def test_randomised_scenes_keep_all_rules(name: str) -> None:
    for seed in range(FIRST_SEED, FIRST_SEED + 2):
        scene = catalog.build_scene(name, 1, seed, mode="randomized")
        broken = {rule: list(RULES[rule](scene)) for rule in RULES if rule != "pick"}
        assert not any(broken.values()), (seed, broken)


@pytest.fixture
def scene() -> Scene:
    return catalog.build_scene("Pick_Blocks_Size", 3, FIRST_SEED, mode="randomized")


def moved(scene: Scene, x: float, y: float, z: float | None = None) -> Scene:
    """The scene with its first piece of clutter elsewhere."""
    item = scene.clutter[0]
    old = item.pose
    there = replace(item, pose=Pose((x, y, old.position[2] if z is None else z), old.rotation))
    return replace(scene, clutter=(there, *scene.clutter[1:]))


def test_clutter_in_something_is_found(scene: Scene) -> None:
    for other in (scene.objects[0], scene.clutter[1]):
        x, y, _ = other.pose.position
        wrong = moved(scene, x + 0.01, y)
        assert any(f"is in {other.name}" in text or f"{other.name} (" in text
                   for text in cluttered(wrong))  # fmt: skip


def test_clutter_off_the_table_is_found(scene: Scene) -> None:
    x, y, z = scene.clutter[0].pose.position
    assert any("does not stand" in text for text in cluttered(moved(scene, x, y, z + 0.01)))
    assert any("over the table's edge" in text for text in cluttered(moved(scene, 0.6, y)))


def test_clutter_in_the_line_of_sight_is_found(scene: Scene) -> None:
    """A thing on the way from the camera to a block, half a block's breadth above the table."""
    target = scene.objects[0]
    ex, ey, _ = WORKCELL.head.position
    x, y, _ = target.pose.position
    size = target.params["half"][1]
    near = 0.12
    hiding = moved(scene, x + near * (ex - x), y + near * (ey - y) - size)
    tall = replace(hiding.clutter[0], asset="bottle", params={"look": 0})
    hiding = replace(hiding, clutter=(tall, *hiding.clutter[1:]))
    assert any(f"hides {target.name}" in text for text in cluttered(hiding))


def test_a_lower_table_may_move_things_to_the_edge_of_the_picture_and_no_farther() -> None:
    lowest = catalog.build_scene("Click_Bell_Clockwise_Order", 2, 10_000_011, mode="randomized")
    assert lowest.table_rise < -0.02
    assert not list(unseen(lowest))
    nearest = min(lowest.objects, key=lambda item: item.pose.position[1])
    x, y, z = nearest.pose.position
    out = replace(nearest, pose=Pose((x, y - 0.05, z), nearest.pose.rotation))
    assert list(unseen(replace(lowest, objects=(out,))))


RISES = (0.02, -0.03)
DISTURBED = 0.03
"""Heights are off by up to so much [m]."""


class Watched(Teleport):
    """Keeps what its goal is shown."""

    def __init__(self, scene: Scene, tracker: Tracker) -> None:
        self.seen: list[Snapshot] = []
        super().__init__(scene, tracker)

    def snapshot(self, contacts: Iterable[Contact] = ()) -> Snapshot:
        self.seen.append(super().snapshot(contacts))
        return self.seen[-1]


def up(by: float) -> Pose:
    """What lifts a pose or a point."""
    return Pose((0.0, 0.0, by))


def raised(snapshot: Snapshot, by: float) -> Snapshot:
    """The same, higher: grippers too."""
    left, right = snapshot.end_effector
    a, b = snapshot.grasp_points
    return replace(
        snapshot,
        poses={n: up(by) * p for n, p in snapshot.poses.items()},
        end_effector=(up(by) * left, up(by) * right),
        grasp_points=(up(by).apply(a), up(by).apply(b)),
        contacts=tuple(replace(c, point=up(by).apply(c.point)) for c in snapshot.contacts),
    )


def disturbed(snapshot: Snapshot, rng: np.random.Generator) -> Snapshot:
    """Everything that may move a little higher or lower, with its gripper or not."""
    poses = {
        name: up(float(rng.uniform(-DISTURBED, DISTURBED))) * pose
        for name, pose in snapshot.poses.items()
    }
    return replace(snapshot, poses=poses)


@pytest.mark.parametrize("name", sorted(tasks()))
def test_goals_say_the_same_on_a_raised_table(name: str) -> None:
    """Single-target tasks have one goal for all levels."""
    rng, task = np.random.default_rng(0), tasks()[name]
    for level in (1, 2, 3, 4, 5) if task.dimension == "procedural" else (1,):
        flat = build_scene(name, level, 3)
        trial = Watched(flat, task.goal(flat))
        trial.run(task.plan(flat))
        seen = trial.seen
        if level % 2:
            seen = [seen[0], *(disturbed(s, rng) for s in seen[1:])]
        rise = RISES[level % len(RISES)]
        scene = with_table_raised(flat, rise)
        higher = [raised(s, rise) for s in seen]
        assert run(task.goal(scene), higher) == run(task.goal(flat), seen), level


# ------------------ clutter lies where it is in no one's way, and is nothing that a task could mean


NAMES = sorted(tasks())


@cache
def scene_of_clutter(name: str, seed: int, level: int = 1) -> Scene:
    return build_scene(name, level, seed, mode="randomized:height,clutter")


def radius(item: SceneObject) -> float:
    return object_model(item.asset, item.params).radius


@pytest.mark.parametrize("name", NAMES)
def test_nothing_on_the_table_can_be_taken_for_an_object_of_the_task(name: str) -> None:
    for level in (1, 5) if tasks()[name].dimension == "procedural" else (1,):
        scene = scene_of_clutter(name, 1, level)
        there = {item.asset for item in scene.objects}
        found = {item.asset for item in scene.clutter}
        assert not found & (there | clutter.FURNITURE)
        assert not any(group & there and group & found for group in clutter.LOOK_ALIKES)
        assert len(clutter.candidates(scene)) >= 10  # fewer where many kinds are mixed


def test_where_colours_are_asked_for_no_clutter_has_them() -> None:
    asked = 0
    for name in (
        "Basic_Color_Mixed_Objects_A",
        "Hit_Blocks_Hammer_Order",
        "Stack_Blocks_Color_Order",
    ):
        for seed in range(5):
            scene = scene_of_clutter(name, seed)
            colors = clutter.colors_asked(scene)
            asked += len(colors)
            for item in scene.clutter:
                phrases = object_model(item.asset, item.params).phrases
                assert not clutter.color_words(" ".join(phrases)) & colors
    assert asked > 15
    assert not clutter.colors_asked(scene_of_clutter("Pick_Cups_Canonical", 1))
