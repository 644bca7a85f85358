"""The shipped lists of accepted seeds."""

from __future__ import annotations

import pytest

from robospa.tasks.catalog import LEVELS, tasks
from robospa.tasks.seeds import FIRST_SEED, PER_VARIANT, accepted, seed_list_hash

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


def test_a_variant_without_a_list_says_how_to_make_it() -> None:
    with pytest.raises(LookupError, match="robospa seeds"):
        accepted("Pick_Blocks_Size", 6)


def test_the_hash_depends_on_the_variants_not_on_their_order() -> None:
    one, other = ("Pick_Blocks_Size", 1), ("Press_Stapler_Repeat", 2)
    assert seed_list_hash([one, other]) == seed_list_hash([other, one])
    assert seed_list_hash([one]) != seed_list_hash([one, other])
