"""What a run cannot be resumed from, and what it can, in one sentence each."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from robospa.harness.running.manifest import Manifest, check_folder, open_run, write_manifest
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.manifest import RunError, manifest_keys, read_manifest
from robospa.results.records.run_io import read_records
from robospa.trial import TrialKey

KEYS = tuple(TrialKey("Pick_Fake", level, seed) for level in (1, 2) for seed in (5, 6))
MANIFEST = Manifest({"run_seed": 0}, tuple(KEYS), {"code": "a", "versions": {"numpy": "2"}}, {})


def edit(folder: Path, **changes: Any) -> None:
    path = folder / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"format": 2}, "has format 2, and this robospa reads up to 1: use the version"),
        ({"format": "new"}, "has format new"),
        ({"about": {"code": "b", "versions": {"numpy": "2"}}}, "code: 'b' -> 'a'"),
        ({"about": {"code": "a", "versions": {"numpy": "1"}}}, "versions.numpy: '1' -> '2'"),
        ({"about": {}}, "code"),
        ({"settings": {"run_seed": 7}}, "run_seed: 7 -> 0"),
        ({"settings": [1]}, "'settings' must be a map, not a list"),
        ({"trials": []}, f"trials: {len(KEYS)} new and 0 gone"),
        ({"trials": 3}, "it has no list of trials"),
        ({"trials": [{"task": "A"}]}, "'[0]' lacks the field 'level'"),
    ],
)
def test_another_run_is_not_gone_on_with(
    tmp_path: Path, changes: dict[str, Any], sentence: str
) -> None:
    write_manifest(tmp_path, MANIFEST)
    edit(tmp_path, **changes)
    with pytest.raises(RunError) as caught:
        open_run(tmp_path, MANIFEST, resume=True)
    text = str(caught.value)
    assert sentence in text and "\n" not in text


@pytest.mark.parametrize(
    "text", ["", "{", "[" * 100_000, '{"a": 1, "a": 2}', '{"trials": "\\ud800"}']
)
def test_a_manifest_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(RunError, match=r"run\.json"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("task", "../../x", r"'\[0\]\.task' must be a plain name .* not '\.\./\.\./x'"),
        ("task", 3, r"'\[0\]\.task' must be text, not 3"),
        ("level", "1", r"'\[0\]\.level' must be a whole number, not '1'"),
        ("seeds", "123", r"'\[0\]\.seeds' must be a list, not '123'"),
        ("seeds", [1e308], r"'\[0\]\.seeds\[0\]' must be a whole number, not 1e\+308"),
    ],
)
def test_names_that_would_be_paths_and_numbers_that_are_none_are_refused(
    tmp_path: Path, name: str, value: Any, sentence: str
) -> None:
    write_manifest(tmp_path, MANIFEST)
    rows = json.loads((tmp_path / "run.json").read_text())["trials"]
    rows[0][name] = value
    with pytest.raises(RunError, match=f"manifest's list of trials: {sentence}"):
        manifest_keys({"trials": rows})


def test_files_of_somebody_else_are_not_written_into(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(RunError, match="neither empty nor a run; choose another --out"):
        check_folder(tmp_path, resume=False)
    with pytest.raises(RunError, match=r"no run in .* to resume; leave --resume out"):
        check_folder(tmp_path, resume=True)


def test_a_driver_killed_before_its_first_file_leaves_a_folder_to_start_in(tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    (tmp_path / ".run.json.123.part").touch()
    check_folder(tmp_path, resume=False)


def test_a_clock_that_goes_backwards_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [2e9]

    def backwards() -> float:
        now[0] -= 1000.0
        return now[0]

    monkeypatch.setattr(time, "time", backwards)
    config = WorkerConfig(
        tmp_path, "run_fakes:FakePolicy", world="run_fakes:FakeWorld", parts="run_fakes:parts"
    )
    Runner(config, KEYS[:2], RunOptions()).run()
    assert set(read_records(tmp_path)) == set(KEYS[:2])
