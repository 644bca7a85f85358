"""The files of LeRobot's versions 3.0 and 2.1, against what their readers expect of them."""

import io
import json
import zipfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from dataset_fakes import fake_episode
from numpy.typing import NDArray
from PIL import Image
from tiny_datasets import CAMERAS, SIZE, film_of, packed, painted, tiny_dataset

from robospa.harness.datasets.episode import (
    ARRAYS,
    HEADER,
    DatasetEpisode,
    EpisodeFileError,
    Pictures,
    episode_bytes,
    read_episode_file,
)
from robospa.harness.datasets.lerobot import FilmFiles, TableFiles
from robospa.harness.datasets.manifest import DatasetError
from robospa.harness.datasets.pictures import (
    CODECS,
    FPS,
    EpisodeFilmError,
    JoinedFilm,
    check_film,
    encode,
    film_frames,
)
from robospa.harness.datasets.verify import verify
from robospa.observation import NAMES, CameraSpec
from robospa.trial import TrialKey

STATS = ("min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99")
ALWAYS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("v3")
    tiny_dataset(path)
    return path


def test_info_describes_every_column_and_film(folder: Path) -> None:
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["fps"] == FPS
    assert info["robot_type"] == "aloha-agilex" and info["splits"] == {"train": "0:4"}
    features = info["features"]
    data = pq.read_table(folder / "data/chunk-000/file-000.parquet")
    films = [name for name, of in features.items() if of["dtype"] == "video"]
    assert films == [f"observation.images.{camera}" for camera in CAMERAS]
    assert set(data.column_names) == set(features) - set(films)
    assert features[films[0]]["shape"] == [SIZE[1], SIZE[0], 3]
    assert features[films[0]]["info"]["video.codec"] == "h264"
    assert features["action"]["names"] == features["observation.state"]["names"]
    assert features["action"]["names"][6] == "left_gripper"
    trained = [name for name in features if name.startswith(("observation", "action"))]
    assert sorted(trained) == sorted([*films, "observation.state", "action"])
    assert all(features[name]["shape"] == [1] for name in ALWAYS)


def test_frames_are_those_of_the_episodes(folder: Path) -> None:
    episodes = tiny_dataset(folder / "again")
    data = pq.read_table(folder / "data/chunk-000/file-000.parquet")
    lengths = [len(episode) for episode in episodes]
    assert data["index"].to_pylist() == list(range(sum(lengths)))
    assert pq.ParquetFile(folder / "data/chunk-000/file-000.parquet").num_row_groups == 4
    start = sum(lengths[:2])
    rows = data.slice(start, lengths[2])
    third = episodes[2]
    for name, wanted in (
        ("observation.state", third.commanded),
        ("action", third.action),
        ("measured_state", third.measured),
        ("ee_pose", third.ee.reshape(len(third), 16)),
    ):
        assert (np.array(rows[name].to_pylist(), np.float32) == wanted).all(), name
    assert np.allclose(rows["timestamp"].to_pylist(), np.arange(len(third)) / FPS)
    assert np.allclose(rows["sim_time"].to_pylist(), third.sim_time)
    texts = pq.read_table(folder / "meta/subtasks.parquet")["subtask"].to_pylist()
    found = [texts[i] for i in rows["subtask_index"].to_pylist()]
    assert found == [third.subtasks[i] if i >= 0 else "" for i in third.subtask]
    tasks = pq.read_table(folder / "meta/tasks.parquet")["task"].to_pylist()
    assert {tasks[i] for i in rows["task_index"].to_pylist()} == {third.instructions[0]}


def test_episodes_name_their_files_sentences_and_trial(folder: Path) -> None:
    table = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet")
    rows = table.to_pylist()
    assert [row["episode_index"] for row in rows] == [0, 1, 2, 3]
    assert rows[1]["dataset_from_index"] == rows[0]["dataset_to_index"] == rows[0]["length"]
    assert rows[3]["tasks"] == ["pick block 0"] and len(rows[3]["instructions"]) == 3
    trial = (rows[3]["base_task"], rows[3]["level"], rows[3]["seed"])
    assert trial == ("Place_Bowls_Plates", 4, 1_000_003)
    place = "videos/observation.images.left_wrist"
    start = sum(row["length"] for row in rows[:2]) / FPS
    assert np.isclose(rows[2][f"{place}/from_timestamp"], start)
    film = (folder / place / "chunk-000/file-000.mp4").read_bytes()
    assert len(list(film_frames(film))) == rows[-1]["dataset_to_index"]
    assert {f"stats/action/{name}" for name in STATS} <= set(table.column_names)
    image = rows[0]["stats/observation.images.head/q99"]
    assert np.shape(image) == (3, 1, 1) and 0 < image[0][0][0] < 1


