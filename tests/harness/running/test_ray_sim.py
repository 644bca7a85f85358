"""The real simulator on a Ray cluster of its own: records and traces come back whole."""

from contextlib import closing, suppress
from pathlib import Path

import pytest

from robospa.harness.running.ray_executor import RayExecutor
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.settings import Compute
from robospa.results.records.runs import VIDEOS, differences, film_name, read_records
from robospa.trial import TrialKey

pytest.importorskip("ray")
pytestmark = pytest.mark.sim

KEYS = [TrialKey("Pick_Blocks_Size", level, 100000) for level in (1, 3)]


def test_records_of_a_cluster_equal_local_ones_and_the_cluster_ends_with_the_run(
    tmp_path: Path,
) -> None:
    def config(name: str) -> WorkerConfig:
        return WorkerConfig(tmp_path / name, "robospa.baselines.oracle:create", video="all")

    before = processes("raylet")
    Runner(config("here"), KEYS, RunOptions(workers=1)).run()
    there = config("ray")
    with closing(RayExecutor(there, Compute(1, "ray", "local"))) as executor:
        Runner(there, KEYS, executor=executor).run()
    here, ray = read_records(tmp_path / "here"), read_records(tmp_path / "ray")
    assert [differences(here[key], ray[key]) for key in KEYS] == [[] for _ in KEYS]
    for key in KEYS:
        trace = f"actions/{key.slug}.npz"
        assert (tmp_path / "here" / trace).read_bytes() == (tmp_path / "ray" / trace).read_bytes()
    # Nothing was drawn on the node: films are made where the run's folder is, from what came back.
    assert not (tmp_path / "ray" / VIDEOS).exists()
    assert [ray[key].video for key in KEYS] == [film_name(key) for key in KEYS]
    assert processes("raylet") <= before


def processes(name: str) -> set[int]:
    """Those whose program's path ends in `name`."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if path.read_bytes().split(b"\0")[0].endswith(name.encode()):
                found.add(int(path.parent.name))
    return found
