"""The workers of a collection: processes here, or actors on a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from robospa.harness.datasets.collect import OpenPool
from robospa.harness.datasets.jobs import MAKER, EpisodeJob, crashed, maker_at
from robospa.harness.pool import JobProcess, JobWorker, Pool
from robospa.harness.running.autoscaling import cores
from robospa.harness.running.ray_cluster import RaySettings
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.settings import Compute

StartWorker = Callable[[], JobWorker[EpisodeJob, Attempt]]
EPISODE_SECONDS = 3600.0
"""A worker that is still at an episode after this hangs."""
EPISODES_PER_WORKER = 200
"""A worker is replaced after so many: whatever a simulator and a driver of graphics keep of each
scene, memory stays bounded. Starting one costs what one short episode does."""


@contextmanager
def pool_opener(compute: Compute, maker: str = MAKER) -> Iterator[OpenPool]:
    """What opens the workers that `compute` asks for; `maker` is `module:function`.

    Raises NoCluster. A cluster is left at the end.
    """
    if compute.executor == "local":
        start = partial(JobProcess, maker_at, maker, seconds=EPISODE_SECONDS, name="maker")
        yield lambda episodes: _pool(start, min(compute.workers or cores(), episodes))
        return
    from robospa.harness.datasets.ray_makers import ray_makers

    settings = RaySettings(
        compute.address or "auto", compute.workers, compute.cpus_per_worker, compute.gpus_per_worker
    )
    with ray_makers(settings, maker) as on_node:
        yield lambda episodes: _pool(on_node, min(on_node.capacity(), episodes))


def _pool(
    start: Callable[[], JobWorker[EpisodeJob, Attempt]], workers: int
) -> Pool[EpisodeJob, Attempt]:
    return Pool(start, workers, crashed=crashed, jobs_each=EPISODES_PER_WORKER)
