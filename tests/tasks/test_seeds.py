"""The shipped lists of accepted seeds."""

from __future__ import annotations

import json

import pytest

from robospa.tasks import seeds as lists
from robospa.tasks.catalog import LEVELS, tasks
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, ListKey, NoSeedList, accepted, list_hash

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
