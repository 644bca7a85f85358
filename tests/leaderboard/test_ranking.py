"""Which entries of the leaderboard are ranked against which: never the paper's against ours."""

import html
import itertools
import json
import math
from collections import Counter
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from site_fakes import many_entries

from robospa.leaderboard.agreement import (
    LEAST_POWER,
    LIE,
    Counts,
    agreement,
    cells,
    contradictions,
    power,
    trials_needed,
)
from robospa.leaderboard.entries import Entry, group, published_entries, ranks
from robospa.leaderboard.evidence import (
    announced,
    catch_probability,
    drawn,
    least_sample,
    sample_size,
    what_it_catches,
)
from robospa.leaderboard.site import index_page, model_data
from robospa.results.paper.origin import ORIGIN
from robospa.trial import SPATIAL, TrialKey

PAPER = "paper, aloha-agilex, clean, paper"


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    """The four published models and 6 made-up ones of robospa-1."""
    return many_entries(6)


def measured_in(entry: Entry, **parts: tuple[str, ...]) -> Entry:
    results = entry.column.results
    changed = replace(results, setting=replace(results.setting, **parts))
    return replace(entry, column=replace(entry.column, results=changed))


def test_who_was_not_reproduced_on_hidden_scenes_is_a_claim(entries: list[Entry]) -> None:
    entry = replace(entries[5], cells=())
    assert group(entry) and not model_data(entry)["ranks"]


def test_the_page_is_given_groups_and_who_is_ranked(entries: list[Entry]) -> None:
    """The page's script ranks by these two fields and by nothing else."""
    made = [model_data(entry) for entry in (*entries[:5], measured_in(entries[5], split=()))]
    assert [(one["group"], bool(one["ranks"])) for one in made] == [
        *[(PAPER, False)] * 4,
        ("robospa-1, aloha-agilex, clean, heldout", True),
        ("", False),
    ]


def test_the_page_shows_one_part_for_each_group_the_papers_last(entries: list[Entry]) -> None:
    page = index_page(entries)
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert [one["key"] for one in data["groups"]] == [
        "robospa-1, aloha-agilex, clean, heldout",
        "robospa-1, aloha-agilex, randomised, heldout",
        PAPER,
    ]
    assert [bool(one["note"]) for one in data["groups"]] == [False, False, True]
    assert {model["group"] for model in data["models"]} == {one["key"] for one in data["groups"]}
    assert data["groups"][-1]["title"].startswith("Numbers printed in the paper")
    assert "other object meshes, another renderer" in data["apart"]["paper"]
    assert ORIGIN in html.unescape(page)


@pytest.mark.parametrize("part", ["suite", "embodiment", "mode", "split"])
def test_what_is_not_stated_equals_nothing(part: str) -> None:
    entry = measured_in(published_entries()[0], **{part: ()})
    assert group(entry) is None
    assert not ranks(entry)


def test_skills_are_ranked_among_themselves_and_paired_with_no_joints(entries: list[Entry]) -> None:
    first, second = (entry for entry in entries[4:7:2])
    skills = measured_in(second, track=("skills",))
    assert group(first) == group(second) != group(skills) and ranks(skills)
    shown = [model_data(one)["group"] for one in (first, skills)]
    assert shown[1] == f"{shown[0]}, skills"
    found = group(skills)
    assert found and found.title.startswith("Track of skills, robospa-1")


def test_nobody_is_ranked_in_a_suite_that_still_changes(entries: list[Entry]) -> None:
    draft = measured_in(entries[-1], suite=("robospa-3-draft",))
    found = group(draft)
    assert not ranks(draft)
    assert found is not None and "draft" in found.note


# ---------------------------------------------- samples that nobody can choose, and what they catch


KEYS = [TrialKey(task, level, s) for task in ("A", "B") for level in (1, 2) for s in range(10)]


