"""A demonstration of ours, in the official layout and without its key, is played again."""

import json
from pathlib import Path

import pytest
from command_line import robospa

from robospa.harness.datasets.episode import read_episode_file
from robospa.harness.datasets.features import layout_of
from robospa.harness.datasets.robotwin import RoboTwin
from robospa.harness.datasets.workers import EpisodeJob
from robospa.tasks.catalog import build_scene
from robospa.tasks.official import official_model
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
h5py = pytest.importorskip("h5py", reason="recordings need h5py: pip install 'robospa[demos]'")
TASK = "Pick_Mixed_Objects_Multi_View_B"
VIEWERS = {"robot": "back", "opposite": "front", "left": "left", "right": "right"}


def test_official_recordings_with_places_meet_their_goal_again(tmp_path: Path) -> None:
    from robospa.harness.datasets.maker import EpisodeMaker

    key = TrialKey(TASK, 2, 1_000_001, split="train")
    made = EpisodeMaker()(EpisodeJob(key, (), "png"))
    file = tmp_path / "episode.zip"
    file.write_bytes(made.data)
    episode = read_episode_file(file)
    ours = tmp_path / "ours"
    RoboTwin(ours, layout_of(episode)).add(episode)
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