def test_stills_lie_in_the_rows_as_the_hub_keeps_images(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, codec="png", count=2)
    assert not (tmp_path / "videos").exists()
    file = pq.ParquetFile(tmp_path / "data/chunk-000/file-000.parquet")
    about = json.loads(file.schema_arrow.metadata[b"huggingface"])
    assert about["info"]["features"]["observation.images.head"] == {"_type": "Image"}
    image = file.read_row_group(1)["observation.images.head"].to_pylist()[2]
    seen = episodes[1].pictures["head"]
    assert image == {"bytes": seen.files[2], "path": "frame-000002.png"}
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert info["features"]["observation.images.head"]["dtype"] == "image"
    assert info["video_path"] is None


def test_tables_go_on_in_a_next_file(tmp_path: Path) -> None:
    import pyarrow as pa

    table = pa.table({"a": np.random.default_rng(0).integers(0, 2**62, 1000)})
    files = TableFiles(tmp_path, limit=0.02)
    assert [files.add(table)[1] for _ in range(5)] == [0, 0, 1, 1, 2]
    files.close()
    assert pq.read_table(tmp_path / "chunk-000/file-001.parquet").num_rows == 2000


def test_a_data_set_without_pictures_has_the_objects_as_numbers(tmp_path: Path) -> None:
    episodes = [blind_episode(seed) for seed in (1_000_000, 1_000_001)]
    packed(tmp_path, episodes)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert info["video_path"] is None
    assert {of["dtype"] for of in info["features"].values()} == {"float32", "int64"}
    assert info["features"]["observation.environment_state"]["names"] == list(NAMES)
    rows = pq.read_table(tmp_path / "data")["observation.environment_state"].to_pylist()
    wanted = np.concatenate([episode.environment_state for episode in episodes])
    assert (np.array(rows, np.float32) == wanted).all()
    assert verify(tmp_path, replays=0).problems == ()


def test_episodes_with_and_without_the_objects_do_not_go_together(tmp_path: Path) -> None:
    key = TrialKey("Pick_Blocks_Size", 1, 1_000_001, split="train")
    episodes = [blind_episode(1_000_000), replace(fake_episode(key), pictures={})]
    with pytest.raises(DatasetError, match="environment state"):
        packed(tmp_path, episodes)


def blind_episode(seed: int) -> DatasetEpisode:
    """An episode without pictures, with the objects as numbers."""
    key = TrialKey("Pick_Blocks_Size", 1, seed, split="train")
    return replace(fake_episode(key, objects=True), pictures={})


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_an_episode_has_a_file_and_a_film_a_camera(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, "lerobot-v2.1", count=3)
    info = json.loads((tmp_path / "meta/info.json").read_text())
    assert info["codebase_version"] == "v2.1" and info["total_videos"] == 9
    assert info["total_chunks"] == 1 and info["total_tasks"] == 3
    where = {"episode_chunk": 0, "episode_index": 1}
    table = pq.read_table(tmp_path / info["data_path"].format(**where))
    assert (np.array(table["action"].to_pylist(), np.float32) == episodes[1].action).all()
    assert table["timestamp"].to_pylist() == pytest.approx(np.arange(len(episodes[1])) / FPS)
    assert b"huggingface" not in (table.schema.metadata or {})
    for camera in CAMERAS:
        key = f"observation.images.{camera}"
        (film,) = episodes[1].pictures[camera].files
        path = tmp_path / info["video_path"].format(video_key=key, **where)
        assert path.read_bytes() == film


