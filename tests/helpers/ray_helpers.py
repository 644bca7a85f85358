"""A Ray cluster of several nodes on this machine, and policies that tell where they ran."""

import os
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from run_fakes import KeyedPolicy

QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_enable_worker_prestart": "0",
    "RAY_prestart_worker_first_driver": "0",
    "RAY_DISABLE_DOCKER_CPU_WARNING": "1",
}
SIZE = {"object_store_memory": 80 * 2**20, "include_log_monitor": False}
FAST = {
    "health_check_initial_delay_ms": 1000,
    "health_check_period_ms": 1000,
    "health_check_failure_threshold": 3,
}


class NodePolicy(KeyedPolicy):
    """Leaves the name of its node in $FAKE_MARKS. From seed 100020 on it waits for the node "two",
    so that no run ends before that has joined."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        assert self.trial is not None
        marks = Path(os.environ["FAKE_MARKS"])
        (marks / os.environ["FAKE_NODE"]).touch()
        time.sleep(0.05)
        while self.seed >= 100020 and not (marks / "two").exists():
            time.sleep(0.05)
        return super().infer(observation)


@contextmanager
def cluster(**head: Any) -> Iterator[Any]:
    """A `ray.cluster_utils.Cluster` whose head takes no part unless told otherwise by `head`."""
    from ray.cluster_utils import Cluster

    options = {"num_cpus": 0, "include_dashboard": False, "no_monitor": True, **SIZE, **head}
    made = Cluster(initialize_head=True, head_node_args={**options, "_system_config": FAST})
    try:
        yield made
    finally:
        made.shutdown()


def descendants(pid: int) -> list[int]:
    """Processes that `pid` started, and those that they started."""
    parents: dict[int, list[int]] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(path.read_text().rpartition(")")[2].split()[1])
            parents.setdefault(parent, []).append(int(path.parent.name))
    found = list(parents.get(pid, []))
    for child in found:
        found += parents.get(child, [])
    return found


def kill_node(node: Any) -> None:
    """`kill -9` of everything that belongs to `node`, as if its machine were switched off."""
    started = [info.process for kind in node.all_processes.values() for info in kind]
    for pid in [pid for p in started for pid in (p.pid, *descendants(p.pid))]:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    for process in started:
        process.wait()
