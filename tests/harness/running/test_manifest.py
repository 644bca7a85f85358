"""A run is what its manifest says, and a resume must say the same."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from robospa.harness.running.manifest import (
    about_machine,
    check_folder,
    open_run,
    write_manifest,
)
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.manifest import (
    PolicySettings,
    Processor,
    RunAbout,
    RunError,
    RunSettings,
    make_manifest,
    read_manifest,
    seed_hash,
)
from robospa.results.records.runs import read_records
from robospa.trial import TrialKey

KEYS = tuple(TrialKey("Pick_Fake", level, seed) for level in (1, 2) for seed in (5, 6))
SETTINGS = RunSettings(policy=PolicySettings({"name": "fake", "horizon": 4}), split=("heldout",))
MANIFEST = make_manifest(SETTINGS, KEYS, RunAbout(code="a", versions={"numpy": "2"}))


def edit(folder: Path, **changes: Any) -> None:
    path = folder / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def test_the_manifest_survives_the_file(tmp_path: Path) -> None:
    write_manifest(tmp_path, MANIFEST)
    found = read_manifest(tmp_path)
    assert found == MANIFEST and found.keys == KEYS and found.policy.horizon == 4
    text = (tmp_path / "run.json").read_text()
    assert "clock" not in text and "salt" not in text  # what has no value is left out


def test_the_seed_hash_ignores_order_and_nothing_else() -> None:
    assert seed_hash(KEYS) == seed_hash(reversed(KEYS))
    assert seed_hash(KEYS) != seed_hash(KEYS[:-1])


def test_resuming_only_counts_drivers_and_kinds_of_processors(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, resume=False)
    two = tuple(Processor(vendor) for vendor in ("A", "B"))
    for there in (two[:1], two, two[:1]):
        about = structs.replace(MANIFEST.about, machine={"name": "another"}, processors=there)
        open_run(tmp_path, structs.replace(MANIFEST, about=about), resume=True)
    about = structs.replace(MANIFEST.about, drivers=4, processors=two)
    assert read_manifest(tmp_path) == structs.replace(MANIFEST, about=about)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": 2}, "reads up to 1"),
        ({"format": "new"}, "has format new"),
        ({"about": {"code": "b", "versions": {"numpy": "2"}}}, "code: 'b' -> 'a'"),
        ({"about": {"code": "a", "versions": {"numpy": "1"}}}, r"versions.numpy: '1' -> '2'"),
        ({"about": {}}, "code"),
        ({"settings": {"split": ["heldout"]}}, r"policy\.spec\.horizon: 'unset' -> 4"),
        ({"settings": {"run_seed": 7}}, "run_seed: 7 -> 0"),
        ({"settings": [1]}, "'settings' must be a map"),
        ({"trials": []}, f"trials: {len(KEYS)} new and 0 gone"),
        ({"trials": 3}, "no list of trials"),
        ({"trials": [{"task": "A"}]}, "lacks the field 'level'"),
    ],
)
def test_another_run_is_not_gone_on_with(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    write_manifest(tmp_path, MANIFEST)
    edit(tmp_path, **changes)
    with pytest.raises(RunError, match=words):
        open_run(tmp_path, MANIFEST, resume=True)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "[" * 100_000, '{"a": 1, "a": 2}', '{"trials": "\\ud800"}']
)
def test_a_manifest_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(RunError, match=r"run\.json"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("task", "../../x"),
        ("task", 3),
        ("level", "1"),
        ("seeds", "123"),
        ("seeds", [1e308]),
    ],
)
def test_names_that_would_be_paths_and_numbers_that_are_none_are_refused(
    tmp_path: Path, name: str, value: Any
) -> None:
    write_manifest(tmp_path, MANIFEST)
    rows = json.loads((tmp_path / "run.json").read_text())["trials"]
    rows[0][name] = value
    edit(tmp_path, trials=rows)
    with pytest.raises(RunError, match=rf"trials\[0\]\.{name}"):
        read_manifest(tmp_path)


def test_a_folder_that_holds_something_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    for folder, resume, words in (
        (tmp_path, False, "neither empty nor a run"),
        (tmp_path / "thesis.tex", False, "is a file"),
        (tmp_path, True, "no run"),
        (tmp_path / "none", True, "no run"),
        (tmp_path / ("n" * 300), False, "cannot be a folder: File name too long"),
    ):
        with pytest.raises(RunError, match=words):
            open_run(folder, MANIFEST, resume)
    open_run(tmp_path / "run", MANIFEST, resume=False)
    with pytest.raises(RunError, match="--resume"):
        open_run(tmp_path / "run", MANIFEST, resume=False)


def test_a_driver_killed_before_its_first_file_leaves_a_folder_to_start_in(tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    (tmp_path / ".run.json.123.part").touch()
    check_folder(tmp_path, resume=False)


def test_the_machine_is_described() -> None:
    about = about_machine({"simulator": "fake"})
    assert about.world == {"simulator": "fake"}
    assert set(about.versions) == {"robospa", "python", "numpy", "sapien"}
    assert about.processors[0].vendor in str(about.processors[0])


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
