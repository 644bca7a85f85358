"""An episode is what its replay shows, and comes out the same every time."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fake_runs import trial_record
from numpy.typing import NDArray

from robospa.harness.datasets.episode import DatasetEpisode, read_episode_file
from robospa.harness.datasets.maker import (
    EpisodeMaker,
    replay_end,
    subtask_of_frames,
    subtask_texts,
)
from robospa.harness.datasets.manifest import DatasetManifest
from robospa.harness.datasets.pack import pack
from robospa.harness.datasets.pictures import check_film
from robospa.harness.datasets.verify import verify
from robospa.harness.datasets.workers import EpisodeAttempt, EpisodeJob, attempt_job
from robospa.harness.demonstrations.demonstration import DemonstrationWorld, demonstrate
from robospa.harness.demonstrations.recorder import KEYFRAMES
from robospa.harness.replay import ENDED
from robospa.harness.trial import task_parts
from robospa.observation import FEATURES, SLOTS, CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.tasks.events import Event
from robospa.trial import TrialKey

KEY = TrialKey("Press_Stapler_Repeat", 1, 1_000_000, split="train")
TINY = (CameraSpec("head", 32, 24),)


@pytest.mark.parametrize(
    ("end", "message", "words"),
    [
        ("policy_error", f"at step 8: {ENDED}", "all recorded commands were sent"),
        ("step_limit", "", "step_limit"),
        ("infrastructure", "scene unstable", "infrastructure scene unstable"),
    ],
)
def test_how_a_replay_ended(end: str, message: str, words: str) -> None:
    assert replay_end(trial_record(KEY, end=end, message=message)) == words


def test_a_frame_belongs_to_the_subtask_that_is_done_next() -> None:
    events = [
        Event(0.5, "grasped", "b"), Event(1.0, "subtask_done", "b", 1),
        Event(2.0, "subtask_done", "a", 0), Event(2.0, "success"),
    ]  # fmt: skip
    found = subtask_of_frames(events, np.array([0.0, 0.9, 1.0, 1.9, 2.0, 3.0]))
    assert found.dtype == np.int32 and found.tolist() == [1, 1, 0, 0, -1, -1]
    assert subtask_of_frames([], np.zeros(2)).tolist() == [-1, -1]


@pytest.fixture(scope="module")
def made() -> EpisodeAttempt:
    return attempt_job(EpisodeMaker(), EpisodeJob(KEY, TINY, "h264"))


@pytest.fixture
def episode(made: EpisodeAttempt, tmp_path: Path) -> DatasetEpisode:
    path = tmp_path / "x.zip"
    path.write_bytes(made.data)
    return read_episode_file(path)


@pytest.mark.sim
def test_it_says_what_happened(made: EpisodeAttempt, episode: DatasetEpisode) -> None:
    assert made.accepted and not made.reason and made.frames == len(episode)
    assert (episode.key, episode.kind, episode.success) == (KEY, "expert", True)
    assert len(set(episode.instructions)) == len(episode.instructions) >= 100
    assert np.array_equal(episode.action, episode.executed) and not episode.label.any()
    assert episode.sim_time[0] == 0 and (np.diff(episode.sim_time) > 0).all()
    assert len(episode.subtasks) == 1 and set(episode.subtask) == {0, -1}
    assert [event.index for event in episode.events if event.kind == "subtask_done"] == [0]
    (began,) = (event for event in episode.events if event.kind == "began")
    assert (began.time, began.note) == (0.0, "Press")
    assert episode.scene_digest and episode.replay_digest
    (film,) = episode.pictures["head"].files
    check_film(film, len(episode))


@pytest.mark.sim
def test_a_packed_data_set_is_verified_by_replay(made: EpisodeAttempt, tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    path.write_bytes(made.data)
    pack("lerobot-v3", tmp_path / "set", [path], DatasetManifest("robospa collect", {}))
    verdict = verify(tmp_path / "set")
    assert verdict.problems == () and verdict.checked[-1].startswith("All 1 episodes were replayed")


@pytest.mark.sim
def test_another_worker_that_made_another_before_makes_the_same_bytes(made: EpisodeAttempt) -> None:
    maker = EpisodeMaker()
    other = TrialKey("Pick_Blocks_Size", 1, 1_000_000, "no-robot", split="train")
    error = attempt_job(maker, EpisodeJob(other, TINY, "png"))
    assert not error.accepted and "no-robot" in error.reason and not error.data
    assert attempt_job(maker, EpisodeJob(KEY, TINY, "h264")).data == made.data


@pytest.mark.sim
def test_keyframes_without_pictures_are_the_actions_that_the_expert_gave(tmp_path: Path) -> None:
    key = TrialKey("Pick_Blocks_Size", 1, 1_000_000, split="train")
    maker = EpisodeMaker()
    made = attempt_job(maker, EpisodeJob(key, (), "h264", keyframes=True, environment_state=True))
    path = tmp_path / "x.zip"
    path.write_bytes(made.data)
    episode = read_episode_file(path)
    given: list[NDArray[np.float32]] = []
    world = DemonstrationWorld(render=False)
    listener = SimpleNamespace(
        started=lambda world: None,
        polled=lambda world, time: None,
        executed=lambda world, action, done: given.append(action),
        ended=lambda world: None,
    )
    demonstrate(world, key, listener)
    assert np.array_equal(episode.executed[:-1], np.array(given)) and episode.stride == KEYFRAMES
    assert episode.pictures == {} and len(episode) < 20
    objects = episode.environment_state.reshape(len(episode), SLOTS, len(FEATURES))
    risen = objects[-1, :, FEATURES.index("z")] - objects[0, :, FEATURES.index("z")]
    assert risen.max() > 0.06 and (risen > 0.02).sum() == 1
    last = world.observe(PolicySpec("p", (), environment_state=True))["environment_state"]
    assert np.array_equal(last, episode.environment_state[-1])
    pack("lerobot-v3", tmp_path / "set", [path], DatasetManifest("robospa collect", {}))
    assert verify(tmp_path / "set").problems == ()


def test_texts_name_the_objects() -> None:
    parts = task_parts(TrialKey("Place_Bowls_Plates", 2, 1_000_000, split="train"))
    texts = subtask_texts(parts.tracker, parts.scene)
    assert len(texts) == parts.tracker.total
    assert texts[0].startswith(f"1 of {len(texts)}: the ") and "bowl" in texts[0]
