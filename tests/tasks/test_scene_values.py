"""Facts of a scene: typed in the task, plain JSON in the scene."""

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.geometry import Pose, axis_rotation
from robospa.harness.robots import embodiment
from robospa.observation import FEATURES, NAMES, SLOTS, WIDTH
from robospa.tasks import seeds as lists
from robospa.tasks.catalog import LEVELS, build_scene, tasks
from robospa.tasks.colors import NAMED, difference, lab, nearest, stands_out
from robospa.tasks.environment_state import EnvironmentState, TooManyObjects, kind_code
from robospa.tasks.events import Event, outcome
from robospa.tasks.families.table import drawn_color
from robospa.tasks.objects import assets
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, ListKey, NoSeedList, accepted, list_hash
from robospa.tasks.sentences import SPLITS, instruction, sentences
from robospa.tasks.snapshot import Contact, Snapshot, snapshot_from_json, snapshot_to_json
from robospa.tasks.task import SceneFacts
from robospa.workcell import grasp_points


@dataclass(frozen=True)
class Facts(SceneFacts):
    order: tuple[str, ...]
    color: str | None
    bell: str = ""
    count: int = 0


def scene_with(facts: SceneFacts) -> Scene:
    return Scene("Any", 1, 0, "robot", "clean", (), json.loads(json.dumps(facts.to_json())))


@pytest.mark.parametrize(
    ("facts", "plain"),
    [
        (Facts(("a", "b"), "red", "c", 2),
         {"order": ["a", "b"], "color": "red", "bell": "c", "count": 2}),
        (Facts((), None), {"order": [], "color": None}),
    ],
)  # fmt: skip
def test_facts_are_plain_in_the_scene_and_come_back(facts: Facts, plain: dict[str, object]) -> None:
    assert facts.to_json() == plain
    assert Facts.of(scene_with(facts)) == facts


def test_numbers_of_numpy_are_numbers_of_a_scene() -> None:
    one, other = (
        replace(scene_with(Facts((), None)), objects=(SceneObject("a", "block", Pose((x, 0, 0))),))
        for x in (np.float64(0.25), 0.25)
    )
    assert one.digest == other.digest and one.to_json() == other.to_json()
    assert type(one.to_json()["objects"][0]["pose"]["position"][0]) is float


def test_a_base_reads_its_own_fields_only() -> None:
    @dataclass(frozen=True)
    class Ordered(SceneFacts):
        order: tuple[str, ...]

    assert Ordered.of(scene_with(Facts(("a",), "red"))) == Ordered(("a",))


GRIPPERS = embodiment("aloha-agilex").grippers
ENDS = (Pose(), Pose((1.0, 2.0, 3.0)))
SNAPSHOT = Snapshot(
    time=1.25,
    poses={"one": Pose((0.1, 0.2, 0.3), (0.6, 0.0, 0.8, 0.0))},
    gripper=(0.0, 1.0),
    end_effector=ENDS,
    grasp_points=grasp_points(GRIPPERS, ENDS),
    joints=((0.1, 0.2), (0.3, 0.4)),
    measured=((0.11, 0.21), (0.31, 0.41)),
)


def test_a_snapshot_comes_back_from_json() -> None:
    told = json.loads(json.dumps(snapshot_to_json(SNAPSHOT)))
    assert told["poses"]["one"] == [0.1, 0.2, 0.3, 0.6, 0.0, 0.8, 0.0]
    assert snapshot_from_json(told, GRIPPERS) == SNAPSHOT


def test_contacts_stay_with_goals() -> None:
    touching = replace(SNAPSHOT, contacts=(Contact("a", "b", (0,) * 3),))
    assert "contacts" not in snapshot_to_json(touching)


def test_heights_of_several_objects_name_those_that_do_not_exist_yet() -> None:
    assert SNAPSHOT.heights(("one", "later")) == [0.3, None]
    assert SNAPSHOT.position("one") == (0.1, 0.2, 0.3)


