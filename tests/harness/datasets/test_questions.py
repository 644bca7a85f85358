"""Questions of pointing as a data set. Needs a Vulkan device."""

import io
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
from PIL import Image

from robospa.harness.datasets.questions import collect_questions
from robospa.harness.datasets.settings import Collection
from robospa.harness.settings import SettingsError
from robospa.tasks.catalog import build_scene

pytestmark = pytest.mark.sim


def test_questions_say_what_their_pictures_show_and_where(tmp_path: Path) -> None:
    settings = Collection("Pick_Blocks_Size", "5", 3, mode="randomized")
    said: list[str] = []
    assert collect_questions(settings, tmp_path, 1, said.append) == 4
    train = pandas.read_parquet(tmp_path / "data/train-Pick_Blocks_Size.parquet")
    test = pandas.read_parquet(tmp_path / "data/test-Pick_Blocks_Size.parquet")
    assert len(said) == 2 and train.seed.min() == 1_000_000 and list(test.seed) == [100_000]
    assert {*train["mode"]} == {"randomized-seen"} and {*test["mode"]} == {"randomized"}
    assert {*train.wording} == {"train"} and {*test.wording} == {"heldout"}
    for _, row in pandas.concat([train, test]).iterrows():
        mask = np.asarray(Image.open(io.BytesIO(row["mask"]["bytes"])))
        picture = Image.open(io.BytesIO(row["image"]["bytes"]))
        assert mask.dtype == bool and mask.shape == (240, 320) and picture.size == (320, 240)
        (u, v), (left, top, right, bottom) = row.point, row.box
        assert mask[int(v * 240), int(u * 320)] and mask[top:bottom, left:right].sum() == mask.sum()
        assert list(row.boxes[row.answer]) == [left, top, right, bottom]
        scene = build_scene(row.task, row.level, row.seed, mode=row["mode"])
        assert len(row.boxes) == len(scene.objects) == 6 and len(row.sentence) > 10
    card = (tmp_path / "README.md").read_text()
    assert "3 questions to train with and 1 to test with" in card
    assert "robospa collect --tasks Pick_Blocks_Size --levels 5 --episodes 3 --mode rand" in card
    before = (tmp_path / "data/test-Pick_Blocks_Size.parquet").read_bytes()
    said.clear()
    collect_questions(settings, tmp_path, 1, said.append)
    assert not said  # all of it is there
    for other in (replace(settings, episodes=4), Collection("Basic_Color_Blocks", "5", 3)):
        with pytest.raises(SettingsError, match="other settings or versions; choose another"):
            collect_questions(other, tmp_path, 1, said.append)
    shutil.rmtree(tmp_path / "data")
    collect_questions(settings, tmp_path, 2, said.append)
    assert (tmp_path / "data/test-Pick_Blocks_Size.parquet").read_bytes() == before


def test_questions_of_two_robots_have_ids_of_their_own(tmp_path: Path) -> None:
    settings = Collection("Pick_Blocks_Size", "1", 1, embodiment="aloha-agilex,piper")
    collect_questions(settings, tmp_path, 1, str)
    test = pandas.read_parquet(tmp_path / "data/test-Pick_Blocks_Size.parquet")
    assert list(test.embodiment) == ["aloha-agilex", "piper"]
    assert list(test.id) == [f"Pick_Blocks_Size-L1-100000-clean{robot}" for robot in ("", "-piper")]


def test_procedures_ask_for_more_than_a_point(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="Rank_Blocks_Color asks for more than a point"):
        collect_questions(Collection("Rank_Blocks_Color", "1", 1), tmp_path, 1, print)
