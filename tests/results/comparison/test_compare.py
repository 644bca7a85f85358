"""Comparisons of small runs that can be worked out by hand."""

from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import events, make_run, outcomes, record, write

from robospa.results.comparison.compare import Difference, RunComparison, by_axis, compare_results
from robospa.results.paper.columns import published_results, run_column
from robospa.results.paper.published import load
from robospa.results.paper.result_tables import summary_table
from robospa.results.records.runs import by_setting
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.run_card import score_table
from robospa.results.scoring.models import IncomparableError, ModelResults, results_of_run
from robospa.results.statistics.intervals import difference, paired_difference, wilson
from robospa.results.statistics.significance import boschloo, mcnemar_mid_p, p_of_interval
from robospa.trial import TrialKey

SIZE, MUGS, BOTTLES = "Pick_Blocks_Size", "Pick_Mugs_Distance", "Put_Bottles_Dustbin"


def side(folder: Path, records: list[TrialRecord], **more: object) -> ModelResults:
    return results_of_run(write(folder, records, **more))  # type: ignore[arg-type]


def group(found: RunComparison, label: str, level: int) -> Difference:
    return next(g for g in found.groups if (g.label, g.level) == (label, level))


def test_a_paired_variant_by_hand(tmp_path: Path) -> None:
    first = side(tmp_path / "a", outcomes(SIZE, 1, [1, 1, 1, 0, 0, 1]))
    second = side(tmp_path / "b", outcomes(SIZE, 1, [1, 0, 0, 0, 1, 0]))
    found = compare_results(first, second)
    (cell,) = found.cells
    assert found.paired
    assert (cell.only_first, cell.only_second, cell.trials) == (3, 1, 6)
    assert (cell.first, cell.second) == (pytest.approx(4 / 6), pytest.approx(2 / 6))
    by_hand = paired_difference(3, 1, 6)
    assert cell.estimate.value == pytest.approx(1 / 3)
    assert (cell.estimate.low, cell.estimate.high) == pytest.approx((by_hand.low, by_hand.high))
    assert cell.estimate.method == "Tango"
    assert cell.p == cell.q == mcnemar_mid_p(3, 1)
    assert compare_results(first, second) == found


def test_averages_weigh_categories_the_same_and_say_how_they_were_made(tmp_path: Path) -> None:
    one = outcomes(SIZE, 1, [1, 1]) + outcomes("Other", 1, [1, 0]) + outcomes(MUGS, 1, [1, 1])
    two = outcomes(SIZE, 1, [0, 0]) + outcomes("Other", 1, [1, 0]) + outcomes(MUGS, 1, [1, 1])
    found = compare_results(side(tmp_path / "a", one), side(tmp_path / "b", two))
    assert group(found, "GAC", 1).estimate.value == pytest.approx(0.5)
    assert group(found, "GAC", 1).p == mcnemar_mid_p(2, 0)
    assert group(found, "overall", 1).estimate.value == pytest.approx(0.25)
    assert group(found, "overall", 1).estimate.method == "MOVER on Tango"
    assert found.verdict.startswith("SR: ") and "on the same 6 trials" in found.verdict
    sides = side(tmp_path / "c", one), side(tmp_path / "d", two)
    again = compare_results(*sides, method="bootstrap")
    assert group(again, "overall", 1).estimate.method == "stratified bootstrap"
    assert group(again, "overall", 1).p == group(found, "overall", 1).p  # not from a point


def test_a_mean_that_ends_in_a_half_reads_alike_everywhere(tmp_path: Path) -> None:
    """11.25, which is 11.249999999999998 as a sum of fractions."""
    won = zip(load().members["GAC"], (0, 0, 2, 7), strict=True)
    made = [r for task, n in won for r in outcomes(task, 1, [1] * n + [0] * (20 - n))]
    run = write(tmp_path / "run", made)
    (own,) = (r for r in score_table(run, run.scores()).rows if r.label.startswith("GAC Geom"))
    table = summary_table([run_column(run)], "main", "sr", ("L1",))
    (paper,) = (r for r in table.rows if r.label.startswith("Geom"))
    found = compare_results(results_of_run(run), results_of_run(run))
    assert {own.cells[0].text, paper.cells[0].text, found.table().rows[0].cells[1].text} == {"11.3"}
    assert found.verdict.count("11.3") == 2


