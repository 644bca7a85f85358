"""The page of all tasks: up to date with the catalog, and right in what it says of the levels."""

import dataclasses
import io
import re
from collections import Counter
from functools import partial
from pathlib import Path

import docs_films as made
import numpy as np
import pytest
import task_page
from expert_table import COUNTS, PAGE, Variant, below, counted, merged, read, table, write
from fake_runs import make_run, record, shown
from freeze_seeds import shipped
from PIL import Image
from task_rates import task_rates

from robospa.harness.robots import embodiments
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.scores import Scores, score
from robospa.tasks.catalog import tasks
from robospa.trial import REFERENCE

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_what_the_catalog_says() -> None:
    again = "run `python tools/task_page.py --text`"
    assert (ROOT / task_page.PAGE).read_text() == task_page.page(ROOT), again


def test_every_task_has_its_picture_and_they_are_small() -> None:
    folder = ROOT / task_page.PICTURES
    assert {p.name for p in folder.iterdir()} == {
        task_page.picture_name(task) for task in tasks().values()
    }
    assert sum(p.stat().st_size for p in folder.iterdir()) < 2_000_000


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([150] * 5, "150"),
        ([200, 400, 600, 800, 1000], "200 to 1000"),
        ([1, 2, 2, 3, 3], "1, 2, 2, 3, 3"),
    ],
)
def test_values_of_five_levels_in_words(values: list[int], text: str) -> None:
    assert task_page.per_level(values) == text


def test_a_row_says_the_limits_of_all_levels() -> None:
    can, bread = tasks()["Click_Can_Place_Items"], tasks()["Place_Bottle_Cup"]
    rates = {can.name: {"hold": "0/0/20", "other": "0/0/0"}}
    *_, heads, _, first, second = task_page.table([can, bread, can], rates)[:-1]
    assert heads.endswith("| hold |")
    assert first.endswith("| 0/0/20 |") and second.endswith("| - |")


def test_what_all_tasks_but_one_share_stands_above_the_table() -> None:
    presses, bells = tasks()["Press_Stapler_Memory"], tasks()["Click_Bell_Repeat"]
    line, *_ = task_page.table([presses, presses, bells], {})
    assert line.startswith("Levels: n, T 1 to 5; limit 200 to 1000. Click_Bell_Repeat: n 1")


# ---- the table of every task's rates holds several runs, and progress beside that of doing nothing


GIVEN = ({"time": 0.0, "kind": "subtask_done", "object": "a", "index": 0},)


def scores(*records: TrialRecord) -> Scores:
    return score([r.key for r in records], {r.key: r for r in records})


def test_a_row_a_task() -> None:
    put = record("Put_Bottles_Dustbin", 1, 0, 2, 4)
    pick = record("Pick_Blocks_Size", 1, 0, 1)
    first = scores(dataclasses.replace(put, events=GIVEN), pick)
    table = task_rates({"a": first, "b": scores(pick)})
    rows = {row.label: [cell.text for cell in row.cells] for row in table.rows if row.cells}
    assert rows == {
        "Pick_Blocks_Size": ["100", "100", "", "1", "100", "100", "", "1", ""],
        "Put_Bottles_Dustbin": ["0", "0", "50", "1", "", "", "", "", "25"],
    }


# ---------------------------------------------------------------- what a suite ships lists for


def test_the_lists_of_a_suite() -> None:
    keys = shipped()
    count = Counter((key.embodiment, key.mode) for key in keys)
    assert len(keys) == len(set(keys))
    assert count.pop((REFERENCE, "clean")) == 355
    assert count.pop((REFERENCE, "randomized")) == 280
    others = [robot for robot in embodiments() if robot != REFERENCE]
    assert count == {(r, m): n for r in others for m, n in (("clean", 280), ("randomized", 50))}


# --------- animated pictures of the documentation: what is shown, how long, and how large files get


def test_some_frames_are_kept_with_the_sentence_below() -> None:
    film = made.Animation(partial(made.captioned, sentence="Take the red block " * 5), made.EVERY)
    for level in range(4):
        film.add(np.full((720, 960, 3), 60 * level, np.uint8))
    assert len(film.frames) == 4 // made.EVERY
    pixels = np.asarray(film.frames[-1])
    shown, strip = np.split(pixels, [made.SIZE[1]])
    assert strip.shape == (made.STRIP, made.SIZE[0], 3)
    assert (shown == 60 * made.EVERY).all()
    assert (strip[:, :8] == made.DARK).all() and strip.max() > 200, "the sentence fits"


def test_frames_follow_each_other_at_ten_a_second_in_the_quality_that_fits() -> None:
    rng = np.random.default_rng(1)
    frames = [Image.fromarray(rng.integers(0, 256, (72, 96, 3), np.uint8)) for _ in range(3)]
    best = made.encode(frames, 10**9)
    film = Image.open(io.BytesIO(best))
    assert (film.n_frames, film.size, film.format) == (3, (96, 72), "WEBP")
    film.seek(1)
    film.load()
    assert film.info["duration"] == 100 and film.info["loop"] == 0
    assert len(made.encode(frames, len(best) - 1)) < len(best)


def test_the_first_page_shows_it_and_it_is_small() -> None:
    film = Path(__file__).resolve().parents[2] / "docs" / "images" / "trials.webp"
    assert film.stat().st_size <= made.MOST_BYTES


# ------------ what the expert solves with every robot: counted from runs, and the page that says it


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
