"""Defects that were confirmed in the nearest peer, one test each: this harness has none of them.

Named after what happens there. Real server, real sockets; processes where a run is resumed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import fault_server
import numpy as np
import pytest
from fault_server import ALWAYS, ONCE, FaultyServer
from numpy.typing import NDArray
from run_fakes import SPEC, FakePolicy, FakeWorld, KeyedPolicy, parts

from robospa.clients import connect
from robospa.harness.running import manifest
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.record_store import RecordWriter, read_actions
from robospa.harness.running.request import make_request
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.worker import Worker, WorkerConfig
from robospa.harness.settings import EvaluationSettings, updated
from robospa.harness.trial import run_trial
from robospa.protocol.errors import TransportError
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Timeouts
from robospa.results.records.manifest import (
    RunError,
    RunManifest,
    RunSettings,
    WorldSettings,
    make_manifest,
)
from robospa.results.records.runs import action_path, read_file, read_run
from robospa.results.scoring.scores import score_run
from robospa.trial import TrialKey

PATIENT = Timeouts(30, 30, 30, 30, 30, 30, 30, 0.2)


class Careful(KeyedPolicy):
    """A perfect policy whose actions say which observation they answer; a reset fails once."""

    failures = 1

    def reset(self, trial: TrialInfo) -> None:
        if Careful.failures:
            Careful.failures -= 1
            raise RuntimeError("CUDA error: device lost")
        super().reset(trial)

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        assert self.trial is not None
        answer = super().infer(observation)
        answer[:, 2] = observation["step"]
        answer[:, 3] = self.seed % 1000
        return answer


def keys(count: int) -> list[TrialKey]:
    return [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(count)]


def worker(url: str, folder: Path, timeouts: Timeouts = PATIENT) -> Worker:
    """A worker of a run, in this process."""
    options = {"timeouts": timeouts, "token": None}
    fakes = {"world": "run_fakes:FakeWorld", "parts": "run_fakes:parts"}
    return Worker(WorkerConfig(folder, url, options, **fakes), RecordWriter(folder))


def test_1_permanent_off_by_one_after_one_failed_reset(tmp_path: Path) -> None:
    """There: 0 of 4 succeed, and every action answers the observation before."""
    Careful.failures = 1
    with ServerThread(policy_factory=Careful) as server:
        one = worker(server.url, tmp_path)
        failed = one.run(TrialKey("Pick_Fake", 1, 100099), one.config.policy)
        assert (failed.end, failed.steps) == ("policy_error", 0)
        assert "device lost" in failed.message
        records = [one.run(key, one.config.policy) for key in keys(4)]
        one.close()
    assert [record.end for record in records] == ["success"] * 4
    for key in keys(4):
        actions, _ = read_actions(action_path(tmp_path, key))
        asked_at = [2 * (n // 2) for n in range(len(actions))]
        assert actions[:, 2].tolist() == asked_at
        assert set(actions[:, 3].tolist()) == {key.seed % 1000}


def test_2_an_episode_goes_on_at_a_server_that_restarted(tmp_path: Path) -> None:
    """There: the socket is opened again and the server goes on without an episode's start."""
    with FaultyServer("later", fault_server.restart) as url:
        one = worker(url, tmp_path, replace(PATIENT, wait=20))
        key = TrialKey("Pick_Fake", 1, ONCE)
        with pytest.raises(TransportError):
            one.run(key, one.config.policy)
        with pytest.raises(TransportError):  # nothing reconnects by itself
            one._policy.infer({"step": 4, "instruction": ""})
        one.recover()
        record = one.run(key, one.config.policy)
        one.close()
    alone = run_trial(FakeWorld(), FakePolicy(), key, policy_seed=0, parts=parts)
    assert (record.end, record.digest) == ("success", alone.digest)
    assert [r.end for r in read_file(one.writer.path)] == ["success"]


def request(url: str, folder: Path, resume: bool) -> Request:
    fakes = {"world": "run_fakes:FakeWorld", "parts": "run_fakes:parts"}
    config = WorkerConfig(folder, url, {"timeouts": PATIENT}, **fakes)
    options = RunOptions(workers=1, attempts=1 + resume, backoff=0.01)
    return Request(config, keys(10), options, resume=resume)


