"""Recordings on disk: which there are, and which scenes can be made again."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import robospa

from robospa.action_space import SEVEN_JOINT_ARMS, ActionSpace
from robospa.geometry import rotate
from robospa.harness.convention_check.episodes import Episode, EpisodeError
from robospa.harness.datasets.episode import read_episode_file
from robospa.harness.datasets.features import layout_of
from robospa.harness.datasets.imports import source
from robospa.harness.datasets.robotwin import RoboTwin
from robospa.harness.datasets.workers import EpisodeJob
from robospa.harness.official.recordings import (
    NotStored,
    OfficialRecording,
    RecordingReplay,
    chosen,
    find_recordings,
    key_of,
    rebuilt,
    recording_of,
    summary,
    variant_of,
)
from robospa.tasks.catalog import build_scene
from robospa.tasks.official import official_model
from robospa.trial import TrialKey

LAYOUT: Mapping[str, Any] = {
    "target_index": 1,
    "position_key": "leftmost",
    "observed_position_key": "backmost",
    "scene_assets": ["050_bell/base0", "107_soap/base3", "primitive_block/base1"],
    "view_name": "left",
    "object_positions": [[0.1, 0.05, 0.7407], [-0.2, -0.05, 0.7408], [0.0, -0.15, 0.756]],
}
NOWHERE: Mapping[str, str | int] = {}


def official(folder: Path, name: str = "Pick_Mixed_Objects_Multi_View_B_1") -> Path:
    """Empty episodes 0, 1, 2, 10 in the official layout."""
    base = folder / name / "demo_clean_aloha"
    (base / "data").mkdir(parents=True)
    for number in (0, 10, 2, 1):
        (base / "data" / f"episode{number}.hdf5").touch()
    (base / "seed.txt").write_text("0 1 3 ")
    (base / "scene_info.json").write_text(json.dumps({"episode_2": {"layout": LAYOUT}}))
    return base


def episode(about: Mapping[str, str | int] = NOWHERE, turned: float = 0.0) -> Episode:
    """Four frames; the left gripper, pointing down, closes at the third, turned [rad] about z."""
    ee = np.zeros((4, 2, 8))
    ee[:, :, 7] = 1.0
    ee[2:, 0, 7] = 0.0
    w, y = np.sqrt(0.5), np.sqrt(0.5)
    c, s = np.cos(turned / 2), np.sin(turned / 2)
    ee[:, :, 3:7] = [c * w, -s * y, c * y, s * w]
    return Episode("e", np.zeros((4, 14)), ee, {}, ActionSpace("joint"), "say", None, about)


def test_recordings_are_found_with_their_seeds_and_scenes(tmp_path: Path) -> None:
    base = official(tmp_path)
    found = find_recordings(tmp_path)
    assert [r.number for r in found] == [0, 1, 2, 10]
    assert [r.seed for r in found] == [0, 1, 3, None]
    assert {r.variant for r in found} == {("Pick_Mixed_Objects_Multi_View_B", 1)}
    assert found[2].scene["layout"] == LAYOUT and found[0].scene == {}
    assert recording_of(base / "data" / "episode2.hdf5").seed == 3
    assert [r.number for r in chosen(found, 2)] == [0, 1]


def test_a_linked_recording_is_what_its_own_folder_says(tmp_path: Path) -> None:
    base = official(tmp_path)
    (tmp_path / "disk").mkdir()
    file = base / "data" / "episode1.hdf5"
    file.rename(tmp_path / "disk" / "x")
    file.symlink_to(tmp_path / "disk" / "x")
    loop = base / "data" / "episode3.hdf5"
    loop.symlink_to(loop.name)
    linked, looped = (r for r in find_recordings(tmp_path) if r.number in (1, 3))
    assert linked.variant == looped.variant == ("Pick_Mixed_Objects_Multi_View_B", 1)
    assert source(linked, tmp_path).endswith("data/episode1.hdf5")


def test_what_is_no_recording_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="there are no recordings below"):
        find_recordings(tmp_path)
    base = official(tmp_path)
    for seeds, named in (("0 one", "'one'"), ("0 " + "9" * 4000, "'9{20}'")):
        (base / "seed.txt").write_text(seeds)
        with pytest.raises(EpisodeError, match=f"cannot be read: {named} is no seed"):
            find_recordings(tmp_path)
    with pytest.raises(EpisodeError, match="there is no folder"):
        find_recordings(base / "seed.txt")
    assert variant_of(Path("/x/Pick_Nothing_3/d/data/episode0.hdf5")) is None


def test_a_scene_of_stored_places_is_made_again(tmp_path: Path) -> None:
    official(tmp_path)
    key, parts = rebuilt(find_recordings(tmp_path)[2], episode())
    assert (key.task, key.level, key.seed) == ("Pick_Mixed_Objects_Multi_View_B", 1, 3)
    things = [(o.asset, o.pose.position[:2]) for o in parts.scene.objects]
    assert things == [("bell", (0.1, 0.05)), ("soap", (-0.2, -0.05)), ("block", (0.0, -0.15))]
    assert parts.scene.objects[2].pose.position[2] == pytest.approx(0.755)
    assert (parts.scene.facts["target"], parts.scene.facts["position"]) == ("object_1", "backmost")


@pytest.mark.parametrize("turned", [0.5, -1.2])
def test_the_taken_thing_is_turned_as_the_gripper_closed_on_it(
    tmp_path: Path, turned: float
) -> None:
    official(tmp_path)
    recording = find_recordings(tmp_path)[2]

    def direction(turn: float) -> float:
        item = rebuilt(recording, episode(turned=turn))[1].scene.object("object_1")
        x, y, _ = rotate(item.pose.rotation, (1, 0, 0))
        return float(np.arctan2(y, x))

    # A grasp is the same turned by half a circle, so only the line of the fingers has to follow.
    assert np.sin(direction(turned) - direction(0.0) - turned) == pytest.approx(0.0, abs=1e-6)


def test_scenes_that_are_not_stored_are_left_with_the_reason(tmp_path: Path) -> None:
    official(tmp_path)
    recording = find_recordings(tmp_path)[2]

    def changed(**layout: object) -> OfficialRecording:
        return replace(recording, scene={"layout": {**LAYOUT, **layout}})

    for bad, sentence in (
        (replace(recording, scene={}), "where things lay is not stored"),
        (replace(recording, variant=None), "names no task and level"),
        (changed(target_index=3), "other things than"),
        (changed(view_name="top"), "no viewer"),
        (changed(object_positions="x"), "object_positions"),
        (changed(scene_assets=["999_thing/base0"] * 3), "nothing here for the official model"),
    ):
        with pytest.raises(NotStored, match=sentence):
            rebuilt(bad, episode())
    seven = replace(episode(), space=ActionSpace("joint", SEVEN_JOINT_ARMS))
    with pytest.raises(NotStored, match="not aloha-agilex"):
        rebuilt(recording, seven)


def test_an_episode_of_ours_names_its_trial() -> None:
    about = {"task": "Rank_Blocks_Color", "level": 2, "seed": 1000003, "mode": "clean"}
    key, parts = rebuilt(OfficialRecording(Path("x"), 0), episode(about))
    assert key == key_of(episode(about)) and parts.scene.seed == 1000003
    assert key_of(episode({"task": "Rank_Blocks_Color"})) is None
    with pytest.raises(NotStored, match="its trial cannot be made"):
        rebuilt(OfficialRecording(Path("x"), 0), episode({**about, "task": "No_Such_Task"}))


def test_the_summary_counts_and_gives_reasons() -> None:
    one = OfficialRecording(Path("/a/T_1/c/data/episode0.hdf5"), 0, ("Press_Stapler_Repeat", 1))
    rows = [
        RecordingReplay(one, 9, True),
        RecordingReplay(one, 9, False, "step_limit"),
        RecordingReplay(one, 0, None, "why"),
    ]
    assert summary(rows) == [
        "Press_Stapler_Repeat level 1: 3 recordings, 1 of 2 meet their goal again (50 %)",
        "  1 not played: why",
    ]


# --- in the simulator a demonstration of ours, in their layout and without its key, is played again


TASK = "Pick_Mixed_Objects_Multi_View_B"
VIEWERS = {"robot": "back", "opposite": "front", "left": "left", "right": "right"}


@pytest.mark.sim
def test_official_recordings_with_places_meet_their_goal_again(tmp_path: Path) -> None:
    from robospa.harness.datasets.maker import EpisodeMaker

    h5py = pytest.importorskip("h5py", reason="recordings need h5py: pip install 'robospa[demos]'")
    key = TrialKey(TASK, 2, 1_000_001, split="train")
    made = EpisodeMaker()(EpisodeJob(key, (), "png"))
    file = tmp_path / "episode.zip"
    file.write_bytes(made.data)
    whole = read_episode_file(file)
    ours = tmp_path / "ours"
    RoboTwin(ours, layout_of(whole)).add(whole)
    (theirs := tmp_path / f"{TASK}_2" / "demo_clean_aloha" / "data").mkdir(parents=True)
    path = theirs / "episode0.hdf5"
    path.write_bytes(next(ours.rglob("*.hdf5")).read_bytes())
    with h5py.File(path, "r+") as opened:
        for name in list(opened.attrs):
            del opened.attrs[name]
    scene = build_scene(TASK, 2, 1_000_001)
    models = [official_model(o.asset, o.params["look"]) for o in scene.objects]
    layout = {
        "target_index": [o.name for o in scene.objects].index(scene.facts["target"]),
        "position_key": scene.facts["extreme"],
        "observed_position_key": scene.facts["position"],
        "scene_assets": [model.name for model in models if model],
        "view_name": VIEWERS[scene.facts["viewpoint"]],
        "object_positions": [list(o.pose.position) for o in scene.objects],
    }
    info = theirs.parent / "scene_info.json"
    info.write_text(json.dumps({"episode_0": {"info": {}, "layout": layout}}))
    shown = robospa("collect", "--import", tmp_path)
    assert shown.code == 0, shown.err
    assert f"{TASK} level 2: 1 recordings, 1 of 1 meet their goal again" in shown.out
    assert shown.out.count("1 of 1 meet their goal again (100 %)") == 2  # ours by its key, too
