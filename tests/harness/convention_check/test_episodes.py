"""Demonstration files: official and ours are read, broken ones are refused in one sentence."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from replay_fakes import FRAMES, SPEC, episode

from robospa.harness.convention_check.episodes import (
    EpisodeError,
    read_episode,
    to_jpeg,
    write_episode,
)
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec

MADE = episode()


@pytest.fixture
def official(tmp_path: Path) -> Path:
    """A file with no more in it than official ones have, where those lie."""
    path = tmp_path / "Pick_Blocks_Size" / "demo_clean" / "data" / "episode3.hdf5"
    write_episode(path, MADE)
    with h5py.File(path, "a") as file:
        del file["joint_action/measured"]
        for name in list(file.attrs):
            del file.attrs[name]
    texts = path.parent.parent / "instructions" / "episode3.json"
    texts.parent.mkdir()
    texts.write_text(json.dumps({"seen": ["Pick the red one.", "Other."], "unseen": ["No."]}))
    return path


def test_our_files_come_back_whole(tmp_path: Path) -> None:
    write_episode(tmp_path / "a.hdf5", MADE)
    back = read_episode(tmp_path / "a.hdf5")
    assert np.array_equal(back.commanded, MADE.commanded)
    assert np.array_equal(back.ee, MADE.ee)
    assert back.measured is not None and np.array_equal(back.measured, MADE.measured)
    assert back.instruction == MADE.instruction and back.about == MADE.about


def test_official_files_have_their_instruction_and_task_beside_them(official: Path) -> None:
    found = read_episode(official)
    assert found.instruction == "Pick the red one."
    assert found.about == {"task": "Pick_Blocks_Size"}
    assert found.measured is None
    assert read_episode(official, "Do it.").instruction == "Do it."


def test_red_stays_red_though_the_jpegs_have_it_as_blue(official: Path) -> None:
    frame = read_episode(official).picture(CameraSpec("left_wrist", 32, 24), 40)
    assert abs(float(frame[..., 0].mean()) - 100) < 3 and frame[-3, -3, 2] < 20
    import io

    from PIL import Image

    red = np.zeros((16, 16, 3), np.uint8)
    red[..., 0] = 255
    stored = np.asarray(Image.open(io.BytesIO(to_jpeg(red))))
    assert stored[8, 8, 2] > 200 > stored[8, 8, 0]  # what a plain reader makes of it


def test_a_policy_is_shown_what_its_spec_asks_for() -> None:
    spec = PolicySpec("x", (CameraSpec("head", 16, 12),), state="measured", history=(-1,))
    seen = MADE.observation(spec, 30)
    assert seen["images"]["head"].shape == (12, 16, 3)
    assert MADE.measured is not None and np.allclose(seen["state"], MADE.measured[30], atol=1e-6)
    assert np.allclose(seen["history"][-1]["state"], MADE.measured[29], atol=1e-6)
    assert (seen["step"], seen["instruction"]) == (30, "Pick it up.")
    assert np.allclose(MADE.observation(spec, 0)["history"][-1]["ee"], MADE.ee[0], atol=1e-6)


def test_a_camera_that_was_not_recorded_is_named() -> None:
    with pytest.raises(EpisodeError, match=r"'front'.*has only head, left_wrist, right_wrist"):
        MADE.observation(PolicySpec("x", (CameraSpec("front"),)), 0)


def _without(at: str) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[at]

    return change


def _instead(at: str, value: Any) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file[at]
        file[at] = value

    return change


BROKEN: dict[str, tuple[Callable[[Any], None], str]] = {
    "no joints": (_without("joint_action/vector"), "has no joint_action/vector"),
    "no poses": (_without("endpose"), "has no endpose/left_endpose"),
    "one frame": (_instead("joint_action/vector", np.zeros((1, 14))), "is \\(1, 14\\)"),
    "odd width": (_instead("joint_action/vector", np.zeros((FRAMES, 13))), "13\\)"),
    "text": (_instead("joint_action/vector", "hello"), "cannot be read"),
    "nan": (_instead("joint_action/vector", np.full((FRAMES, 14), np.nan)), "not finite"),
    "short poses": (_instead("endpose/left_endpose", np.zeros((3, 7))), "endpose/left"),
    "short video": (_instead("observation/head_camera/rgb", np.array([b"x"])), "1 frames"),
    "no frames": (_instead("observation/head_camera/rgb", np.zeros(FRAMES)), "neither JPEGs"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_broken_file_is_one_sentence(official: Path, what: str) -> None:
    change, told = BROKEN[what]
    with h5py.File(official, "a") as file:
        change(file)
    with pytest.raises(EpisodeError, match=told) as error:
        read_episode(official)
    assert "\n" not in str(error.value)


def _in_another_file(file: Any) -> None:
    other = Path(file.filename).with_name("other.hdf5")
    with h5py.File(other, "w") as made:
        made["x"] = np.zeros((FRAMES, 14))
    del file["joint_action/vector"]
    file["joint_action/vector"] = h5py.ExternalLink(str(other), "x")


def _raw_bytes_of(file: Any) -> None:
    del file["observation/head_camera/rgb"]
    file.create_dataset(
        "observation/head_camera/rgb", (FRAMES,), "S10", external=[(__file__, 0, 10 * FRAMES)]
    )


def _unpacks_to(dtype: str, *shape: int) -> Callable[[Any], None]:
    def change(file: Any) -> None:
        del file["observation/head_camera/rgb"]
        chunks = (1, *(min(n, 64) for n in shape))
        file.create_dataset("observation/head_camera/rgb", (FRAMES, *shape), dtype, chunks=chunks)

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_in_another_file, "joint_action/vector lies in another file, which is not read"),
        (_raw_bytes_of, "head_camera/rgb lies in another file"),
        (_unpacks_to("u1", 60_000, 60_000, 3), "more than 2147483648"),
        (_unpacks_to("S2000000000"), "more than 2147483648"),
    ],
)
def test_a_hostile_file_is_refused(
    official: Path, change: Callable[[Any], None], told: str
) -> None:
    """One that shows other files of this user, or is small and would fill the memory."""
    with h5py.File(official, "a") as file:
        change(file)
    assert official.stat().st_size < 2**22
    with pytest.raises(EpisodeError, match=told):
        read_episode(official)


@pytest.mark.parametrize("text", ["[" * 200_000, '{"seen": 5}', None])
def test_broken_sentences_are_none(official: Path, text: str | None) -> None:
    """The last is a link to something without an end."""
    (path,) = official.parents[1].glob("instructions/*.json")
    path.unlink()
    path.symlink_to("/dev/zero") if text is None else path.write_text(text)
    assert read_episode(official).instruction == ""


@pytest.mark.parametrize("content", [b"", b"not hdf5 at all", b"\x89HDF\r\n\x1a\n" + b"\0" * 80])
def test_what_is_no_hdf5_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.hdf5").write_bytes(content)
    with pytest.raises(EpisodeError, match="cannot be read as an HDF5 demonstration"):
        read_episode(tmp_path / "a.hdf5")
    with pytest.raises(EpisodeError, match="there is no file"):
        read_episode(tmp_path / "absent.hdf5")


def test_a_broken_frame_is_one_sentence(official: Path) -> None:
    with h5py.File(official, "a") as file:
        del file["observation/head_camera/rgb"]
        file["observation/head_camera/rgb"] = np.array([b"no jpeg"] * FRAMES)
    with pytest.raises(EpisodeError, match="frame 5 of camera head cannot be read"):
        read_episode(official).observation(SPEC, 5)


def test_without_h5py_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(EpisodeError, match=r"pip install '\S+\[demos\]'"):
        read_episode(tmp_path / "a.hdf5")