@pytest.mark.parametrize(
    ("trials", "least"), [(1, 1), (19, 19), (40, 39), (100, 74), (2000, 131), (28_000, 135)]
)
def test_no_sample_misses_five_percent_more_than_once_in_a_thousand(
    trials: int, least: int
) -> None:
    """Against the hypergeometric distribution, by whole numbers."""
    forged = max(1, trials // 20)

    def missed(count: int) -> Fraction:
        return Fraction(math.comb(trials - forged, count), math.comb(trials, count))

    assert least_sample(trials) == least
    assert missed(least) <= Fraction(1, 1000) < missed(least - 1)


def test_more_may_be_asked_for_and_never_less() -> None:
    assert sample_size(0.01, 2000) == 131
    assert sample_size(1e-9, 2000) == 131
    assert sample_size(0.1, 2000) == 200
    assert sample_size(1, 2000) == 2000
    assert sample_size(0.01, 4) == 4


def test_what_a_sample_catches_is_said() -> None:
    assert what_it_catches(2000, 131).endswith("99.9 % for 5 %, 93.5 % for 2 %, 74.4 % for 1 %.")


def test_catch_probability_by_hand() -> None:
    assert catch_probability(10, 1, 1) == pytest.approx(0.1)
    assert catch_probability(4, 2, 2) == pytest.approx(1 - 1 / 6)
    assert catch_probability(10, 5, 6) == 1.0


def test_a_sample_follows_from_challenge_and_bundle() -> None:
    one = drawn("0123456789", "bundle", KEYS, 10)
    assert one == drawn("0123456789", "bundle", KEYS[::-1], 10)
    assert one != drawn("0123456780", "bundle", KEYS, 10)
    assert one != drawn("0123456789", "another", KEYS, 10)
    assert len(set(one)) == 10


def test_every_trial_is_as_likely_as_another() -> None:
    seen: Counter[TrialKey] = Counter()
    for n in range(500):
        seen.update(drawn(f"challenge {n}", "bundle", KEYS, 10))
    assert len(seen) == len(KEYS)
    assert min(seen.values()) > 90 and max(seen.values()) < 165


def test_videos_of_all_models_are_of_the_same_scenes() -> None:
    other = [replace(key, embodiment="other", mode="other", split="train") for key in KEYS]
    found = announced("robospa-1", other)
    assert [(k.variant, k.seed) for k in found] == [
        (k.variant, k.seed) for k in announced("robospa-1", KEYS)
    ]


# -------------------------------------------------- the exact test, by hand and against enumeration


def test_it_agrees_with_scipy() -> None:
    from scipy.stats import fisher_exact

    for claimed, fresh in ((60, 1), (60, 6), (5, 4), (0, 0)):
        found = agreement([Counts(claimed, 100, fresh, 10)])
        table = [[fresh, 10 - fresh], [claimed, 100 - claimed]]
        assert found.lower == pytest.approx(fisher_exact(table, "less")[1])
        assert found.upper == pytest.approx(fisher_exact(table, "greater")[1])


def test_several_variants_are_all_their_permutations() -> None:
    """Every way of calling two of a variant's trials fresh, for two variants at once."""
    first, second = [1, 1, 1, 0, 0], [1, 0, 0, 0]
    sums = [
        sum(a) + sum(b)
        for a in itertools.combinations(first, 2)
        for b in itertools.combinations(second, 2)
    ]
    found = agreement([Counts(3, 3, 0, 2), Counts(0, 2, 1, 2)])
    assert found.lower == pytest.approx(np.mean(np.array(sums) <= 1))
    assert found.upper == pytest.approx(np.mean(np.array(sums) >= 1))


CATEGORY = {f"Task_{n}": "GAC" if n < 28 else "MIP" for n in range(56)}


def test_honest_claims_are_rarely_contradicted_and_a_lie_about_one_variant_always() -> None:
    random = np.random.default_rng(5)
    refused = noticed = 0
    for _ in range(30):
        rates = random.uniform(0, 0.9, 280).tolist()
        drawn = [
            Counts(int(random.binomial(100, r)), 100, int(random.binomial(7, r)), 7) for r in rates
        ]
        claim = {f"Task_{n // 5}/{n % 5 + 1}": c for n, c in enumerate(drawn)}
        refused += bool(contradictions({"sr": claim}, CATEGORY, 0.01))
        lie = {**claim, "Task_7/3": Counts(100, 100, 0, 7)}
        noticed += "sr of Task_7/3" in contradictions({"sr": lie, "sr1": claim}, CATEGORY, 0.01)
    assert refused <= 2 and noticed == 30


def test_cells_are_the_values_of_a_table() -> None:
    variants = [f"Do_{category}/{level}" for category in (*SPATIAL, "MIP") for level in (2, 3)]
    found = cells(variants, {v[:6]: v[3:6] for v in variants})
    assert found["spatial/2"] == tuple(f"Do_{category}/2" for category in SPATIAL)
    assert found["GAC/0"] == found["Do_GAC/0"] == ("Do_GAC/2", "Do_GAC/3")
    assert found["MIP/2"] == ("Do_MIP/2",) and "MIP/4" not in found
    assert not {"procedural/0", "overall/0"} & found.keys(), "means of what was not run"


def test_a_block_is_planned_so_that_a_lie_of_five_points_shows() -> None:
    claims = [Counts(40, 100, 0, 0)] * 40 + [Counts(90, 100, 0, 0)] * 40
    needed = trials_needed(claims, 0.01)
    assert needed is not None
    made = [replace(c, fresh_trials=needed) for c in claims]
    assert power(made, LIE, 0.01) >= LEAST_POWER
    fewer = [replace(c, fresh_trials=needed // 2) for c in claims]
    assert power(fewer, LIE, 0.01) < LEAST_POWER