def test_lines_of_tasks_episodes_and_statistics(tmp_path: Path) -> None:
    episodes = tiny_dataset(tmp_path, "lerobot-v2.1", "jpeg", count=4)
    meta = tmp_path / "meta"
    assert lines(meta / "tasks.jsonl")[1] == {"task_index": 1, "task": "pick block 1"}
    assert lines(meta / "subtasks.jsonl")[0] == {"subtask_index": 0, "subtask": ""}
    found = lines(meta / "episodes.jsonl")
    assert [row["length"] for row in found] == [len(episode) for episode in episodes]
    assert found[3]["tasks"] == ["pick block 0"]
    stats = lines(meta / "episodes_stats.jsonl")[2]["stats"]
    assert isinstance(stats, dict)
    assert set(stats["action"]) == {"min", "max", "mean", "std", "count"}
    assert np.shape(stats["observation.images.head"]["std"]) == (3, 1, 1)
    assert np.allclose(stats["action"]["max"], episodes[2].action.max(axis=0))
    schema = pq.read_schema(tmp_path / "data/chunk-000/episode_000000.parquet")
    assert b"Image" in schema.metadata[b"huggingface"] and b"List" not in schema.metadata


# ----- pictures as they are kept: all frames, in their order, the same bytes every time, and joined


CAMERAS_PICTURES = (CameraSpec("head", 64, 48), CameraSpec("front", 32, 32))
FRAMES = 7


def pictures() -> list[list[NDArray[np.uint8]]]:
    """The head's frames get redder, the front camera's bluer."""
    return [
        [np.full((c.height, c.width, 3), [30 * t * (i == 0), 40, 30 * t * i], np.uint8)
         for i, c in enumerate(CAMERAS_PICTURES)]
        for t in range(FRAMES)
    ]  # fmt: skip


@pytest.mark.parametrize("codec", CODECS)
def test_every_frame_is_there_in_its_colours(codec: str) -> None:
    made = encode(pictures(), CAMERAS_PICTURES, codec)
    assert made == encode(pictures(), CAMERAS_PICTURES, codec)
    assert list(made) == ["head", "front"]
    for i, camera in enumerate(CAMERAS_PICTURES):
        seen = made[camera.name]
        assert (seen.codec, seen.width, seen.height) == (codec, camera.width, camera.height)
        frames = decoded(seen)
        assert len(frames) == FRAMES
        for t, frame in enumerate(frames):
            assert frame.shape == (camera.height, camera.width, 3)
            wanted = [30 * t * (i == 0), 40, 30 * t * i]
            assert np.abs(frame.mean(axis=(0, 1)) - wanted).max() < 12, (codec, t)


def decoded(seen: Pictures) -> list[NDArray[np.uint8]]:
    if not seen.filmed:
        return [np.asarray(Image.open(io.BytesIO(data))) for data in seen.files]
    with av.open(io.BytesIO(seen.files[0])) as file:
        frames = list(file.decode(video=0))
        assert [round(frame.time * FPS, 6) for frame in frames] == list(range(FRAMES))
        keys = [t for t, frame in enumerate(frames) if frame.key_frame]
    assert all(b - a <= 2 for a, b in pairwise([*keys, FRAMES]))
    return [frame.to_ndarray(format="rgb24") for frame in frames]


LENGTHS = (5, 1, 8)


def joined(path: Path, films: list[bytes]) -> bytes:
    film = JoinedFilm(path)
    for data, frames in zip(films, LENGTHS, strict=True):
        film.append(data, frames)
    film.close()
    return path.read_bytes()


def test_a_joined_film_shows_every_frame_at_its_time(tmp_path: Path) -> None:
    films = [film_of(painted(seed, frames)) for seed, frames in enumerate(LENGTHS)]
    data = joined(tmp_path / "a.mp4", films)
    own = [frame for film in films for frame in film_frames(film)]
    found = list(film_frames(data))
    assert len(found) == sum(LENGTHS)
    assert all((a == b).all() for a, b in zip(own, found, strict=True))
    with av.open(io.BytesIO(data)) as film:
        times = [frame.time for frame in film.decode(video=0)]
    np.testing.assert_allclose(times, np.arange(sum(LENGTHS)) / FPS, atol=1e-9)
    assert data == joined(tmp_path / "b.mp4", films)  # the same bytes again


def test_films_of_other_encoders_or_lengths_are_refused(tmp_path: Path) -> None:
    film = JoinedFilm(tmp_path / "film.mp4")
    film.append(film_of(painted(0, 4)), 4)
    with pytest.raises(EpisodeFilmError, match="other settings"):
        film.append(film_of(painted(0, 4)[:, :32]), 4)
    with pytest.raises(EpisodeFilmError, match="4 frames, and the episode 5"):
        check_film(film_of(painted(0, 4)), 5)
    film.close()


