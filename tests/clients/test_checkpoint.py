"""A checkpoint's name follows its weights, wherever they lie and however large they are."""

from __future__ import annotations

import shutil
from pathlib import Path

from robospa.clients.model_policy import BLOCK, SAMPLES, describe_checkpoint


def weights(folder: Path, byte: int) -> Path:
    folder.mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    data = bytearray(2 * SAMPLES * BLOCK)
    data[-1] = byte
    (folder / "model.safetensors").write_bytes(data)
    return folder


def test_the_name_follows_the_weights_and_not_the_place(tmp_path: Path) -> None:
    first = describe_checkpoint(str(weights(tmp_path / "a" / "29999", 1)))
    other = describe_checkpoint(str(weights(tmp_path / "b" / "29999", 2)))
    moved = tmp_path / "c" / "29999"
    shutil.copytree(tmp_path / "a" / "29999", moved)
    assert first.startswith("29999 sample:")
    assert describe_checkpoint(str(moved)) == first != other


def test_a_file_alone_and_a_file_that_is_renamed(tmp_path: Path) -> None:
    folder = weights(tmp_path / "a", 1)
    before = describe_checkpoint(str(folder))
    (folder / "config.json").rename(folder / "other.json")
    assert describe_checkpoint(str(folder)) != before
    assert describe_checkpoint(str(folder / "other.json")).startswith("other.json sample:")


def test_what_is_not_here_keeps_its_name() -> None:
    assert describe_checkpoint("gs://bucket/checkpoints/pi05") == "gs://bucket/checkpoints/pi05"
    assert describe_checkpoint("nobody/such-model") == "nobody/such-model"
    assert len(describe_checkpoint("x" * 500)) == 200
