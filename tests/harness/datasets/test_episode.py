"""The file of an episode comes back exactly, and a bad one is refused in one sentence."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dataset_fakes import fake_episode

from robospa.harness.datasets.episode import (
    ARRAYS,
    HEADER,
    DatasetEpisode,
    EpisodeFileError,
    EpisodeFilm,
    episode_bytes,
    read_episode_file,
)


def assert_equal(one: DatasetEpisode, other: DatasetEpisode) -> None:
    blank = {name: np.zeros(0) for name in ARRAYS}
    for name in ARRAYS:
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype and a.tobytes() == b.tobytes(), name
    for name in one.__dataclass_fields__:
        if name not in blank:
            assert getattr(one, name) == getattr(other, name), name


@pytest.mark.parametrize("stills", [False, True])
def test_reading_gives_back_every_bit(tmp_path: Path, stills: bool) -> None:
    episode = fake_episode(kind="midstate", stills=stills)
    path = tmp_path / "1000007.zip"
    path.write_bytes(episode_bytes(episode))
    assert_equal(read_episode_file(path), episode)
    assert_equal(read_episode_file(path, pictures=False), replace(episode, pictures={}))


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
        assert not isinstance(head, EpisodeFilm)
        replace(episode, pictures={"head": replace(head, frames=head.frames[1:])})


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
            assert_equal(found, fake_episode(stills=stills))


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
    assert_equal(read_episode_file(with_header(path)), fake_episode())
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