def test_runs_on_other_seeds_are_not_paired(tmp_path: Path) -> None:
    one = outcomes(SIZE, 1, [1, 1, 0])
    two = [replace(r, key=replace(r.key, seed=r.key.seed + 50)) for r in outcomes(SIZE, 1, [0, 0])]
    found = compare_results(a := side(tmp_path / "a", one), b := side(tmp_path / "b", two))
    (cell,) = found.cells
    assert not found.paired
    assert cell.only_first is None
    assert cell.estimate == difference(wilson(2, 3), wilson(0, 2))
    assert cell.p == boschloo(a.samples("sr")[SIZE, 1], b.samples("sr")[SIZE, 1])


def test_a_run_against_the_paper(tmp_path: Path) -> None:
    run = side(tmp_path / "a", outcomes(SIZE, 1, [1] * 9 + [0]))
    found = compare_results(run, published_results("RDT"))
    (cell,) = found.cells
    assert not found.paired
    assert (cell.first, cell.second) == (0.9, pytest.approx(0.03))
    assert cell.q < 0.001
    assert (group(found, "overall", 1).variants, group(found, "overall", 1).listed) == (1, 56)
    assert any("Only 1 of 280 variants" in note for note in found.notes)


def test_onta_is_the_difference_of_rates_on_its_own_scale(tmp_path: Path) -> None:
    one = side(tmp_path / "a", outcomes(SIZE, 1, [1, 1, 0, 0]))
    two = side(tmp_path / "b", outcomes(SIZE, 1, [0, 1, 0, 0]))
    (cell,) = compare_results(one, two, "onta").cells
    assert cell.estimate.value == pytest.approx(0.25 * 2)  # chance is one half
    assert (cell.first, cell.second) == (pytest.approx(0.0), pytest.approx(-0.5))


def test_first_choices_are_paired_like_successes(tmp_path: Path) -> None:
    took = events((1.0, "wrong_object", "other"))
    one = outcomes(SIZE, 1, [1, 1], events=took)
    one += [record(SIZE, 1, 2, 1), record(SIZE, 1, 3, 0)]
    sides = side(tmp_path / "a", one), side(tmp_path / "b", outcomes(SIZE, 1, [1, 0, 0, 0]))
    (cell,) = compare_results(*sides, "sr1").cells
    assert (cell.first, cell.second, cell.only_first, cell.only_second) == (0.25, 0.25, 1, 1)
    assert any("SR@1 +0.0" in note for note in compare_results(*sides).notes)
    with pytest.raises(IncomparableError, match="without the trials"):
        compare_results(sides[0], published_results("RDT"), "sr1")


def test_progress_compares_shares_of_subtasks(tmp_path: Path) -> None:
    one = [record(BOTTLES, 3, n, d, 3) for n, d in enumerate((3, 2, 1, 2))]
    two = [record(BOTTLES, 3, n, d, 3) for n, d in enumerate((3, 1, 1, 0))]
    found = compare_results(side(tmp_path / "a", one), side(tmp_path / "b", two), "ps")
    (cell,) = found.cells
    assert cell.estimate.value == pytest.approx((0 + 1 + 0 + 2) / 3 / 4)
    assert (cell.only_first, cell.only_second) == (2, 0)
    assert cell.estimate.method == "bootstrap"


def test_other_tasks_move_a_difference_more(tmp_path: Path) -> None:
    one = [*outcomes(SIZE, 1, [1] * 20), *outcomes("Other", 1, [1] * 2 + [0] * 18)]
    two = [*outcomes(SIZE, 1, [0] * 20), *outcomes("Other", 1, [1] * 2 + [0] * 18)]
    found = compare_results(side(tmp_path / "a", one), side(tmp_path / "b", two))
    row = group(found, "GAC", 1)
    assert row.over_tasks is not None
    assert (row.over_tasks.low, row.over_tasks.high) == pytest.approx((0.0, 1.0), abs=1e-6)
    assert row.estimate.low > 0.3
    unpaired = compare_results(published_results("RDT"), published_results("GO-1"))
    nothing = group(unpaired, "MIP", 5)
    assert nothing.over_tasks is not None  # all at 0: as wide as over seeds, never a point
    assert nothing.over_tasks.high == nothing.estimate.high > 0.01


def test_lost_trials_are_left_out_in_pairs_and_counted(tmp_path: Path) -> None:
    lost = record(SIZE, 1, 2, 0, end="infrastructure")
    one = side(tmp_path / "a", [*outcomes(SIZE, 1, [1, 1]), lost])
    two = side(tmp_path / "b", outcomes(SIZE, 1, [0, 1, 1]))
    found = compare_results(one, two)
    assert found.cells[0].trials == 2
    assert any("1 trial with a result on one side alone" in note for note in found.notes)


