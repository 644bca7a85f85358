"""Blocks of hidden seeds: committed to first, revealed later."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from msgspec import to_builtins

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.reproduce import FIRST, Block, read_block, write_block

BLOCK = Block({"Pick_Blocks_Size/1": (FIRST, FIRST + 7)}, "ab" * 32)


def test_a_block_is_read_back_under_its_commitment(tmp_path: Path) -> None:
    write_block(BLOCK, tmp_path / "block.json")
    assert read_block(tmp_path / "block.json", BLOCK.commitment) == BLOCK


def test_the_salt_is_part_of_the_commitment() -> None:
    assert Block(BLOCK.seeds, "cd" * 32).commitment != BLOCK.commitment


def test_another_block_than_was_committed_to_is_refused(tmp_path: Path) -> None:
    write_block(Block({"Pick_Blocks_Size/1": (FIRST,)}, "ab" * 32), tmp_path / "b.json")
    with pytest.raises(BundleError, match="not the block that was committed to"):
        read_block(tmp_path / "b.json", BLOCK.commitment)


def test_a_block_is_never_written_over(tmp_path: Path) -> None:
    write_block(BLOCK, tmp_path / "b.json")
    with pytest.raises(BundleError, match="never written over"):
        write_block(BLOCK, tmp_path / "b.json")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 1}, "format 2"),
        ({"salt": "short"}, "'salt' must be 32 bytes"),
        ({"suite": "robospa-9"}, "no block of"),
        ({"seeds": {}}, "'seeds'"),
        ({"seeds": {"Pick_Blocks_Size/1": [100000]}}, "1000000000"),
        ({"seeds": {"Pick_Blocks_Size/1": [FIRST, FIRST]}}, "there twice"),
        ({"seeds": {"Pick_Blocks_Size/9": [FIRST]}}, "TASK/LEVEL"),
        ({"seeds": {"Pick_Blocks_Size/1": [True]}}, "whole number"),
        ({"extra": 1}, "unknown field 'extra'"),
    ],
)
def test_blocks_that_are_none_are_refused(
    tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    from robospa.leaderboard.bundle import canonical, sha256

    data = {**to_builtins(BLOCK), **change}
    (tmp_path / "b.json").write_text(json.dumps(data))
    with pytest.raises(BundleError, match=words):
        read_block(tmp_path / "b.json", sha256(canonical(data)))