def test_sampled_frames_are_some_of_all() -> None:
    data = film_of(painted(0, 30))
    frames = list(film_frames(data))
    some = list(film_frames(data, 4))
    places = [next(t for t, f in enumerate(frames) if (f == s).all()) for s in some]
    assert len(some) == 4 and places == sorted(places) and places[0] == 0 and places[-1] >= 27


def test_film_files_go_on_in_a_next_file(tmp_path: Path) -> None:
    data = film_of(painted(0, 5))
    files = FilmFiles(tmp_path, limit=2.2 * len(data) / 1024**2)
    places = [files.add(data, 5) for _ in range(3)]
    files.close()
    assert [place for place, _ in places] == [(0, 0), (0, 0), (0, 1)]
    assert [round(start * FPS) for _, start in places] == [0, 5, 0]
    assert len(list(film_frames((tmp_path / "chunk-000/file-001.mp4").read_bytes()))) == 5


# -------------- the file of an episode comes back exactly, and a bad one is refused in one sentence


@pytest.mark.parametrize("stills", [False, True])
def test_reading_gives_back_every_bit(tmp_path: Path, stills: bool) -> None:
    episode = fake_episode(kind="midstate", stills=stills)
    path = tmp_path / "1000007.zip"
    path.write_bytes(episode_bytes(episode))
    found = read_episode_file(path)
    for name, dtype in ARRAYS.items():
        a, b = getattr(found, name), getattr(episode, name)
        assert a.dtype == dtype and a.tobytes() == b.tobytes(), name
    assert episode_bytes(found) == path.read_bytes()


def test_equal_episodes_have_equal_bytes_and_execute_the_next_command() -> None:
    assert episode_bytes(fake_episode()) == episode_bytes(fake_episode())
    episode = fake_episode(frames=3)
    assert np.array_equal(episode.executed, episode.commanded[[1, 2, 2]])


def test_an_episode_whose_arrays_do_not_fit_is_none() -> None:
    episode = fake_episode(stills=True)
    with pytest.raises(ValueError, match=r"sim_time has the shape \(4,\), not \(5,\)"):
        replace(episode, sim_time=episode.sim_time[1:])
    with pytest.raises(ValueError, match="camera head has 4 frames, not 5"):
        head = episode.pictures["head"]
        replace(episode, pictures={"head": replace(head, files=head.files[1:])})


@pytest.mark.parametrize("stills", [False, True])
def test_a_torn_or_changed_file_is_refused(tmp_path: Path, stills: bool) -> None:
    whole = episode_bytes(fake_episode(stills=stills))
    path = tmp_path / "x.zip"
    for length in [0, 1, 100, len(whole) // 2, len(whole) - 30, len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(EpisodeFileError) as error:
            read_episode_file(path)
        assert str(path) in str(error.value) and "\n" not in str(error.value)
    for at in range(120, len(whole) - 2000, 997):
        changed = bytearray(whole)
        changed[at] ^= 0xFF
        path.write_bytes(bytes(changed))
        try:
            found = read_episode_file(path)
        except EpisodeFileError as error:
            assert "\n" not in str(error)
        else:  # a byte that says nothing, such as a name that is written twice
            assert episode_bytes(found) == whole


def with_header(path: Path, **changes: object) -> Path:
    """The file of an episode, written anew with other words in its header."""
    stream = io.BytesIO(episode_bytes(fake_episode()))
    with zipfile.ZipFile(stream) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == HEADER:
                data = json.dumps({**json.loads(data), **changes}).encode()
            new.writestr(name, data)
    return path


def test_another_layout_or_a_wrong_header_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.zip"
    assert episode_bytes(read_episode_file(with_header(path))) == episode_bytes(fake_episode())
    for changes, match in (
        ({"format": 1}, "layout 1"),
        ({"stride": -1}, "'stride'"),
        ({"space": {"kind": "joint", "joints": [7, 7]}}, "commanded has the shape"),
    ):
        with pytest.raises(EpisodeFileError, match=match):
            read_episode_file(with_header(path, **changes))
    with pytest.raises(EpisodeFileError, match="no file"):
        read_episode_file(tmp_path / "none.zip")
    with pytest.raises(EpisodeFileError):
        read_episode_file(tmp_path)
