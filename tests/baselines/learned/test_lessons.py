"""Lessons and pictures: made from training seeds, kept in files, the same each time."""

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from robospa.baselines.learned import scenes, steps
from robospa.baselines.learned.scenes import SEEN_WIDTH, lesson
from robospa.tasks.catalog import build_scene
from robospa.tasks.seeds import FIRST_TRAINING_SEED, LAST_TRAINING_SEED
from robospa.tasks.sentences import sentences

STACK = build_scene("Stack_Blocks_Color_Order", 2, FIRST_TRAINING_SEED)
RANK, FAR = "Rank_Blocks_Color", build_scene("Pick_Mugs_Distance", 1, FIRST_TRAINING_SEED)


def test_a_scene_is_told_by_its_training_sentences() -> None:
    assert set(lesson(FAR).told) < set(sentences(FAR, "train"))


def test_a_target_far_from_a_reference_has_the_reference_as_label() -> None:
    target, refers = lesson(FAR).answers[0][0, [1, 5]]
    names = [o.name for o in FAR.objects]
    assert (names[int(target)], names[int(refers)]) == (FAR.facts["target"], FAR.facts["reference"])


def test_what_was_shown_and_is_hidden_is_the_label_of_what_looks_like_it() -> None:
    scene = build_scene("Observe_Objects_Click_Memory", 3, FIRST_TRAINING_SEED)
    made = lesson(scene)
    for rows, tokens in zip(made.answers[1:-1], made.tokens[1:-1], strict=True):
        target, shown = (tokens[int(i), SEEN_WIDTH:] for i in rows[0, [1, 5]])
        assert target[0] == shown[0] and target[2] < shown[2]


def test_what_may_be_moved_in_any_order_is_as_right() -> None:
    moved, stacked = (lesson(build_scene(n, 3, FIRST_TRAINING_SEED)) for n in (RANK, STACK.task))
    assert [len(set(rows[:, 1])) for rows in moved.answers] == [3, 2, 1, 1]
    assert [len(rows) for rows in stacked.answers] == [1] * 4


def test_scenes_are_of_training_seeds() -> None:
    for scene in islice(scenes.scenes(3), 4):
        assert FIRST_TRAINING_SEED <= scene.seed <= LAST_TRAINING_SEED


def test_what_cannot_be_seen_has_no_numbers() -> None:
    state = steps.labelled(build_scene("Observe_Blocks_Move_Memory", 1, FIRST_TRAINING_SEED))[1][0]
    tokens = scenes.tokens_of(state)
    for item, row in zip(state.objects, tokens, strict=True):
        assert row[:SEEN_WIDTH].any() == item.visible
    assert not all(item.visible for item in state.objects)


def test_clutter_is_seen_and_nothing_is_done_with_it() -> None:
    scene = build_scene("Remember_Color_Cover", 3, FIRST_TRAINING_SEED, mode="randomized-seen")
    made, plain = lesson(scene), lesson(replace(scene, clutter=()))
    for tokens, others, answers in zip(made.tokens, plain.tokens, made.answers, strict=True):
        assert len(tokens) > len(others) > answers[:, [1, 2]].max()
        np.testing.assert_array_equal(tokens[: len(others)], others)


def test_states_with_something_in_a_hand_are_not_drawn() -> None:
    pairs = steps.labelled(build_scene("Hang_Mug_Stack_Blocks", 1, FIRST_TRAINING_SEED))
    assert len(scenes.drawable(pairs)) < len(pairs)


@pytest.mark.sim
def test_a_picture_shows_each_object_where_it_is_said_to_be() -> None:
    shown = scenes.picture(STACK, steps.labelled(STACK)[0][0])
    assert shown.image.shape == (240, 320, 3) and len(shown.seen) == len(STACK.objects)
    empty = shown.image[5, 160].astype(int)
    for u, v in scenes.middle_pixel(shown.seen):
        assert np.abs(shown.image[int(v), int(u)].astype(int) - empty).max() > 20


@pytest.mark.sim
def test_pictures_made_once_are_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "variants", lambda: (("Stack_Blocks_Color_Order", 2),))
    said: list[str] = []
    (first,) = scenes.read(scenes.make(tmp_path, [0], said.append))
    (again,) = scenes.read(scenes.make(tmp_path, [0], said.append))
    assert len(said) == 1
    np.testing.assert_array_equal(first.image, again.image)
    np.testing.assert_array_equal(first.seen, again.seen)
