"""Every listed trial is settled once, whatever dies on the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robospa.harness.running.executor import RunAborted
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.runs import finished, read_file, read_records
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KILLS = int(os.environ.get("ROBOSPA_KILLS", "2"))
QUICK = RunOptions(workers=2, backoff=0.01)


def keys(count: int = 8) -> list[TrialKey]:
    return [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(count)]


def go(
    folder: Path, policy: str, trials: list[TrialKey], options: RunOptions = QUICK
) -> tuple[list[TrialRecord], list[str]]:
    records: list[TrialRecord] = []
    notes: list[str] = []
    config = WorkerConfig(
        folder, f"run_fakes:{policy}", world="run_fakes:FakeWorld", parts="run_fakes:parts"
    )
    Runner(config, trials, options, records.append, notes.append).run()
    return records, notes


def results(folder: Path) -> list[TrialRecord]:
    files = sorted((folder / "trials").glob("*.jsonl"))
    return [r for path in files for r in read_file(path) if finished(r)]


def digests(folder: Path) -> dict[TrialKey, tuple[str, str]]:
    return {k: (r.digest, r.actions_digest) for k, r in read_records(folder).items()}


def test_every_trial_is_run_once_and_alike_with_one_worker_or_two(tmp_path: Path) -> None:
    go(tmp_path / "one", "FakePolicy", keys(), RunOptions(workers=1))
    go(tmp_path / "two", "FakePolicy", keys(), RunOptions(workers=2))
    assert digests(tmp_path / "one") == digests(tmp_path / "two")
    assert sorted(r.key for r in results(tmp_path / "two")) == keys()


def test_action_traces_lie_beside_the_records(tmp_path: Path) -> None:
    go(tmp_path, "FakePolicy", keys(2))
    assert len(list((tmp_path / "actions").glob("*.npz"))) == 2


def test_a_lost_line_is_tried_again_from_the_same_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MARKS", str(tmp_path))
    records, notes = go(tmp_path, "FlakyPolicy", keys(4))
    assert {r.key.seed: r.attempts for r in records} == {
        100000: 1,
        100001: 2,
        100002: 1,
        100003: 2,
    }
    assert all(r.success for r in records)
    assert "the line went dead; trying again" in notes[0]


def test_a_trial_that_cannot_be_run_is_missing_and_not_a_failure(tmp_path: Path) -> None:
    records, _ = go(tmp_path, "GonePolicy", keys(2))
    assert [(r.end, r.attempts) for r in records] == [("infrastructure", 3)] * 2
    assert "nobody answers" in records[0].message
    assert records[0].candidates == 2
    assert not any(finished(r) for r in read_records(tmp_path).values())


def test_a_server_that_stays_away_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunAborted, match="3 trials in a row"):
        go(tmp_path, "GonePolicy", keys(8), RunOptions(attempts=1, give_up=3))


def test_nan_is_the_policys_failure_and_not_retried(tmp_path: Path) -> None:
    records, _ = go(tmp_path, "NanPolicy", keys(2))
    assert [(r.end, r.attempts) for r in records] == [("policy_error", 1)] * 2


def test_an_unstable_seed_is_not_tried_twice(tmp_path: Path) -> None:
    records, _ = go(tmp_path, "FakePolicy", [TrialKey("Pick_Fake", 1, 666)])
    assert [(r.end, r.attempts) for r in records] == [("infrastructure", 1)]


def test_a_model_that_cannot_be_made_is_not_tried_twice(tmp_path: Path) -> None:
    broken, sound = TrialKey("Pick_Fake", 1, 667), TrialKey("Pick_Fake", 1, 1)
    records, _ = go(tmp_path, "FakePolicy", [broken, sound])
    found = {r.key.seed: (r.end, r.attempts, r.message) for r in records}
    assert found[667] == ("infrastructure", 1, "the model of seed 667 has no mesh")
    assert found[1][0] == "success"


def test_dead_and_stuck_workers_are_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_MARKS", str(tmp_path))
    options = RunOptions(workers=2, backoff=0.01, trial_seconds=4.0)
    records, notes = go(tmp_path, "SuicidalPolicy", keys(), options)
    assert sorted(r.key for r in records) == keys()
    assert all(r.success for r in records)
    assert any("signal 9" in note for note in notes)
    assert any("was stuck for 4 s" in note for note in notes)


def test_a_record_on_disk_counts_although_its_worker_died_before_saying_so(
    tmp_path: Path,
) -> None:
    records, _ = go(tmp_path, "LastWordsPolicy", keys())
    assert sorted(r.key for r in records) == sorted(r.key for r in results(tmp_path)) == keys()


def test_a_policy_that_does_not_exist_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunAborted, match="run_fakes:Nobody"):
        go(tmp_path, "Nobody", keys(1))


DRIVER = """
import sys
from pathlib import Path
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.atomic_file import run_lock
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.runs import finished, read_records
from robospa.results.records.trial_record import TrialKey

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    config = WorkerConfig(folder, "run_fakes:CountedPolicy", world="run_fakes:FakeWorld",
                          parts="run_fakes:parts")
    keys = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(int(sys.argv[2]))]
    with run_lock(folder):
        known = read_records(folder)
        owed = [k for k in keys if not finished(known.get(k))]
        Runner(config, owed, RunOptions(attempts=10), known=known).run()
"""


def test_killing_the_driver_loses_and_doubles_nothing_and_counts_as_an_attempt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script, folder, begun = tmp_path / "driver.py", tmp_path / "run", tmp_path / "begun"
    script.write_text(DRIVER)
    begun.mkdir()
    monkeypatch.setenv("FAKE_MARKS", str(begun))
    command = [sys.executable, str(script), str(folder), str(3 * KILLS)]
    codes = [1]
    while codes[-1]:
        codes.append(subprocess.run(command, stderr=subprocess.DEVNULL, timeout=60).returncode)
    records = read_records(folder)
    assert len(records) == len(results(folder)) == 3 * KILLS
    true = {int(mark.name): mark.stat().st_size for mark in begun.iterdir()}
    counted = {key.seed: r.attempts for key, r in records.items()}
    print(f"{len(codes) - 2} drivers killed, {sum(true.values())} attempts")
    assert counted == true
    assert all(count > 1 for seed, count in true.items() if seed % 6 == 0)
    assert {x.cause for r in records.values() for x in r.retries} == {"interrupted"}
