"""What the expert solves with every robot: counted from runs, and the page that says it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from expert_table import COUNTS, PAGE, Variant, below, counted, merged, read, table, write
from fake_runs import make_run, shown

TEXT = PAGE.read_text("utf-8")


def test_runs_are_counted_kept_and_merged(tmp_path: Path) -> None:
    task, robot = "Pick_Blocks_Size", "aloha-agilex"
    first = [shown(task, 1, seed, seed > 7) for seed in (7, 8, 9)]
    make_run(tmp_path / "a", first)
    make_run(tmp_path / "b", [shown(task, 1, 7, True)])
    old = counted([tmp_path / "a"])
    assert old == [Variant(robot, task, 1, 2, 3, (7,))]
    new = counted([tmp_path / "a", tmp_path / "b"])  # of a trial in both the last counts
    assert new == [Variant(robot, task, 1, 3, 3)]
    other = Variant("ur5-wsg", task, 1, 20, 20)
    write(tmp_path / "counts.csv", [*old, other])
    assert merged(read(tmp_path / "counts.csv"), new) == [*new, other]


def test_a_row_adds_up_the_variants_of_a_category() -> None:
    rows = table([Variant("piper", "Pick_Blocks_Size", n, 19, 20) for n in (1, 2)])
    assert "38/40" in rows[2] and rows[2].endswith("| 38/40: 95.0 % |")


def test_every_variant_was_tried_with_twenty_seeds() -> None:
    variants = read(COUNTS)
    robots = {v.robot for v in variants}
    assert len({(v.robot, v.task, v.level) for v in variants}) == len(variants) == 280 * len(robots)
    assert all(v.tried == 20 and v.solved + len(v.failed) == v.tried for v in variants)


def test_the_page_has_the_table_that_the_counts_give() -> None:
    lines = TEXT.splitlines()
    assert [line for line in table(read(COUNTS)) if line not in lines] == []


def test_the_page_names_every_variant_of_which_the_expert_solves_too_little() -> None:
    named = {}
    for line in TEXT.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and re.fullmatch(r"(\d: \d+(, )?)+", cells[2]):
            levels = dict(re.findall(r"(\d): (\d+)", cells[2]))
            named[cells[0], cells[1]] = {int(n): int(solved) for n, solved in levels.items()}
    found = below(read(COUNTS))
    assert named == {k: {n: v.solved for n, v in levels.items()} for k, levels in found.items()}


@pytest.mark.parametrize(("solved", "short"), [(18, True), (19, False)])
def test_too_little_is_less_than_nineteen_of_twenty(solved: int, short: bool) -> None:
    assert bool(below([Variant("piper", "Pick_Blocks_Size", 1, solved, 20)])) == short