SALT, OTHER = "ab" * 32, "cd" * 32
PLACES = [("Pick_Blocks_Size", 3), ("Stack_Blocks_Size_Order", 5), ("Press_Stapler_Repeat", 2)]


@pytest.mark.parametrize(("task", "level"), PLACES)
def test_every_salt_has_its_own_scenes(task: str, level: int) -> None:
    public, hidden = build_scene(task, level, 100000), build_scene(task, level, 100000, salt=SALT)
    other = build_scene(task, level, 100000, salt=OTHER)
    assert hidden == build_scene(task, level, 100000, salt=SALT)
    assert public == build_scene(task, level, 100000, salt="")
    assert len({public.digest, hidden.digest, other.digest}) == 3
    assert SALT not in json.dumps(hidden.to_json())


@pytest.mark.parametrize("split", SPLITS)
def test_the_sentence_is_drawn_with_the_salt(split: str) -> None:
    """The same scene, so that only the draw of the sentence can differ."""
    scene = build_scene("Pick_Blocks_Size", 3, 100000)
    assert sentences(scene, split, SALT) == sentences(scene, split, SALT)
    assert sentences(scene, split, SALT) != sentences(scene, split)
    chosen = {instruction(scene, split, salt) for salt in ("", SALT, OTHER, "ef" * 32)}
    assert len(chosen) > 1


def test_the_parts_of_a_mode_are_drawn_with_the_salt(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []

    def varied(scene, part):  # type: ignore[no-untyped-def]
        drawn.append(part("light").random())
        return scene

    monkeypatch.setattr("robospa.tasks.catalog.scene_mode", lambda name: varied)
    for salt in ("", SALT, OTHER, SALT):
        build_scene("Pick_Blocks_Size", 1, 100000, salt=salt)
    assert drawn[1] == drawn[3] and len(set(drawn)) == 3


@pytest.mark.parametrize(
    ("told", "total", "done", "best"),
    [
        (["done 0", "done 1", "undone 1", "undone 0", "done 0"], 3, 1, 2),
        (["done 0", "undone 0", "done 0"], 3, 1, 1),
        (["success"], 2, 2, 2),
        (["done 0", "failed"], 2, 1, 1),
    ],
)
def test_the_best_stays_and_a_subtask_counts_once(
    told: list[str], total: int, done: int, best: int
) -> None:
    """What is undone counts no more, and success is all."""
    events = []
    for time, text in enumerate(told):
        kind, _, index = text.partition(" ")
        events.append(
            Event(time, f"subtask_{kind}", "", int(index)) if index else Event(time, kind)
        )
    found = outcome(events, total)
    assert (found.done, found.best) == (done, best)
    assert (found.success, found.failed) == ("success" in told, "failed" in told)


# ----------------------------------------------- differences of colours, and colours that are drawn


SHARMA = (
    ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
    ((50.0, 3.1571, -77.2803), (50.0, 0.0, -82.7485), 2.8615),
    ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0000),
    ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0009), 7.1792),
    ((50.0, 2.4900, -0.0010), (50.0, -2.4900, 0.0011), 7.2195),
    ((50.0, -0.0010, 2.4900), (50.0, 0.0011, -2.4900), 4.7461),
    ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ((50.0, 2.5, 0.0), (56.0, -27.0, -3.0), 31.9030),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
)
"""Pairs of the test data published with the formula by Sharma, Wu and Dalal (2005)."""


@pytest.mark.parametrize(("a", "b", "expected"), SHARMA)
def test_published_pairs(a: tuple[float, ...], b: tuple[float, ...], expected: float) -> None:
    assert difference(np.array(a), np.array(b)) == pytest.approx(expected, abs=1e-4)
    assert difference(np.array(b), np.array(a)) == pytest.approx(expected, abs=1e-4)


