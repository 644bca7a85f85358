"""`robospa tasks` and the pictures that it makes."""

import inspect
import json
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from command_line import robospa
from numpy.typing import NDArray
from run_fakes import FakeWorld

from robospa.harness.cli import tasks as commands
from robospa.harness.cli.main import COMMANDS, command_of
from robospa.harness.cli.tasks import describe_skill
from robospa.harness.pictures import gallery
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.world import SceneUnstable
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.plan import Home, Pick, Place, Wait
from robospa.tasks.scene import Scene
from robospa.tasks.seeds import ListKey

NAME = "Pick_Blocks_Size"


def run(*words: object) -> str:
    done = robospa("tasks", *words)
    assert done.code == 0, done.err
    return done.out


def cell(level: int) -> tuple[str, NDArray[np.uint8]]:
    return "Pick up the red cube. " * 20, np.full((240, 320, 3), 40 * level, np.uint8)


def test_without_a_name_every_task_is_listed() -> None:
    listed = run()
    assert [name for name in tasks() if name not in listed] == []


def test_the_tasks_of_a_category_are_listed() -> None:
    assert [row["category"] for row in json.loads(run("gac,CBG", "--json"))] == ["GAC"] * 4 + [
        "CBG"
    ] * 5
    assert "Stack_Blocks" not in run("spatial") and "no task 'GAX'" in robospa("tasks", "GAX").err
    assert "--view needs a task" in robospa("tasks", "GAC", "--view").err


def test_a_scene_is_described_with_both_instructions() -> None:
    shown = run(NAME, "--level", "3", "--seed", "100003", "--no-frame")
    scene = build_scene(NAME, 3, 100003)
    for wanted in ("instruction (train)", "instruction (heldout)", "1. Pick", scene.digest):
        assert wanted in shown
    assert all(item.name in shown for item in scene.objects)


def test_a_skill_is_shown_with_what_is_set() -> None:
    skills = (Pick("object_2"), Wait(1.5), Home(), Place("object_0", (0.1, 0.0, 0.74)))
    assert list(map(describe_skill, skills)) == [
        "Pick object_2, lift 0.12",
        "Wait, seconds 1.5",
        "Home",
        "Place object_0, position (0.1, 0, 0.74), drop 0.003, retreat 0.08",
    ]


def test_the_sheet_has_a_row_a_task_and_a_column_a_level() -> None:
    rows = [
        gallery.GalleryRow("First", "GAC", (cell(1), cell(2))),
        gallery.GalleryRow("Second", "RPF", (cell(5),)),
    ]
    page = gallery.sheet(rows, "title")
    left, top = gallery.MARGIN, gallery.TITLE + gallery.HEADER
    step = gallery.HEADER + gallery.CELL[1] + gallery.CAPTION + gallery.GAP
    pixels = [(left, top), (left + gallery.CELL[0] + gallery.GAP, top), (left, top + step)]
    assert [page.getpixel(at) for at in pixels] == [(40,) * 3, (80,) * 3, (200,) * 3]
    assert gallery.wrapped("one two " * 9, 50) == "one two\none two\none two\none …"


@pytest.mark.sim
def test_the_first_frame_is_rendered_at_the_wanted_size(tmp_path: Path) -> None:
    from PIL import Image

    path = tmp_path / "frame.png"
    run(NAME, "--size", "160x120", "--out", path)
    with Image.open(path) as found:
        assert found.size == (160, 120)
        assert np.asarray(found).std() > 5  # something is in the picture


@pytest.mark.sim
def test_the_gallery_of_one_task_has_all_its_levels(tmp_path: Path) -> None:
    path = tmp_path / "sheet.jpg"
    assert "5 variants in" in run(NAME, "--gallery", "--out", path)
    assert path.stat().st_size < 1_000_000


def test_a_settled_scene_skips_seeds_that_do_not_rest() -> None:
    seen: list[int] = []

    class Restless(FakeWorld):
        def load(self, scene: Scene, contacts: bool = False) -> None:
            seen.append(scene.seed)
            if len(seen) < 3:
                raise SceneUnstable("it moves")

    scene = gallery.settled_scene(Restless(), NAME, 1, 7)
    assert seen == [7, 8, 9] and scene.seed == 9


def test_a_scene_of_the_official_world_is_described_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its quirks: what is told keeps the colours' words, what is drawn has pure ones."""
    drawn: list[Scene] = []
    monkeypatch.setattr(commands, "_draw", lambda console, scene, *rest: drawn.append(scene))
    world = "official?assets=builtin"
    assert "red" in run("Rank_Blocks_Color", "--world", world, "--split", "train")
    (scene,) = drawn
    assert scene.suite == "official-1-builtin"
    assert [1.0, 0.0, 0.0] in [item.params["color"] for item in scene.objects]


# ------------------------------- every number on a command line has bounds, and a refusal says them


CHECKED_LATER = ("level", "fraction")  # where it is known what there is


def functions() -> Iterator[tuple[str, Callable[..., object]]]:
    """Every command of the command line, by name."""
    for name in COMMANDS:
        found = command_of(name)
        if isinstance(found, typer.Typer):
            for each in found.registered_commands:
                assert each.callback is not None
                yield f"{name} {each.callback.__name__}", each.callback
        else:
            yield name, found


def numbers() -> Iterator[tuple[str, typing.Any]]:
    """Every numeric flag that is no setting of an evaluation, and what it was made with."""
    for command, function in functions():
        kinds = typing.get_type_hints(function)
        hints = typing.get_type_hints(function, include_extras=True)
        for name in inspect.signature(inspect.unwrap(function)).parameters:
            kind = kinds.get(name)
            if {int, float} & {kind, *typing.get_args(kind)} and name not in CHECKED_LATER:
                yield f"{command} --{name}", hints[name].__metadata__[-1]


NUMBERS = dict(numbers())


@pytest.mark.parametrize("name", NUMBERS)
def test_no_flag_takes_every_number(name: str) -> None:
    made = NUMBERS[name]
    if made.callback is None:
        assert made.min is not None, name
        return
    for value in (float("nan"), float("inf"), -(10**9), 10**20):
        with pytest.raises(typer.BadParameter, match="is not from"):
            made.callback(value)
    assert made.callback(1) == 1


# -------------------------------------------- `robospa seeds` from the command line: what it prints


def test_the_lists_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    key = ListKey("Pick_Blocks_Size", 2)
    refused = Attempt(100_001, False, reason="does not settle: block_0 moves")
    found = SimpleNamespace(
        key=key,
        accepted=[100_000, 100_002],
        refused=[refused],
        given_up=False,
        row=lambda: [100_000, refused, 100_002],
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("robospa.harness.seeds.attempt.sweep_with_bar", lambda *_: [found])
    words = ("seeds", key.task, "--levels", "2", "--count", "2", "--check", "--json")
    done = robospa(*words)
    (row,) = json.loads(done.out)
    assert done.code == 0 and (row["task"], row["level"]) == (key.task, 2)
    assert row["accepted"] == [100_000, 100_002]
    assert row["refused"] == [{"seed": 100_001, "reason": refused.reason}]
    plain = robospa(*words[:-1]).out
    assert "2 of 3 seeds accepted" in plain and "seed 100001: does not settle" in plain
