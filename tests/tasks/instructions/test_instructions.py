"""Every instruction means one thing only, and the right one; splits share no sentence.

A sentence is read back without the phrasing tables: its template tells where the slots are, and a
few regular expressions tell what they mean. What comes out must be what the scene drew, and, for
the spatial tasks, must single out the target from where the objects lie.
"""

import itertools
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robospa.tasks import catalog
from robospa.tasks.instructions import SPLITS, TaskText, masked_words, similarity
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import ANY_KIND, instruction, kinds_clause, sentences, templates

SLOW = {"pick_mixed_objects_distance_b", "pick_mixed_objects_multi_view_a"}

KIND = {
    "CPI": "pick_mixed_objects_canonical_a",
    "SOI": "pick_mixed_objects_canonical_a",
    "RRR": "pick_soaps_relational",
    "CVR": "pick_mixed_objects_multi_view_a",
    "EPG": "pick_mixed_objects_multi_view_a",
}
"""Categories all of whose tasks say the same things, and the task that stands for each."""

each_task = pytest.mark.parametrize("name", [name.lower() for name in catalog.tasks()])
each_split = pytest.mark.parametrize("split", SPLITS)


def kind(name: str) -> str:
    """The task that says the same things as `name`."""
    return KIND.get(catalog.task(name).category, name)


@cache
def scene_of(name: str, level: int, seed: int = 100000) -> Scene:
    return catalog.build_scene(name, level, seed)


@cache
def sentences_of(name: str, level: int, split: str, seed: int = 100000) -> tuple[str, ...]:
    return sentences(scene_of(name, level, seed), split)


# Reading a sentence back

NUMBER = {w: i for i, w in enumerate(("zero", "one", "two", "three", "four", "five"))}
WORDS = ("first", "second", "third", "fourth", "fifth", "sixth")
COLORS = ("red", "green", "blue", "yellow", "purple", "cyan", "magenta", "orange", "white", "black")


def slots_read(template: str, text: str) -> dict[str, str]:
    """What stands in a sentence where its template has slots."""
    seen: set[str] = set()
    pattern = ""
    for part in re.split(r"(\{\w+\})", template):
        slot = part[1:-1]
        if not part.startswith("{"):
            pattern += re.escape(part)
        elif slot in seen:
            pattern += f"(?P={slot})"
        else:
            seen.add(slot)
            pattern += f"(?P<{slot}>.+?)"
    found = re.fullmatch(pattern, text, re.IGNORECASE)
    assert found, (template, text)
    return {slot: value.lower() for slot, value in found.groupdict().items()}


def ordinal_in(text: str, otherwise: int = 0) -> int:
    """The first ordinal of a text."""
    found = re.search(rf"\b(\d)(?:st|nd|rd|th)\b|\b({'|'.join(WORDS)})\b", text)
    if not found:
        assert otherwise, text
        return otherwise
    return int(found[1]) if found[1] else WORDS.index(found[2]) + 1


def colors_in(text: str) -> list[str]:
    return re.findall(rf"\b({'|'.join(COLORS)})\b", text)


