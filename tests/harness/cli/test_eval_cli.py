"""`robospa eval` from the outside: a real server on loopback, real workers, a fake world.

What is watched or stopped while it runs has a process of its own; the others share this one.
"""

import itertools
import json
import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import eval_words, robospa, start
from fake_runs import results
from numpy.typing import NDArray
from run_fakes import SPEC, FakePolicy, NanPolicy

from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import read_run

quickly = pytest.mark.usefixtures("world_asked_here")


class Gate:
    """A server's policies that get nowhere from the seventh trial on, until it is open."""

    def __init__(self, checkpoint: str = "") -> None:
        self.spec = replace(SPEC, checkpoint=checkpoint)
        self.trials = itertools.count()
        self.reached = threading.Event()
        self.opened = threading.Event()

    def policy(self) -> FakePolicy:
        gate = self

        class Gated(FakePolicy):
            def reset(self, trial: TrialInfo) -> None:
                self.free = next(gate.trials) < 6
                super().reset(trial)

            def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
                answer = super().infer(observation)
                if self.free or gate.opened.is_set():
                    return answer
                gate.reached.set()
                gate.opened.wait(0.5)
                return 0 * answer

        return Gated(self.spec)


@quickly
def test_a_nonsense_answer_is_the_policys_failure(tmp_path: Path) -> None:
    folder = tmp_path / "my run"
    with ServerThread(policy_factory=NanPolicy) as server:
        code, out, err = robospa(*eval_words(folder, server.url, trials=1))
    assert code == 1
    assert "policy error 2: the policy answered nan in action 1, dimension 3" in out
    assert "2 of 2 trials ended in a policy error" in err
    assert f"`robospa report '{folder}' --failures`" in err  # as a shell takes it
    records = results(folder)
    assert [r.end for r in records] == ["policy_error"] * 2
    assert "action 1" in records[0].message


@quickly
def test_a_server_that_is_too_slow_leaves_trials_missing(tmp_path: Path) -> None:
    class Asleep(FakePolicy):
        def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
            time.sleep(0.5)
            return super().infer(observation)

    with ServerThread(policy_factory=Asleep) as server:
        more = ["--first-timeout", "0.1", "--attempts", "2"]
        code, out, err = robospa(*eval_words(tmp_path / "run", server.url, *more, trials=1))
    assert code == 1
    assert "2 of 2 trials could not be run and are missing" in err
    assert "missing" in out
    lost = read_run(tmp_path / "run").records.values()
    assert [(r.end, r.attempts) for r in lost] == [("infrastructure", 2)] * 2
    assert {row.cause for r in lost for row in r.retries} == {"deadline"}


def test_a_server_that_goes_away_and_comes_back_costs_nothing(tmp_path: Path) -> None:
    gate = Gate()
    server = ServerThread(policy_factory=gate.policy).start()
    port = int(server.url.rpartition(":")[2])
    process = start(eval_words(tmp_path / "run", server.url, "--attempts", "9", trials=20))
    assert gate.reached.wait(60)
    server.stop()
    with ServerThread(policy_factory=FakePolicy, port=port):
        _, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "trying again" in err
    found = read_run(tmp_path / "run")
    assert len(found.records) == len(found.keys) == 40 and not found.repeated
    assert all(r.success for r in found.records.values())


@pytest.fixture
def heeds_ctrl_c() -> Iterator[None]:
    """Tests that a script starts in the background ignore Ctrl-C, and so would their children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeds_ctrl_c")
def test_ctrl_c_leaves_a_run_that_can_be_resumed(tmp_path: Path) -> None:
    gate = Gate("c1")
    with ServerThread(policy_factory=gate.policy) as server:
        words = eval_words(tmp_path / "run", server.url, trials=60)
        process = start(words)
        assert gate.reached.wait(60)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
        gate.opened.set()
        assert process.returncode == 130
        assert "--resume" in err
        assert "Traceback" not in err
        before = read_run(tmp_path / "run")
        assert 0 < len(before.missing) < 120

        code, _, err = robospa(*words, "--timeout", "50")
        assert code == 1
        assert "already holds a run" in err

        code, _, err = robospa(*words, "--split", "train", "--resume")
        assert code == 1
        assert "split" in err and "trials: 120 new and 120 gone" in err

        code, _, err = robospa(*words)  # the same command of a policy that names its weights
    assert code == 0 and f"going on with the run in {tmp_path / 'run'}" in err
    code, _, err = robospa(*words)
    assert code == 1 and "already holds a run" in err  # it is finished
    records = results(tmp_path / "run")
    assert len(records) == len({r.key for r in records}) == 120


@quickly
def test_a_run_is_repeated_from_the_settings_that_it_keeps(tmp_path: Path) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    code, _, err = robospa(
        *eval_words(first, "run_fakes:FakePolicy", "--token", "secret", trials=2)
    )
    assert code == 0, err
    kept = first / "settings.toml"
    assert "secret" not in kept.read_text()
    words = ["eval", "--config", str(kept)]
    code, _, err = robospa(*words)
    assert code == 1 and "already holds a run" in err
    assert robospa(*words, "--resume")[0] == 0
    code, _, err = robospa(*words, "--out", str(again), "--workers", "1")
    assert code == 0, err
    before, after = read_run(first), read_run(again)
    assert before.keys == after.keys
    assert {key: record.digest for key, record in before.records.items()} == {
        key: record.digest for key, record in after.records.items()
    }
    assert before.manifest.about.arguments | {"out": str(again), "workers": 1} == (
        after.manifest.about.arguments
    )


@quickly
def test_seeds_from_a_file_and_scores_as_json(tmp_path: Path) -> None:
    path = tmp_path / "seeds.json"
    path.write_text(json.dumps({"Pick_Blocks_Size": {"1": [7], "2": [9]}}))
    more = ("--seeds", str(path), "--json")
    code, out, err = robospa(*eval_words(tmp_path / "run", "run_fakes:FakePolicy", *more, trials=1))
    assert code == 0, err
    found = json.loads(out)
    assert (found["folder"], found["trials"], found["missing"]) == (str(tmp_path / "run"), 2, 0)
    assert found["tasks"]["Pick_Blocks_Size"]["sr"][0] == 1.0
    assert sorted((r.key.level, r.key.seed) for r in results(tmp_path / "run")) == [(1, 7), (2, 9)]