def test_3_and_6_infrastructure_errors_are_failures_and_a_resume_repeats_or_forgets_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There: 0.80 for ever, and a second run executes nothing, or without shards everything."""
    monkeypatch.setattr(manifest, "code_hash", lambda: "the same")
    lost = {ONCE, ALWAYS}
    with FaultyServer("first", fault_server.cut) as url:
        evaluate(request(url, tmp_path, resume=False))
    run = read_run(tmp_path)
    cell = score_run(run).cells["Pick_Fake", 1]
    assert cell.values["sr"] is not None and cell.values["sr"].value == 1.0
    assert (cell.trials, cell.missing, cell.worst, cell.best) == (8, 2, 0.8, 1.0)
    assert {key.seed for key in run.missing} == lost
    with FaultyServer("nowhere", fault_server.cut) as url:
        evaluate(request(url, tmp_path, resume=True))
    run = read_run(tmp_path)
    assert {key.seed for key, r in run.records.items() if r.attempts == 2} == lost
    assert not run.missing and not run.repeated
    assert sum(record.success for record in run.records.values()) == 10


class SlowStart(FakePolicy):
    """Compiles in its first call."""

    calls = 0

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        SlowStart.calls += 1
        if SlowStart.calls == 1:
            time.sleep(0.5)
        return super().infer(observation)


def test_4_a_slow_first_call_costs_an_episode(tmp_path: Path) -> None:
    """There: one episode, because the first answer has as little time as all others."""
    SlowStart.calls = 0
    with ServerThread(policy_factory=SlowStart) as server:
        one = worker(server.url, tmp_path, replace(PATIENT, infer=0.2))
        record = one.run(keys(1)[0], one.config.policy)
        one.close()
    assert (record.end, record.policy_calls, SlowStart.calls) == ("success", 1, 1)


@pytest.mark.parametrize(
    "changed", [{"run_seed": 7}, {"step_scale": 0.5}, {"control": "fixed_rate"}]
)
def test_5_a_resume_mixes_configurations(tmp_path: Path, changed: dict[str, Any]) -> None:
    """There: no warning, and the sum states the first configuration for all episodes."""

    def settings(**change: Any) -> RunManifest:
        chosen = updated(EvaluationSettings(), {"policy": "hold", "out": tmp_path, **change})
        asked = make_request(chosen, keys=keys(4))
        config = asked.config
        world = WorldSettings(config.world, dict(config.world_arguments))
        found = RunSettings(run_seed=config.run_seed, step_scale=config.step_scale, world=world)
        return make_manifest(found, asked.keys)

    manifest.open_run(tmp_path, settings(), resume=False)
    manifest.open_run(tmp_path, settings(), resume=True)
    name = next(iter(changed))
    with pytest.raises(RunError, match=f"started with other settings .*{name}"):
        manifest.open_run(tmp_path, settings(**changed), resume=True)


@pytest.mark.parametrize(
    ("dtype", "shape"),
    [("u1", (48, 64, 1)), ("u2", (48, 64, 1)), ("f4", (48, 64)), ("?", (4, 4, 1))],
)
def test_7_masks_and_depth_images_of_one_channel_raise(dtype: str, shape: tuple[int, ...]) -> None:
    """There: a TypeError in the encoder, so that every episode fails."""
    policy = FakePolicy()
    sent = (np.arange(np.prod(shape)) % 200).astype(dtype).reshape(shape)
    with ServerThread(policy) as server, connect(server.url, timeouts=PATIENT) as remote:
        remote.reset(TrialInfo("Pick_Fake", "aloha-agilex", "go"))
        state = np.zeros(14, np.float32)
        remote.infer({"step": 0, "instruction": "go", "images": {}, "state": state, "mask": sent})
    came = policy.seen[0]["mask"]
    assert came.dtype == sent.dtype and np.array_equal(came, sent)


class Wide(FakePolicy):
    width = 14

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        return np.ones((2, Wide.width), np.float32)


@pytest.mark.parametrize("width", [1, 7, 13, 15, 20, 28])
def test_8_actions_of_a_wrong_length_are_padded_or_cut(tmp_path: Path, width: int) -> None:
    """There: to 14, without a word. Here nothing is executed, served or in process."""
    Wide.width = width
    with ServerThread(policy_factory=Wide) as server:
        one = worker(server.url, tmp_path)
        record = one.run(keys(1)[0], one.config.policy)
        one.close()
    alone = run_trial(FakeWorld(), Wide(SPEC), keys(1)[0], policy_seed=0, parts=parts)
    for found in (record, alone):
        assert (found.end, found.success, found.steps) == ("policy_error", False, 0)
        assert f"{width} numbers per action" in found.message
