"""One policy behind several servers: real servers on loopback, real workers, a fake world."""

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
from numpy.typing import NDArray
from run_fakes import SPEC, FakePolicy

from robospa.harness.cli.main import main
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import finished, read_file, read_records, read_run, under_way
from robospa.trial import TrialKey

TASKS = ("Pick_Blocks_Size", "Pick_Blocks_Height", "Pick_Cans_Relational")
FAKES = ["--world", "run_fakes:FakeWorld", "--parts", "run_fakes:parts"]


class Site:
    """One server, which remembers the task of every trial that began there; `after` is what its
    answers wait for."""

    def __init__(self, name: str = "fake", delay: float = 0.0, **spec: Any) -> None:
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

        self.server = ServerThread(policy_factory=lambda: Noting(replace(SPEC, name=name, **spec)))

    def __enter__(self) -> Site:
        self.server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.server.stop()

    @property
    def url(self) -> str:
        return self.server.url

    @property
    def switches(self) -> int:
        return sum(a != b for a, b in pairwise(self.tasks))


def words(out: Path, *more: str, tasks: tuple[str, ...] = TASKS, trials: int = 4) -> list[str]:
    what = ["--tasks", ",".join(tasks), "--levels", "1-2", "--trials", str(trials)]
    seeds = ["--seeds", f"100000-{100000 + trials - 1}", "--backoff", "0.05", "--workers", "2"]
    return ["eval", *what, *seeds, *FAKES, "--out", str(out), *more]


def start(command: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "robospa.harness.cli.main", *command],
        env=dict(os.environ),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(command: list[str]) -> str:
    process = start(command)
    err = process.communicate(timeout=120)[1]
    assert process.returncode == 0, err
    return err


def refused(command: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit):
        main(command)
    err = capsys.readouterr().err
    assert len(err.strip().splitlines()) == 1
    return err


def test_two_servers_share_a_run_and_each_keeps_its_task(tmp_path: Path) -> None:
    with Site(delay=0.01) as first, Site(delay=0.01) as second:
        first.after, second.after = second.begun, first.begun  # a late worker finds trials left
        err = run(words(tmp_path / "run", first.url, "--policy", second.url))
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


def test_a_map_gives_every_server_its_own_task(tmp_path: Path) -> None:
    with Site("a") as first, Site("b") as second, Site("b") as third:
        path = tmp_path / "map.json"
        where = {TASKS[0]: first.url, TASKS[1]: [second.url, third.url], TASKS[2]: first.url}
        path.write_text(json.dumps(where))
        run(words(tmp_path / "run", "--policy-map", str(path)))
    assert (len(first.tasks), len(second.tasks) + len(third.tasks)) == (16, 8)
    assert set(second.tasks) | set(third.tasks) == {TASKS[1]}
    assert first.switches <= 3  # one change of task, and each worker may help out at the end
    about = read_run(tmp_path / "run").manifest.about.policies
    assert about[TASKS[1]].equals[0].target == third.url
    assert not about[TASKS[0]].equals


def test_a_server_that_dies_leaves_its_trials_to_the_other(tmp_path: Path) -> None:
    with Site(delay=0.03) as first, Site(delay=0.03) as second:
        process = start(words(tmp_path / "run", first.url, "--policy", second.url, trials=10))
        assert first.begun.wait(30)
        first.server.stop()
        err = process.communicate(timeout=120)[1]
        assert process.returncode == 0, err
    assert f"{first.url} is away" in err
    lines = [r for p in (tmp_path / "run" / "trials").glob("*.jsonl") for r in read_file(p)]
    results = [r for r in lines if finished(r)]
    assert len(results) == len({r.key for r in results}) == 60
    assert all(r.success and r.attempts == len(r.retries) + 1 for r in results)
    assert max(r.attempts for r in results) <= 2
    lost = {row.key for row in lines if not finished(row) and not under_way(row)}
    assert lost <= {r.key for r in results if r.retries}


def test_servers_with_different_specs_are_not_one_policy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Site("one") as first, Site("two", execute=3) as second:
        command = words(tmp_path / "run", first.url, "--policy", second.url)
        err = refused(command, capsys)
        assert f"{first.url} and {second.url} are not the same" in err
        assert "spec.execute is None and 3; spec.name is 'one' and 'two'" in err
        path = tmp_path / "map.json"
        path.write_text(json.dumps({task: [first.url, second.url] for task in TASKS}))
        err = refused(words(tmp_path / "run", "--policy-map", str(path)), capsys)
        assert f"{second.url} of {TASKS[0]} are not the same" in err
    assert not (tmp_path / "run").exists()


def test_workers_come_while_others_wait_and_the_server_has_room(tmp_path: Path) -> None:
    notes: list[str] = []
    keys = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(30)]
    with Site(delay=0.05) as site:
        config = WorkerConfig(
            tmp_path, site.url, world="run_fakes:FakeWorld", parts="run_fakes:parts"
        )
        runner = Runner(config, keys, RunOptions(workers=1, most=2), on_note=notes.append)
        runner.run()
    assert notes == ["workers wait while cores idle: 1 more, 2 now"]
    assert sorted(read_records(tmp_path)) == keys
    assert runner.times.overall_shares()["waiting"] > 0.5
