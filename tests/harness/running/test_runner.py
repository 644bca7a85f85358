"""Every listed trial is settled once, whatever dies on the way."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import eval_words, robospa, start
from fake_runs import digests, lines, results
from numpy.typing import NDArray
from run_fakes import SPEC, FakePolicy, fake_config, trial_keys

from robospa.harness.running.executor import RunAborted
from robospa.harness.running.runner import Runner, RunOptions
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import finished, read_records, read_run, under_way
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KILLS = int(os.environ.get("ROBOSPA_KILLS", "2"))
QUICK = RunOptions(workers=2, backoff=0.01)


KEYS = trial_keys(8)


def go(
    folder: Path, policy: str, trials: list[TrialKey], options: RunOptions = QUICK
) -> tuple[list[TrialRecord], list[str]]:
    records: list[TrialRecord] = []
    notes: list[str] = []
    config = fake_config(folder, f"run_fakes:{policy}")
    Runner(config, trials, options, records.append, notes.append).run()
    return records, notes


def test_every_trial_is_run_once_and_alike_with_one_worker_or_two(tmp_path: Path) -> None:
    go(tmp_path / "one", "FakePolicy", KEYS, RunOptions(workers=1))
    go(tmp_path / "two", "FakePolicy", KEYS, RunOptions(workers=2))
    assert digests(tmp_path / "one") == digests(tmp_path / "two")
    assert sorted(r.key for r in results(tmp_path / "two")) == KEYS


def test_a_server_that_stays_away_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunAborted, match="3 trials in a row"):
        go(tmp_path, "GonePolicy", KEYS, RunOptions(attempts=1, give_up=3))


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
    records, notes = go(tmp_path, "SuicidalPolicy", KEYS, options)
    assert sorted(r.key for r in records) == KEYS
    assert all(r.success for r in records)
    assert any("signal 9" in note for note in notes)
    assert any("was stuck for 4 s" in note for note in notes)


def test_a_record_on_disk_counts_although_its_worker_died_before_saying_so(tmp_path: Path) -> None:
    records, _ = go(tmp_path, "LastWordsPolicy", KEYS)
    assert sorted(r.key for r in records) == sorted(r.key for r in results(tmp_path)) == KEYS


def test_a_policy_that_does_not_exist_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunAborted, match="run_fakes:Nobody"):
        go(tmp_path, "Nobody", KEYS[:1])


DRIVER = """
import sys
from pathlib import Path
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.atomic_file import run_lock
from robospa.results.records.runs import finished, read_records
from run_fakes import fake_config, trial_keys

folder = Path(sys.argv[1])
config = fake_config(folder, "run_fakes:CountedPolicy")
with run_lock(folder):
    known = read_records(folder)
    owed = [k for k in trial_keys(int(sys.argv[2])) if not finished(known.get(k))]
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


# ---------- one policy behind several servers: real servers on loopback, real workers, a fake world


TASKS = ("Pick_Blocks_Size", "Pick_Blocks_Height", "Pick_Cans_Relational")


class Site(ServerThread):
    """One server, which remembers the task of every trial that began there; `after` is what its
    answers wait for."""

    def __init__(self, name: str = "fake", delay: float = 0.0, **changes: Any) -> None:
        self.tasks: list[str] = []
        self.begun = threading.Event()
        self.after: threading.Event | None = None
        site = self

        class Noting(FakePolicy):
            def reset(self, trial: TrialInfo) -> None:
                super().reset(trial)
                site.tasks.append(trial.task)
                site.begun.set()

            def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
                if site.after is not None:
                    site.after.wait(30)
                if delay:
                    threading.Event().wait(delay)
                return super().infer(observation)

        spec = replace(SPEC, name=name, **changes)
        super().__init__(policy_factory=lambda: Noting(spec))

    @property
    def switches(self) -> int:
        return sum(a != b for a, b in pairwise(self.tasks))


def words(out: Path, *more: str, trials: int = 4) -> list[str]:
    return eval_words(out, "--tasks", ",".join(TASKS), *more, trials=trials)


def ended(process: subprocess.Popen[str]) -> str:
    """What it said until it ended well."""
    err = process.communicate(timeout=120)[1]
    assert process.returncode == 0, err
    return err


def refused(command: list[str]) -> str:
    err = robospa(*command).err
    assert len(err.strip().splitlines()) == 1
    return err


def test_two_servers_share_a_run_and_each_keeps_its_task(tmp_path: Path) -> None:
    with Site(delay=0.01) as first, Site(delay=0.01) as second:
        first.after, second.after = second.begun, first.begun  # a late worker finds trials left
        err = ended(start(words(tmp_path / "run", first.url, "--policy", second.url)))
        assert first.url in err and second.url in err  # the summary names both
        assert "queue" in err and "waiting" in err
    found = read_run(tmp_path / "run")
    assert len(found.records) == 24 and not found.missing
    assert len(first.tasks) + len(second.tasks) == 24
    assert first.tasks and second.tasks
    # Three tasks on two servers: one change of task is needed, each may help out now and then at
    # the end, more often where a worker comes late. Without tasks of their own it would be 15.
    assert first.switches + second.switches <= 6
    about = found.manifest.about.policy
    assert about.target == first.url
    assert [server.target for server in about.equals] == [second.url]
    assert all("queue" in r.latency and r.latency["batch"] == 1 for r in found.records.values())


def test_a_server_that_dies_leaves_its_trials_to_the_other(tmp_path: Path) -> None:
    with Site(delay=0.03) as first, Site(delay=0.03) as second:
        process = start(words(tmp_path / "run", first.url, "--policy", second.url, trials=10))
        assert first.begun.wait(30)
        first.stop()
        assert f"{first.url} is away" in ended(process)
    found = results(tmp_path / "run")
    assert len(found) == len({r.key for r in found}) == 60
    assert all(r.success and r.attempts == len(r.retries) + 1 for r in found)
    assert max(r.attempts for r in found) <= 2
    rows = lines(tmp_path / "run")
    lost = {row.key for row in rows if not finished(row) and not under_way(row)}
    assert lost <= {r.key for r in found if r.retries}


def test_servers_with_different_specs_are_not_one_policy(tmp_path: Path) -> None:
    with Site("one") as first, Site("two", execute=3) as second:
        command = words(tmp_path / "run", first.url, "--policy", second.url)
        err = refused(command)
        assert f"{first.url} and {second.url} are not the same" in err
        assert "spec.execute is None and 3; spec.name is 'one' and 'two'" in err
        path = tmp_path / "map.json"
        path.write_text(json.dumps({task: [first.url, second.url] for task in TASKS}))
        err = refused(words(tmp_path / "run", "--policy-map", str(path)))
        assert f"{second.url} of {TASKS[0]} are not the same" in err
    assert not (tmp_path / "run").exists()


def test_workers_come_while_others_wait_and_the_server_has_room(tmp_path: Path) -> None:
    notes: list[str] = []
    keys = trial_keys(30)
    with Site(delay=0.05) as site:
        config = fake_config(tmp_path, site.url)
        runner = Runner(config, keys, RunOptions(workers=1, most=2), on_note=notes.append)
        runner.run()
    assert notes == ["workers wait while cores idle: 1 more, 2 now"]
    assert sorted(read_records(tmp_path)) == keys
    assert runner.times.overall_shares()["waiting"] > 0.5
