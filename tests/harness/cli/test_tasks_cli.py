"""`robospa tasks` and the pictures that it makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import typer
from numpy.typing import NDArray
from typer.testing import CliRunner, Result

from robospa.harness.cli import tasks as commands
from robospa.harness.cli.tasks import describe_skill, per_level, tasks
from robospa.harness.pictures import gallery
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import tasks as all_tasks
from robospa.tasks.plan import Home, Pick, Place, Wait
from robospa.tasks.scene import Scene

NAME = "Pick_Blocks_Size"


def run(*arguments: str) -> Result:
    app = typer.Typer()
    app.command()(tasks)
    return CliRunner().invoke(app, list(arguments), env={"COLUMNS": "160", "TERM": "dumb"})


def cell(level: int) -> tuple[str, NDArray[np.uint8]]:
    return "Pick up the red cube. " * 20, np.full((240, 320, 3), 40 * level, np.uint8)


def test_without_a_name_every_task_is_listed() -> None:
    done = run()
    assert done.exit_code == 0
    assert [name for name in all_tasks() if name not in done.output] == []


def test_a_scene_is_described_with_both_instructions() -> None:
    done = run(NAME, "--level", "3", "--seed", "100003", "--no-frame")
    scene = build_scene(NAME, 3, 100003)
    assert done.exit_code == 0
    for wanted in ("instruction (train)", "instruction (heldout)", "1. Pick", scene.digest):
        assert wanted in done.output
    assert all(item.name in done.output for item in scene.objects)


def test_a_split_shows_only_its_instruction() -> None:
    done = run(NAME, "--split", "train", "--no-frame")
    assert "instruction (train)" in done.output
    assert "instruction (heldout)" not in done.output


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("Pick_Block_Size",), "did you mean Pick_Blocks_Size"),
        ((NAME, "--level", "6"), "has levels"),
        ((NAME, "--seed", "-1"), "is not from 0 to"),
        ((NAME, "--split", "test"), "there are train, heldout, indirect"),
        ((NAME, "--size", "640"), "is not WIDTHxHEIGHT"),
        ((NAME, "--size", "640x9999"), "is not between"),
        ((NAME, "--camera", "rear"), "no camera"),
    ],
)
def test_a_bad_argument_is_refused_in_one_sentence(arguments: tuple[str, ...], said: str) -> None:
    done = run(*arguments)
    plain = " ".join(done.output.replace("│", " ").split())
    assert done.exit_code == 2
    assert said in plain


@pytest.mark.parametrize(
    ("values", "text"),
    [([150] * 5, "150"), ([2, 3, 4, 5, 6], "2..6"), ([3, 6, 8, 9, 12], "3 6 8 9 12"), ([7], "7")],
)
def test_the_values_of_all_levels_are_shown_briefly(values: list[int], text: str) -> None:
    assert per_level(values) == text


@pytest.mark.parametrize(
    ("skill", "text"),
    [
        (Pick("object_2"), "Pick object_2, lift 0.12"),
        (Wait(1.5), "Wait, seconds 1.5"),
        (Home(), "Home"),
        (
            Place("object_0", (0.1, 0.0, 0.74)),
            "Place object_0, position (0.1, 0, 0.74), drop 0.003, retreat 0.08",
        ),
    ],
)
def test_a_skill_is_shown_with_what_is_set(skill: object, text: str) -> None:
    assert describe_skill(skill) == text


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
    done = run(NAME, "--size", "160x120", "--out", str(path))
    assert done.exit_code == 0, done.output
    with Image.open(path) as found:
        assert found.size == (160, 120)
        assert np.asarray(found).std() > 5  # something is in the picture


@pytest.mark.sim
def test_the_gallery_of_one_task_has_all_its_levels(tmp_path: Path) -> None:
    path = tmp_path / "sheet.jpg"
    done = run(NAME, "--gallery", "--out", str(path))
    assert done.exit_code == 0, done.output
    assert "5 variants in" in done.output and path.stat().st_size < 1_000_000


def test_a_gallery_of_what_does_not_exist_is_refused_at_once(tmp_path: Path) -> None:
    done = run("Pick_Blocks_Size,Pick_Nothing", "--gallery", "--out", str(tmp_path / "sheet.jpg"))
    assert done.exit_code == 2 and "Pick_Nothing" in done.output
    assert list(tmp_path.iterdir()) == []


def test_a_settled_scene_skips_seeds_that_do_not_rest() -> None:
    class Restless:
        seen: list[int]

        def __init__(self) -> None:
            self.seen = []

        def load(self, scene: object, contacts: bool = False) -> None:
            from robospa.harness.world import SceneUnstable

            self.seen.append(scene.seed)  # type: ignore[attr-defined]
            if len(self.seen) < 3:
                raise SceneUnstable("it moves")

    world = Restless()
    scene = gallery.settled_scene(world, NAME, 1, 7)  # type: ignore[arg-type]
    assert world.seen == [7, 8, 9] and scene.seed == 9


def test_a_scene_of_the_official_world_is_described_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its quirks: what is told keeps the colours' words, what is drawn has pure ones."""
    drawn: list[Scene] = []
    monkeypatch.setattr(commands, "_draw", lambda console, scene, *rest: drawn.append(scene))
    world = "official?assets=builtin"
    done = run("Rank_Blocks_Color", "--world", world, "--split", "train")
    assert done.exit_code == 0 and "red" in done.output
    (scene,) = drawn
    assert scene.suite == "official-1-builtin"
    assert [1.0, 0.0, 0.0] in [item.params["color"] for item in scene.objects]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--world", "checkout:x"), "no pictures are made of the world"),
        (("--world", "official?speed=2"), "--world official?speed=2"),
        (("--world", "official", "--json"), "leave out --json and --view"),
    ],
)
def test_a_world_that_cannot_be_drawn_is_said(arguments: tuple[str, ...], said: str) -> None:
    done = run(NAME, *arguments)
    assert done.exit_code == 2 and said in done.output