def read_size(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    rank = len(scene.objects) if "smaller" in said["block"] else ordinal_in(said["block"], 1)
    return {"size_rank": rank}


def read_distance(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    kinds = {"tea": "tea", "sauce|pesto|gravy": "sauce", "bowl": "bowl", "car|toycar": "car",
             "fan": "fan", "tissues?": "tissue", "fries": "fries"}  # fmt: skip
    (kind,) = [k for word, k in kinds.items() if re.search(rf"\b({word})\b", said["reference"])]
    (name,) = [o.name for o in scene.objects if kind in o.asset]
    return {"distance_rank": ordinal_in(said["rank"], 1), "reference": name}


OPPOSITE = {"left": "right", "right": "left", "near": "far", "far": "near"}


def counted(text: str) -> str:
    """A counting direction, which names both ends of the line or the one where it starts."""
    ends = re.findall("left|right|near|far", text)
    return "_to_".join(ends if len(ends) == 2 else [ends[0], OPPOSITE[ends[0]]])


def read_canonical(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    assert "robot" in said["viewer"]
    facts: dict[str, Any] = {
        "column": ordinal_in(said["column"]),
        "column_direction": counted(said["column_direction"]),
    }
    if scene.level > 1:
        facts |= {"row": ordinal_in(said["row"]), "row_direction": counted(said["row_direction"])}
    return facts


def read_relational(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    assert re.search(r"front\b.*\bfar\b.*\bback\b.*\bnear\b|far\b.*front.*near\b.*back",
                     said["convention"])  # fmt: skip
    relation, reference = f"{said['relation']} {said['reference']}".split(" of the ", 1)
    side = re.findall(r"(?:front|back)-(?:left|right)|left|right|front|back", relation)
    place = re.findall(r"front|middle|back|left|right|center", reference)
    near = re.search("directly|immediately", relation)
    assert bool(near) == (scene.level >= (4 if "-" in side[0] else 2)), relation
    return {"relation": side[0].replace("-", "_"), "reference_label": "_".join(place)}


def read_view(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    side = re.findall("left|right|front|back", said["target"])
    meaning = {"front": "farthest from the viewer", "back": "nearest to the viewer"}
    assert meaning.get(side[0], "") in said["target"]
    who = re.findall(r"left|right|opposite|facing|faces|far side", said["view"])
    viewer = {"left": "left", "right": "right"}.get(who[0], "opposite") if who else "robot"
    return {"position": f"{side[0]}most", "viewpoint": viewer}


def read_press(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    text = said.get("times") or said.get("presses") or "once"
    text = text.replace("twice", "2").replace("once", "1").replace("single", "1")
    found = re.search(rf"\d|\b({'|'.join(NUMBER)})\b", text)
    assert found, said
    return {"count": NUMBER.get(found[0]) or int(found[0])}


def read_stack(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    if "block" in said:
        return {"colors": colors_in(said["block"])[:1]}
    if "order" in said:
        return {"colors": colors_in(said["order"])}
    pairs = re.findall(r"(\w+) (?:on top of|on|onto|over|above) (\w+)\b", " ".join(said.values()))
    pairs = [(a, b) for a, b in pairs if a in COLORS and b in COLORS]
    assert pairs, said
    assert [above for above, _ in pairs[:-1]] == [below for _, below in pairs[1:]], said
    return {"colors": [pairs[0][1], *(above for above, _ in pairs)]}


def read_memory(said: Mapping[str, str], scene: Scene) -> dict[str, Any]:
    assert re.search(r"from the robot.*13 cm (behind|past|beyond) its block", said["where"])
    return {"colors": colors_in(said.get("order") or f"{said['block']} {said['where']}")}


READERS: dict[str, Callable[[Mapping[str, str], Scene], dict[str, Any]]] = {
    "pick_blocks_size": read_size,
    "pick_mixed_objects_distance_b": read_distance,
    "pick_mixed_objects_canonical_a": read_canonical,
    "pick_soaps_relational": read_relational,
    "pick_mixed_objects_multi_view_a": read_view,
    "press_stapler_repeat": read_press,
    "stack_blocks_color_order": read_stack,
    "remember_color_cover": read_memory,
}


def read(scene: Scene, split: str, index: int) -> dict[str, Any]:
    """The facts that sentence `index` of a split states."""
    name = scene.task.lower()
    which = templates(name, scene.level)[SPLITS.index(split)]
    texts = sentences_of(name, scene.level, split, scene.seed)
    template = which[index // (len(texts) // len(which))]
    return READERS[kind(name)](slots_read(template, texts[index]), scene)


READABLE = [name.lower() for name in catalog.tasks() if kind(name.lower()) in READERS]


@pytest.mark.parametrize("name", READABLE)
def test_sentences_say_what_the_scene_drew(name: str) -> None:
    seeds = range(8 if name in READERS and name not in SLOW else 2)
    for level, seed in itertools.product(catalog.LEVELS, seeds):
        scene = scene_of(name, level, 100000 + seed)
        for split in SPLITS:
            for index in range(seed, 100, 7):
                said = read(scene, split, index)
                assert said == {key: scene.facts[key] for key in said}, (level, split, seed, index)


@each_split
@pytest.mark.parametrize("level", [1, 2, 3, 4, 5])
def test_dustbin_sentences_count_the_bottles(level: int, split: str) -> None:
    for text in sentences_of("put_bottles_dustbin", level, split):
        counts = {1: r"\bbottle\b", 2: r"\b(both|two|pair)\b"}
        wanted = counts.get(level) or rf"\b({level}|{list(NUMBER)[level]})\b"
        assert re.search(wanted, text.lower()) and "left" in text, text


@pytest.mark.parametrize("level", [1, 2, 3, 4, 5])
def test_click_templates_name_the_steps_in_order(level: int) -> None:
    steps = [["can"], ["bread", "basket"], ["can"], ["bottle", "pad"], ["can"]][:level]
    wanted = [slot for step in steps for slot in step]
    for template in itertools.chain(*templates("click_can_place_items", level)):
        found = [s for s in re.findall(r"\{(\w+)\}", template) if s not in ("arm", "table")]
        if template.startswith("it all ends with"):
            found = found[len(steps[-1]) :] + found[: len(steps[-1])]
        assert found == wanted, template


# What else could have been asked


def alternatives(scene: Scene) -> list[Scene]:
    """The same objects with every other thing that could have been asked of them."""
    facts, count = dict(scene.facts), len(scene.objects)
    name, level = kind(scene.task.lower()), scene.level
    other: list[dict[str, Any]] = []
    if name == "pick_blocks_size":
        other = [{"size_rank": k} for k in range(1, count + 1)]
    elif name == "pick_mixed_objects_distance_b":
        other = [{"distance_rank": k, "reference": o.name}
                 for k in range(1, count) for o in scene.objects]  # fmt: skip
    elif name == "pick_mixed_objects_canonical_a":
        rows: list[dict[str, Any]] = [{}]
        if level > 1:
            rows = [{"row": r, "row_direction": d} for r in (1, 2)
                    for d in ("near_to_far", "far_to_near")]  # fmt: skip
        other = [{"column": c, "column_direction": d, **row} for c in (1, 2, 3)
                 for d in ("left_to_right", "right_to_left") for row in rows]  # fmt: skip
    elif name == "pick_soaps_relational":
        sides = ("left", "right", "front", "back", "front_left", "back_right")
        labels = ("front_left", "front_right", "back_left", "back_right", "center", "front_middle")
        other = [{"relation": s, "reference_label": p} for s in sides for p in labels]
    elif name == "pick_mixed_objects_multi_view_a":
        other = [{"position": f"{p}most", "viewpoint": v}
                 for p in ("left", "right", "front", "back")
                 for v in ("robot", "opposite", "left", "right")]  # fmt: skip
    elif name == "press_stapler_repeat" and level > 1:
        other = [{"count": k} for k in range(2, 6)]
    elif name == "remember_color_cover":
        colors = list(facts["colors"])
        orders = {tuple(np.roll(colors, k)) for k in range(len(colors))} | {tuple(colors[::-1])}
        other = [{"colors": [str(c) for c in order]} for order in sorted(orders)]
    return [replace(scene, facts={**facts, **change}) for change in other]


@each_task
def test_sentences_for_different_targets_never_coincide(name: str) -> None:
    for level in catalog.LEVELS if name in READERS else (5,):
        scenes = alternatives(scene_of(name, level))
        for split in SPLITS:
            said = [text for scene in scenes for text in sentences(scene, split)]
            assert len(set(said)) == len(said), level


# ---------------------------------------- splits share nothing, and which sentence a trial gets


VARIANTS = [(name.lower(), level) for name in catalog.tasks() for level in catalog.LEVELS]
NEAR = 0.75
"""Two templates this alike (slots masked) count as near-equal; see `grammar.similarity`."""

SETS = {templates(name, level): (name, level) for name, level in reversed(VARIANTS)}
"""Every distinct set of templates, and the first variant that has it."""

each_set = pytest.mark.parametrize(("name", "level"), sorted(SETS.values()))


@each_set
def test_no_heldout_template_is_near_a_train_one(name: str, level: int) -> None:
    made = templates(name, level)
    near = [(a, b) for a in made.train for b in made.heldout if similarity(a, b) >= NEAR]
    assert near == []


def test_no_opening_of_other_templates_occurs_in_training() -> None:
    def openings(split: int) -> set[tuple[str, ...]]:
        return {masked_words(t)[:3] for n, k in VARIANTS for t in templates(n, k)[split]}

    assert openings(0) & (openings(1) | openings(2)) == set()


@each_task
def test_sentences_of_two_splits_share_nothing(name: str) -> None:
    for level in catalog.LEVELS:
        made = [{s.lower() for s in sentences_of(name, level, split)} for split in SPLITS]
        assert len(set().union(*made)) == sum(map(len, made)), level


@each_split
def test_instruction_is_one_of_the_sentences_and_ignores_the_robot(split: str) -> None:
    scene = scene_of("press_stapler_repeat", 3)
    assert instruction(scene, split) in sentences(scene, split)
    assert instruction(replace(scene, embodiment="franka"), split) == instruction(scene, split)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(KeyError, match="no task"):
        templates("Pick_Nothing", 1)
    with pytest.raises(ValueError, match="no level 6"):
        templates("press_stapler_repeat", 6)
    with pytest.raises(ValueError, match="no instruction split 'unseen'"):
        instruction(scene_of("press_stapler_repeat", 1), "unseen")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("levels = [", "is no TOML file"),
        ("", "templates lack 'levels'"),
        ("levels = [1]", "templates lack 'train'"),
        ("levels = [1]\ntrain = ['a', 'b', 'c']", "level 1: 3 templates cannot share"),
        ("levels = [2]", "no templates '' for level 1"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_name(
    line: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "mine.toml").write_text(f"[phrasings.block]\ntrain = ['x']\n[[templates]]\n{line}")
    text = TaskText(tmp_path / "mine.toml")
    with pytest.raises((KeyError, ValueError), match=rf"mine\.toml.*{said}"):
        text.templates(1)
    if "TOML" not in said:
        with pytest.raises(KeyError, match=r"mine\.toml has no 'heldout' of the phrasings 'block'"):
            text.phrasings("block")


def clean_and_cluttered(name: str) -> list[Scene]:
    return [catalog.build_scene(name, 2, 3, mode=mode) for mode in ("clean", "randomized")]


SINGLE = [name for name, task in catalog.tasks().items() if task.dimension != "procedural"]


@each_split
def test_a_sentence_that_fits_any_thing_ends_in_the_kinds_that_count(split: str) -> None:
    for name in SINGLE[::4]:
        clean, cluttered = clean_and_cluttered(name)
        clause = f" {kinds_clause(cluttered)}"
        for said, here in zip(sentences(clean, split), sentences(cluttered, split), strict=True):
            assert here in (said, said + clause)
            assert here.endswith(clause) or not ANY_KIND.search(said)


def test_sequences_of_actions_are_told_in_the_same_words() -> None:
    for name in set(catalog.tasks()) - set(SINGLE):
        clean, cluttered = clean_and_cluttered(name)
        assert sentences(clean, "train") == sentences(cluttered, "train")


@pytest.mark.parametrize(
    ("task", "clause"),
    [
        ("Pick_Mugs_Distance", "Only the mugs count."),
        ("Pick_Tea_Box_Relational", "Only the tea boxes count."),
        ("Pick_Breads_Multi_View", "Only the loaves of bread count."),
    ],
)
def test_the_clause_names_all_kinds(task: str, clause: str) -> None:
    assert kinds_clause(catalog.build_scene(task, 3, 3)) == clause
    mixed = catalog.build_scene("Pick_Mixed_Objects_Distance_A", 1, 3)
    said = kinds_clause(mixed)
    assert said.count("the ") == len(mixed.objects) and said.startswith("Only the ")