def test_lab_of_srgb() -> None:
    np.testing.assert_allclose(lab(np.full(3, 255.0)), (100.0, 0.0, 0.0), atol=0.02)
    np.testing.assert_allclose(lab(np.array([255.0, 0, 0])), (53.24, 80.09, 67.20), atol=0.02)


def test_a_drawn_color_is_not_the_tables() -> None:
    rng = np.random.default_rng(3)
    drawn = [drawn_color(rng, 0.05, 0.95) for _ in range(200)]
    assert all(stands_out((r, g, b)) for r, g, b in drawn)
    assert all(0.05 <= c <= 0.95 for color in drawn for c in color)


def test_every_named_color_has_its_own_word() -> None:
    assert all(nearest(color) == word for word, color in NAMED.items())


# -------------------------------------------------------------- the shipped lists of accepted seeds


VARIANTS = [(name, level) for name in tasks() for level in LEVELS]


def test_every_variant_ships_its_seeds() -> None:
    for variant in VARIANTS:
        seeds = accepted(*variant)
        assert len(seeds) == PER_VARIANT, variant
        assert list(seeds) == sorted(set(seeds)), variant
        assert seeds[0] >= FIRST_SEED, variant


def test_the_expert_solves_nearly_every_seed() -> None:
    # the list holds the first accepted seeds: its span shows how many were refused
    refused = {v: accepted(*v)[-1] - FIRST_SEED for v in VARIANTS}
    assert [v for v, span in refused.items() if span >= PER_VARIANT / 0.98] == []


@pytest.mark.parametrize("seeds", [(5,), (5, 6, 9), tuple(range(100, 300, 3))])
def test_a_list_is_a_range_and_what_it_leaves_out(seeds: tuple[int, ...]) -> None:
    text = json.dumps({"processor": "some kind", "3": lists.shown(seeds)})
    assert lists.read_lists(text) == {3: seeds}


def test_a_variant_without_a_list_says_how_to_make_it() -> None:
    with pytest.raises(NoSeedList, match="`robospa seeds Pick_Blocks_Size --levels 6`"):
        accepted("Pick_Blocks_Size", 6)
    with pytest.raises(LookupError, match="--embodiment franka --mode randomized:clutter`"):
        accepted("pick blocks size", 1, "franka", "randomized-seen:clutter,light")


def test_lists_lie_in_a_folder_for_each_robot_and_mode() -> None:
    assert ListKey("T", 1).file == "aloha-agilex/clean/T.json"
    pair = ListKey("T", 1, "piper+franka:0.6", "randomized:light,clutter")
    assert pair.file == "piper-franka-0.6/randomized-light-clutter/T.json"


def test_the_hash_depends_on_robot_and_mode_not_on_the_order_of_lists() -> None:
    one, other = ListKey("A", 1), ListKey("B", 2)
    assert list_hash({one: [1], other: [2]}) == list_hash({other: (2,), one: (1,)})
    others = [{one: [2]}, {ListKey("A", 1, "r"): [1]}, {ListKey("A", 1, mode="m"): [1]}, {}]
    assert len({list_hash(lists) for lists in [{one: [1]}, *others]}) == 5


# ------------------------- the objects as numbers: measured, complete, and silent about their roles


HOME = (Pose(), Pose())


def scene(*objects: SceneObject) -> Scene:
    built = build_scene("Pick_Blocks_Size", 1, 1_000_000, "aloha-agilex", "clean")
    return replace(built, objects=objects)


def block(name: str, x: float, turn: float = 0.0, color: str = "red") -> SceneObject:
    params = {"half": [0.01, 0.02, 0.03], "color": list(NAMED[color])}
    return SceneObject(name, "block", Pose((x, 0.1, 0.8), axis_rotation((0, 0, 1), turn)), params)


