"""A run is what its manifest says, and a resume must say the same."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from robospa.harness.running.manifest import (
    Manifest,
    about_machine,
    changed_settings,
    open_run,
    seed_hash,
    write_manifest,
)
from robospa.results.records.manifest import RunError, manifest_keys, read_manifest
from robospa.trial import TrialKey

KEYS = tuple(TrialKey("Pick_Fake", level, seed) for level in (1, 2) for seed in (5, 6))
MANIFEST = Manifest({"policy": {"name": "fake", "horizon": 4}, "split": "heldout"}, KEYS, {})


def test_the_trial_list_survives_the_file(tmp_path: Path) -> None:
    write_manifest(tmp_path, MANIFEST)
    assert manifest_keys(read_manifest(tmp_path)) == KEYS


def test_the_seed_hash_ignores_order_and_nothing_else() -> None:
    assert seed_hash(KEYS) == seed_hash(reversed(KEYS))
    assert seed_hash(KEYS) != seed_hash(KEYS[:-1])


def test_a_run_is_not_overwritten(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, resume=False)
    with pytest.raises(RunError, match="--resume"):
        open_run(tmp_path, MANIFEST, resume=False)


def test_resuming_with_the_same_settings_leaves_the_manifest_alone(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, resume=False)
    before = (tmp_path / "run.json").read_bytes()
    open_run(tmp_path, replace(MANIFEST, about={"machine": "another"}), resume=True)
    assert (tmp_path / "run.json").read_bytes() == before


def test_resuming_with_other_settings_names_what_changed(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, resume=False)
    settings = {"policy": {"name": "fake", "horizon": 5}, "split": "heldout"}
    with pytest.raises(RunError, match=r"policy\.horizon: 4 -> 5"):
        open_run(tmp_path, replace(MANIFEST, settings=settings), resume=True)


def test_resuming_with_other_trials_is_refused(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, resume=False)
    with pytest.raises(RunError, match="trials: 0 new and 1 gone"):
        open_run(tmp_path, replace(MANIFEST, keys=KEYS[1:]), resume=True)


def test_resuming_with_another_version_is_refused(tmp_path: Path) -> None:
    about = {"versions": {"robospa": "1"}}
    open_run(tmp_path, replace(MANIFEST, about=about), resume=False)
    with pytest.raises(RunError, match=r"versions\.robospa: '1' -> '2'"):
        open_run(tmp_path, replace(MANIFEST, about={"versions": {"robospa": "2"}}), resume=True)


def test_resuming_nothing_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(RunError, match="no run"):
            open_run(folder, MANIFEST, resume=True)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(RunError, match="neither empty nor a run"):
        open_run(tmp_path, MANIFEST, resume=False)
    with pytest.raises(RunError, match="is a file"):
        open_run(tmp_path / "thesis.tex", MANIFEST, resume=False)


@pytest.mark.parametrize("text", ["{", "[]", '{"trials": 3}'])
def test_a_broken_manifest_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(RunError, match=r"run\.json"):
        read_manifest(tmp_path)


def test_a_malformed_trial_list_is_named() -> None:
    with pytest.raises(RunError, match=r"list of trials: .* lacks the field 'level'"):
        manifest_keys({"trials": [{"task": "x"}]})


def test_settings_that_appear_count_as_changed() -> None:
    assert changed_settings({}, {"a": 1}) == ["a: 'unset' -> 1"]


def test_the_machine_is_described_in_json() -> None:
    about = json.loads(json.dumps(about_machine({"simulator": "fake"})))
    assert about["world"] == {"simulator": "fake"}
    assert set(about["versions"]) == {"robospa", "python", "numpy", "sapien"}