def test_a_category_of_unequal_variants_is_judged_by_its_interval(tmp_path: Path) -> None:
    """The first wins more pairs, and the second is ahead, because variants count the same."""
    one, two = outcomes(SIZE, 1, [1] * 12 + [0] * 88), outcomes(SIZE, 1, [0] * 100)
    one, two = one + outcomes("Other", 1, [0] * 4), two + outcomes("Other", 1, [1] * 4)
    found = compare_results(side(tmp_path / "a", one), side(tmp_path / "b", two))
    row = group(found, "GAC", 1)
    assert (row.only_first, row.only_second, round(row.estimate.value, 2)) == (12, 4, -0.44)
    assert row.p == p_of_interval(row.estimate) == group(found, "spatial", 1).p > 0.05


def test_seeds_that_only_one_side_has_are_counted_on_both(tmp_path: Path) -> None:
    made = outcomes(SIZE, 1, [1, 0] * 5)
    found = compare_results(side(tmp_path / "a", made[:6]), side(tmp_path / "b", made[3:]))
    assert found.cells[0].trials == 3
    assert any("7 trials with a result on one side alone" in note for note in found.notes)


def test_notes_tell_of_versions_and_of_policies_that_ignore_their_seed(tmp_path: Path) -> None:
    about = [{"versions": {"robospa": v}, "code": "x"} for v in ("1", "2")]
    blind = {"policy": {"spec": {"seeded": False}}}
    one = side(tmp_path / "a", outcomes(SIZE, 1, [1]), about=about[0], settings=blind)
    two = side(tmp_path / "b", outcomes(SIZE, 1, [1]), about=about[1])
    notes = " ".join(compare_results(one, two).notes)
    assert "different versions of robospa" in notes
    assert "a ignores the policy seed" in notes


ONE = record(SIZE, 1, 0, 1)


def at(**key: str) -> TrialRecord:
    """The same trial with another robot, mode or split."""
    return replace(ONE, key=TrialKey(SIZE, 1, 0, **key))


@pytest.mark.parametrize(
    ("first", "second", "metric", "message"),
    [
        ([ONE, at(embodiment="piper")], [ONE], "sr", "a mixes the embodiments aloha-agilex and pi"),
        ([ONE, at(mode="random")], [ONE], "sr", "a mixes the scene modes clean and random"),
        ([ONE, at(split="train")], [ONE], "sr", "a mixes the instruction splits heldout and train"),
        ([ONE], [at(embodiment="piper")], "sr", "a and b .* embodiments aloha-agilex and piper"),
        ([ONE], [replace(ONE, scene_digest="x")], "sr", f"0 of {SIZE} L1 is another scene in b"),
        ([ONE], [record(MUGS, 1, 0, 1)], "sr", "no variant in common"),
        ([ONE], [replace(ONE, end="infrastructure")], "sr", "holds no result yet"),
        ([ONE], [ONE, record(SIZE, 1, 1, 1, candidates=5)], "onta", "differ in their number of ca"),
    ],
)
def test_sides_that_cannot_be_compared_are_refused(
    tmp_path: Path, first: list[TrialRecord], second: list[TrialRecord], metric: str, message: str
) -> None:
    sides = side(tmp_path / "a", first), side(tmp_path / "b", second)
    with pytest.raises(IncomparableError, match=message):
        compare_results(*sides, metric)


def test_what_cannot_be_held_against_the_paper(tmp_path: Path) -> None:
    piper = side(tmp_path / "b", [at(embodiment="piper")])
    with pytest.raises(IncomparableError, match=r"b and RDT .* embodiments piper and aloha-agilex"):
        compare_results(piper, published_results("RDT"))
    with pytest.raises(ValueError, match="no published model is called 'pi9'; there are RDT"):
        published_results("pi9")
    with pytest.raises(IncomparableError, match="without the trials"):
        compare_results(published_results("RDT"), published_results("GO-1"), "ps")


def test_other_step_limits_are_refused_but_not_against_the_paper(tmp_path: Path) -> None:
    """Whether the printed X-VLA had tripled limits is not known."""
    plain = side(tmp_path / "a", outcomes(SIZE, 1, [1, 0]))
    tripled = replace(plain, setting=replace(plain.setting, step_scale=(3.0,)))
    with pytest.raises(IncomparableError, match="3 and 1 times the official step limits"):
        compare_results(tripled, plain)
    assert compare_results(tripled, published_results("X-VLA")).cells


