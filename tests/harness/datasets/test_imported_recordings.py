"""Official recordings become data sets with what they have, marked as such, and nothing more."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from command_line import robospa
from PIL import Image

from robospa.action_space import SIX_JOINT_ARMS, ActionSpace
from robospa.harness.convention_check.episodes import Episode, read_episode, to_jpeg, write_episode
from robospa.harness.datasets.imports import ABSENT, import_recordings
from robospa.harness.datasets.manifest import DatasetError, file_hash, read_lines, read_record
from robospa.harness.datasets.pack import FORMATS
from robospa.harness.datasets.verify import RECORDINGS, verify
from robospa.harness.official.recordings import find_recordings
from robospa.harness.settings import SettingsError

pytest.importorskip("h5py", reason="recordings need h5py: pip install 'robospa[demos]'")

FRAMES = 4


def recording(folder: Path, number: int, **about: Any) -> Path:
    """An episode as official ones are: JPEGs of 16 x 12 pixels, neither measured joints nor key."""
    rng = np.random.default_rng(number)
    picture = np.full((12, 16, 3), (200, 30, 10), np.uint8)
    episode = Episode(
        f"episode{number}.hdf5",
        rng.normal(size=(FRAMES + number, 14)),
        rng.normal(size=(FRAMES + number, 2, 8)),
        {"head": [to_jpeg(picture)] * (FRAMES + number)},
        ActionSpace("joint", SIX_JOINT_ARMS),
        about=about,
    )
    path = folder / "data" / episode.name
    path.parent.mkdir(parents=True, exist_ok=True)
    write_episode(path, episode)
    sentences = folder / "instructions" / f"episode{number}.json"
    sentences.parent.mkdir(exist_ok=True)
    said = {"seen": [f"take it {number}", "take it", "take it"], "unseen": ["grab it"]}
    sentences.write_text(json.dumps(said))
    return path


@pytest.fixture
def official(tmp_path: Path) -> Path:
    """Two recordings with seeds; one without, of no task, of ours, without sentences each."""
    home = tmp_path / "official"
    folder = home / "Pick_Seals_Multi_View_3" / "demo_clean_aloha"
    for number in (0, 1):
        recording(folder, number)
    (folder / "seed.txt").write_text("7 12")
    recording(home / "Press_Stapler_Repeat_1" / "demo_clean_aloha", 0)
    recording(home / "My_Own_Task" / "demo_clean", 0)
    recording(home / "Lift_Fan_Repeat_1" / "demo_clean", 0, task="x", level=1, seed=5)
    silent = home / "Click_Bell_Repeat_1" / "demo_clean"
    recording(silent, 0)
    (silent / "instructions" / "episode0.json").unlink()
    return home


def imported(home: Path, layout: str, out: Path) -> list[Any]:
    import_recordings(find_recordings(home), home, layout, out)
    return list(read_lines(out))


@pytest.mark.parametrize("layout", FORMATS)
def test_a_data_set_of_recordings_is_sound_in_every_format(
    layout: str, official: Path, tmp_path: Path
) -> None:
    out = tmp_path / "set"
    lines = imported(official, layout, out)
    assert [line.source.split("/")[0] for line in lines] == [
        "Pick_Seals_Multi_View_3", "Pick_Seals_Multi_View_3", "Press_Stapler_Repeat_1",
    ]  # fmt: skip
    verdict = verify(out)
    assert verdict.problems == ()
    assert "scenes are not known here, so none was replayed" in verdict.checked[-1]
    made = read_record(out)
    assert (made.episodes, made.robot) == (3, "unstated")
    assert made.about["suite"] == RECORDINGS
    for line in lines:
        path = official / line.source
        assert line.source_sha256 == file_hash(path)
        found = FORMATS[layout].commands(out, line)
        assert found == pytest.approx(read_episode(path).commanded.astype(np.float32))
        assert line.success is None and line.key.split == "official_seen"
    assert [line.key.seed for line in lines] == [7, 12, 0]
    assert ["seed" in line.absent for line in lines] == [False, False, True]


def test_what_is_missing_is_stated_and_not_invented(official: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    imported(official, "lerobot-v3", out)
    info = json.loads((out / "meta" / "info.json").read_text())
    assert not {*info["features"]} & {"measured_state", "sim_time", "subtask_index", "label"}
    assert info["features"]["observation.state"]["names"][:7] == [
        *(f"left_joint{n}" for n in range(1, 7)), "left_gripper",
    ]  # fmt: skip
    assert "ee_pose" in info["features"] and info["robot_type"] == "unstated"
    assert not (out / "meta" / "subtasks.parquet").exists()
    table = pq.read_table(out / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert not {*table.column_names} & {"success", "scene_digest", "stride", "embodiment"}
    assert table["seed"].to_pylist() == [7, 12, None]
    card = (out / "README.md").read_text()
    assert "**Official recordings**" in card and "license: unknown" in card
    assert all(f"* `{name}`:" in card for name in ABSENT)
    assert "3 of 6 recordings are left out" in card and "no sentence is beside it" in card
    assert "grab it" not in card + (out / "meta" / "robospa_episodes.jsonl").read_text()
    why = " ".join(row["why"] for row in read_record(out).settings["left_out"])
    assert all(part in why for part in ("names no task", "recording of robospa", "no sentence"))


def test_pictures_have_their_colours_and_files_are_copied_as_they_are(
    official: Path, tmp_path: Path
) -> None:
    lines = imported(official, "robotwin-hdf5", tmp_path / "copies")
    for line in lines:
        copy, own = tmp_path / "copies" / line.file, official / line.source
        assert copy.read_bytes() == own.read_bytes()
    import_recordings(find_recordings(official), official, "lerobot-v3", tmp_path / "png", "png")
    table = pq.read_table(tmp_path / "png" / "data" / "chunk-000" / "file-000.parquet")
    image = Image.open(io.BytesIO(table["observation.images.head"][0].as_py()["bytes"]))
    assert np.asarray(image).mean(axis=(0, 1)) == pytest.approx((200, 30, 10), abs=4)


def test_nothing_to_import_and_a_full_folder_are_refused(official: Path, tmp_path: Path) -> None:
    only = official / "My_Own_Task"
    with pytest.raises(DatasetError, match=r"no episode to write .*names no task and level"):
        import_recordings(find_recordings(only), only, "lerobot-v3", tmp_path / "set")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    for layout, out, message in (
        ("lerobot-v3", "full", "is not empty"),
        ("zarr", "new", "no format .zarr."),
    ):
        with pytest.raises(SettingsError, match=message):
            import_recordings(find_recordings(official), official, layout, tmp_path / out)


def test_the_command_makes_it_and_says_what_is_not_there(official: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    words = ("collect", "--import", official, "--format", "robotwin-hdf5", "--out")
    done = robospa(*words, out)
    assert done.code == 0 and "3 official recordings" in done.out
    assert "1 recordings are left out" in done.err
    told = json.loads(robospa(*words, f"{out}2", "--json").out)
    assert told["episodes"] == 3 and sum(told["left_out"].values()) == 3
    assert told["absent"] == list(ABSENT)
    done = robospa("collect", "--verify", out)
    assert done.code == 0 and "none was replayed" in done.out
