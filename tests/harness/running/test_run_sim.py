"""The real simulator: the number of workers does not enter a record."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.observation import CameraSpec, Observation
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import differences, read_records
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim

KEYS = [
    TrialKey(task, level, 100000)
    for task in ("Pick_Blocks_Size", "Press_Stapler_Repeat", "Stack_Blocks_Color_Order")
    for level in (1, 3)
]


def test_records_are_equal_to_the_bit_whatever_the_workers(tmp_path: Path) -> None:
    for name, workers in (("one", 1), ("two", 2)):
        config = WorkerConfig(tmp_path / name, "robospa.baselines.oracle:create")
        keys = KEYS if name == "one" else KEYS[::-1]
        Runner(config, keys, RunOptions(workers=workers)).run()
    one, two = read_records(tmp_path / "one"), read_records(tmp_path / "two")
    assert set(one) == set(two) == set(KEYS)
    assert [differences(one[key], two[key]) for key in KEYS] == [[] for _ in KEYS]
    assert all(len(record.digest) >= 16 for record in one.values())


def test_replaying_recorded_actions_gives_the_same_record(tmp_path: Path) -> None:
    from robospa.baselines.replay import ReplayPolicy

    config = WorkerConfig(tmp_path, "robospa.baselines.oracle:create")
    Runner(config, KEYS[:1], RunOptions()).run()
    world = SapienWorld(render=False)
    again = run_trial(world, ReplayPolicy(tmp_path), KEYS[0], policy_seed=0)
    world.close()
    assert differences(read_records(tmp_path)[KEYS[0]], again) == []


class Looking:
    """Moves by what it sees, so that a picture of another trial would change its actions."""

    spec = PolicySpec("looking", cameras=(CameraSpec("head", 80, 60),), horizon=3, seeded=True)

    def reset(self, trial: TrialInfo) -> None: ...

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        picture = hashlib.sha256(observation["images"]["head"].tobytes()).digest()
        rng = np.random.default_rng(list(picture))
        return (observation["state"] + rng.normal(0, 0.05, (3, 14))).astype(np.float32)


def test_records_are_equal_to_the_bit_however_many_trials_a_worker_holds(tmp_path: Path) -> None:
    """Worlds of one process take turns from query to query, each with pictures of its own."""
    keys = [KEYS[0], *(replace(key, mode="randomized") for key in KEYS[:2])]
    with ServerThread(policy_factory=Looking) as server:
        config = WorkerConfig(tmp_path, server.url, step_scale=0.08)
        Runner(config, keys, RunOptions(concurrent_trials=3)).run()
    world = SapienWorld()
    records = read_records(tmp_path)
    for key in keys:
        alone = run_trial(world, Looking(), key, policy_seed=0, step_scale=0.08)
        assert alone.policy_calls > 2
        found = replace(records[key], policy_seed=0)
        assert differences(alone, found) == []
    world.close()