def trials(mode: str, good: int) -> list[TrialRecord]:
    made = outcomes(SIZE, 1, [1] * good + [0] * (8 - good))
    return [replace(r, key=replace(r.key, mode=mode)) for r in made]


def test_a_run_of_two_scene_modes_has_no_scores_as_a_whole(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [*trials("clean", 6), *trials("randomized", 3)])
    for asked in (run.scores, run.comparable, run.grounding):
        with pytest.raises(IncomparableError, match="mixes the scene modes clean and randomized"):
            asked()
    assert run.table().rows[0].kind == "section"


@pytest.fixture
def sides(tmp_path: Path) -> list[ModelResults]:
    run = make_run(tmp_path / "run", [*trials("clean", 6), *trials("randomized", 3)])
    return [results_of_run(part, part.keys[0].mode) for part in by_setting(run)]


def test_modes_stand_side_by_side_with_their_paired_difference(sides: list[ModelResults]) -> None:
    table = by_axis(sides)
    assert table is not None
    assert table.heads == ("clean", "randomized", "randomized minus clean")
    assert table.title == "SR by scene modes" and "paired by seed" in table.notes[0]
    assert [row.label for row in table.rows] == ["GAC", "spatial", "overall"]
    for row in table.rows:
        clean, randomized, gap = row.cells
        assert (clean.value, randomized.value, gap.value) == (75.0, 37.5, -37.5)
        assert gap.low is not None and gap.high is not None and gap.low < -37.5 < gap.high
        assert gap.text.startswith("-37.5 [-")


def test_what_one_lost_is_left_out_of_all_its_columns(tmp_path: Path) -> None:
    """The variant that the third lacks counts nowhere."""
    records = [*trials("clean", 6), *trials("randomized", 3)[:6], *trials("randomized-seen", 0)]
    records += outcomes(MUGS, 1, [1]) + [
        replace(r, key=replace(r.key, mode="randomized")) for r in outcomes(MUGS, 1, [0])
    ]
    run = make_run(tmp_path / "run", records)
    table = by_axis([results_of_run(part, part.keys[0].mode) for part in by_setting(run)])
    assert table is not None and {row.label for row in table.rows} == {"GAC", "spatial", "overall"}
    for row in table.rows:
        assert [cell.value for cell in row.cells] == [100, 50, 0, -50, -100]
    assert "4 trials on seeds that not all have results of: left out" in table.notes[0]


def test_runs_of_one_setting_have_no_such_table(sides: list[ModelResults]) -> None:
    assert by_axis(sides[:1]) is None and by_axis([sides[0], sides[0]]) is None


@pytest.mark.parametrize(
    ("one", "two", "outcome", "says"),
    [
        ([1] * 20, [0] * 20, "better", "a is better"),
        ([0] * 20, [1] * 20, "worse", "a is worse"),
        ([1] * 20, [1] * 20, "underpowered", "underpowered: "),
        ([1] * 200, [1] * 200, "equal", "they are equal within 5 points"),
    ],
)
def test_a_comparison_ends_in_one_of_four_verdicts(
    tmp_path: Path, one: list[int], two: list[int], outcome: str, says: str
) -> None:
    sides = (side(tmp_path / n, outcomes(SIZE, 1, won)) for n, won in (("a", one), ("b", two)))
    found = compare_results(*sides)
    assert (found.outcome, says in found.verdict) == (outcome, True)
    assert found.needed > 20 or outcome != "underpowered"
    assert any("again and again" in note for note in found.notes)


def test_what_policies_declare_beside_their_weights_is_held_against_each_other(
    tmp_path: Path,
) -> None:
    def declared(name: str, *contract: str) -> ModelResults:
        settings = {"policy": {"spec": {"name": name, "contract": list(contract)}}}
        return side(tmp_path / name, outcomes(SIZE, 1, [1, 0]), settings=settings)

    one = declared("a", "dtype=bfloat16", "normalisation=1f", "pictures=224")
    two = declared("b", "dtype=float32", "normalisation=1f")
    (said,) = (n for n in compare_results(one, two).notes if "contracts" in n)
    assert "dtype (bfloat16, float32), pictures (224, not stated)." in said
    assert not any("contracts" in n for n in compare_results(one, one).notes)
