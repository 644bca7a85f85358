"""`robospa collect` from the command line: what it prints."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import robospa
from tiny_datasets import tiny_dataset

from robospa.harness.datasets import collect
from robospa.harness.datasets.collect import CollectionResult


def test_what_was_made_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, lines = tmp_path / "set", ("too few of Pick_Blocks_Size L1",)

    def made(*_: object, say: Callable[[str], None], **given: object) -> CollectionResult | None:
        say("6 episodes of 2 variants")
        return None if given["resume"] else CollectionResult((out,), 5, lines)

    monkeypatch.setattr(collect, "make", made)
    done = robospa("collect", "--tasks", "Pick_Blocks_Size", "--out", out, "--json")
    wanted = {"out": str(out), "finished_before": False, "folders": [str(out)], "episodes": 5}
    assert done.code == 1 and json.loads(done.out) == {**wanted, "missing": list(lines)}
    assert done.err.splitlines() == ["6 episodes of 2 variants", f"robospa: {lines[0]}"]
    done = robospa("collect", "--tasks", "Pick_Blocks_Size", "--out", out, "--resume", "--json")
    assert json.loads(done.out) == {"out": str(out), "finished_before": True}


def test_what_was_verified_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (episode,) = tiny_dataset(tmp_path, "robotwin-hdf5", "png", count=1)
    ending = (True, episode.replay_digest)
    simulator = "robospa.harness.datasets.verify.in_simulator"
    monkeypatch.setattr(simulator, lambda: lambda line, commanded: ending)
    words = ("collect", "--verify", tmp_path, "--json")
    done = robospa(*words)
    found = json.loads(done.out)
    assert (
        done.code == 0 and found["sound"] and len(found["folders"][str(tmp_path)]["checked"]) == 3
    )
    (tmp_path / "notes.txt").write_text("mine")
    done = robospa(*words)
    (problem,) = json.loads(done.out)["folders"][str(tmp_path)]["problems"]
    assert done.code == 1 and problem.startswith("notes.txt is not part of the data set")
