"""A Ray cluster of two nodes on this machine: the same records, whichever node is lost.

Starting Ray takes most of the time, so one cluster serves all tests, and the test that kills one of
its nodes comes last.
"""

import os
import subprocess
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from collect_fakes import FakePool, contents, fake_pack, order
from command_line import ROBOSPA, eval_words
from fake_runs import digests, results
from ray_helpers import QUIET, SIZE, cluster, kill_node
from run_fakes import fake_config, trial_keys

from robospa.harness.datasets import collect as collecting
from robospa.harness.datasets.workers import pool_opener
from robospa.harness.running.ray_executor import NoCluster, RayExecutor, check_address
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.settings import Compute
from robospa.results.records.runs import VIDEOS, differences, film_name, read_records
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

pytest.importorskip("ray")

KEYS = trial_keys(30)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, Any, Path]]:
    """(cluster, its second node, where policies leave marks)"""
    marks = tmp_path_factory.mktemp("marks")
    fakes = {"FAKE_MARKS": str(marks), "FAKE_NODE": "head"}
    fakes["FAKE_DEATHS"] = str(tmp_path_factory.mktemp("deaths") / "first")
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {**QUIET, **fakes}.items():
            patch.setenv(name, value)
        with cluster(num_cpus=1) as made:
            yield made, made.add_node(num_cpus=1, env_vars={"FAKE_NODE": "one"}, **SIZE), marks


def traces(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "actions").iterdir()}


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("nonsense", "not one of auto, local, HOST:PORT"),
        ("127.0.0.1:1", "no Ray cluster answers at 127.0.0.1:1"),
        ("ray://127.0.0.1:1", "no Ray cluster answers at ray://127.0.0.1:1"),
    ],
)
def test_an_address_without_a_cluster_is_told_at_once(address: str, text: str) -> None:
    with pytest.raises(NoCluster, match=text):
        check_address(address)


def test_a_cluster_that_is_no_more_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ray").mkdir()
    (tmp_path / "ray" / "ray_current_cluster").write_text("127.0.0.1:1")
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    with pytest.raises(NoCluster, match=r"no Ray cluster runs .* last one was at 127.0.0.1:1"):
        check_address("auto")


def test_the_slurm_example_is_valid_shell() -> None:
    script = Path(__file__).parents[3] / "docs" / "examples" / "slurm_ray.sh"
    assert subprocess.run(["bash", "-n", script], capture_output=True).stderr == b""


def test_the_command_gives_the_same_records_as_local_workers_and_no_noise(
    tmp_path: Path, home: tuple[Any, Any, Path]
) -> None:
    there = ["--executor", "ray", "--address", home[0].address, "--levels", "1-3"]
    words = eval_words(tmp_path / "ray", "run_fakes:FakePolicy", *there, trials=10)
    done = subprocess.run([*ROBOSPA, *words], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    assert "ray" not in done.stderr.lower(), done.stderr
    keys = [TrialKey("Pick_Blocks_Size", n, 100000 + s) for n in (1, 2, 3) for s in range(10)]
    Runner(fake_config(tmp_path / "local"), keys, RunOptions(workers=1)).run()
    assert sorted(r.key for r in results(tmp_path / "ray")) == keys
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")
    assert traces(tmp_path / "ray") == traces(tmp_path / "local")


def test_a_data_set_collected_over_ray_has_the_bytes_of_one_made_here(
    tmp_path: Path, home: tuple[Any, Any, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first actor that tries seed 1,000,001 dies of it."""
    monkeypatch.setattr(collecting, "pack", fake_pack)
    compute = Compute(executor="ray", address=home[0].address)
    with pool_opener(compute, "collect_fakes:FakeMaker") as open_pool:
        there = collecting.make(
            order(tmp_path / "ray"), open_pool, keep_episodes=True, say=lambda line: None
        )
    assert Path(os.environ["FAKE_DEATHS"]).exists()
    here = collecting.make(order(tmp_path / "here"), FakePool, keep_episodes=True, say=str)
    assert there is not None and here is not None and there.episodes == here.episodes == 6
    assert contents(tmp_path / "ray") == contents(tmp_path / "here")


def test_a_node_that_dies_and_one_that_joins_cost_and_double_nothing(
    tmp_path: Path, home: tuple[Any, Any, Path]
) -> None:
    made, second, marks = home
    records: list[TrialRecord] = []

    def on_record(record: TrialRecord) -> None:
        records.append(record)
        if len(records) == 8:
            kill_node(second)
            made.add_node(num_cpus=1, env_vars={"FAKE_NODE": "two"}, **SIZE)

    patient = fake_config(tmp_path / "ray", "ray_helpers:NodePolicy")
    there = Compute(executor="ray", address=made.address)
    with closing(RayExecutor(patient, there, False)) as executor:
        runner = Runner(patient, KEYS, RunOptions(backoff=0.01), on_record)
        runner.executor = executor
        runner.run()
    Runner(fake_config(tmp_path / "local"), KEYS, RunOptions(workers=1)).run()
    found = results(tmp_path / "ray")
    assert sorted(r.key for r in records) == sorted(r.key for r in found) == KEYS
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")
    assert all([x.cause for x in r.retries] == ["worker_ended"] * (r.attempts - 1) for r in found)
    assert {mark.name for mark in marks.iterdir()} == {"head", "one", "two"}


# --- the real simulator on a cluster of its own


@pytest.mark.sim
def test_records_of_a_cluster_equal_local_ones_and_the_cluster_ends_with_the_run(
    tmp_path: Path,
) -> None:
    def config(name: str) -> WorkerConfig:
        return WorkerConfig(tmp_path / name, "robospa.baselines.oracle:create", video="all")

    keys = [TrialKey("Pick_Blocks_Size", level, 100000) for level in (1, 3)]
    before = processes("raylet")
    Runner(config("here"), keys, RunOptions(workers=1)).run()
    there = config("ray")
    with closing(RayExecutor(there, Compute(1, "ray", "local"))) as executor:
        Runner(there, keys, executor=executor).run()
    here, ray = read_records(tmp_path / "here"), read_records(tmp_path / "ray")
    assert [differences(here[key], ray[key]) for key in keys] == [[] for _ in keys]
    for key in keys:
        trace = f"actions/{key.slug}.npz"
        assert (tmp_path / "here" / trace).read_bytes() == (tmp_path / "ray" / trace).read_bytes()
    # Nothing was drawn on the node: films are made where the run's folder is, from what came back.
    assert not (tmp_path / "ray" / VIDEOS).exists()
    assert [ray[key].video for key in keys] == [film_name(key) for key in keys]
    assert processes("raylet") <= before


def processes(name: str) -> set[int]:
    """Those whose program's path ends in `name`."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if path.read_bytes().split(b"\0")[0].endswith(name.encode()):
                found.add(int(path.parent.name))
    return found