def row(
    of: Scene, *, moved: float = 0.0, hinges: dict[str, float] | None = None
) -> NDArray[np.float32]:
    x_moved = (moved, 0.0, 0.0)
    poses = {
        item.name: Pose(tuple(np.add(item.pose.position, x_moved).tolist()), item.pose.rotation)  # type: ignore[arg-type]
        for item in of.objects
        if item.appears_at is None
    }
    seen = Snapshot(
        0.0, poses, (1.0, 1.0), HOME, grasp_points=((0, 0, 0), (0, 0, 0)), hinges=hinges or {}
    )
    return EnvironmentState(of).row(seen).reshape(SLOTS, len(FEATURES))


def value(slot: NDArray[np.float32], name: str) -> float:
    return float(slot[FEATURES.index(name)])


def test_a_slot_says_what_lies_where() -> None:
    slot = row(scene(block("a", -0.2, turn=math.pi / 6)), moved=0.05)[0]
    found = dict(zip(FEATURES, slot.tolist(), strict=True))
    assert (found["present"], found["hinge"]) == (1, 0)
    at = [found[name] for name in ("x", "y", "z", "half_x", "half_y", "half_z")]
    assert at == pytest.approx([-0.15, 0.1, 0.8, 0.01, 0.02, 0.03])
    assert (found["cos_yaw"], found["sin_yaw"]) == pytest.approx((math.sqrt(0.75), 0.5))
    assert (found["cos_2yaw"], found["sin_4yaw"]) == pytest.approx((0.5, math.sqrt(0.75)))
    assert [found["up_x"], found["up_y"], found["up_z"]] == pytest.approx([0, 0, 1], abs=1e-6)
    assert [found[c] for c in ("red", "green", "blue")] == pytest.approx(NAMED["red"])
    assert slot[-12:].tolist() == kind_code("block")


def test_slots_are_taken_from_left_to_right_whatever_the_names_and_kept() -> None:
    objects = (block("b", 0.1, color="blue"), block("a", 0.3), block("c", -0.3, color="green"))
    lying, moved = row(scene(*objects)), row(scene(*objects[::-1]), moved=0.5)
    assert [value(slot, "x") for slot in lying[:4]] == pytest.approx([-0.3, 0.1, 0.3, 0.0])
    assert [value(slot, "x") for slot in moved[:3]] == pytest.approx([0.2, 0.6, 0.8])
    assert not lying[3:].any()
    unchanged = [i for i, name in enumerate(FEATURES) if name != "x"]
    assert np.array_equal(lying[:, unchanged], moved[:, unchanged])


def test_what_does_not_exist_yet_is_not_there() -> None:
    later = replace(block("a", -0.3), appears_at=1.0)
    rows = row(scene(later, block("b", 0.2)))
    assert not rows[0].any() and value(rows[1], "present") == 1


def test_a_hinge_has_its_angle() -> None:
    door = SceneObject("m", "microwave", Pose((0.0, 0.1, 0.74)), {"look": 0})
    assert value(row(scene(door), hinges={"m": 0.7})[0], "hinge") == pytest.approx(0.7)


def test_every_asset_has_a_code_of_its_own() -> None:
    codes = {tuple(kind_code(asset)) for asset in assets()}
    assert len(codes) == len(assets())


def test_a_scene_with_too_many_objects_is_refused() -> None:
    many = [block(str(i), i / 100) for i in range(SLOTS + 1)]
    with pytest.raises(TooManyObjects, match="has 21 objects, and an environment state holds 20"):
        EnvironmentState(scene(*many))


def test_the_fullest_scenes_of_the_suite_fit_and_roles_do_not_show() -> None:
    assert WIDTH == len(NAMES) == len(set(NAMES))
    name = "Observe_Blocks_Move_Memory"
    assert name in tasks()
    built = build_scene(name, 5, 1_000_000, "aloha-agilex", "clean")
    shuffled = replace(built, objects=tuple(reversed(built.objects)))
    assert len(built.objects) <= SLOTS and np.array_equal(row(built), row(shuffled))
