"""`robospa.collect`: a data set of demonstrations as one call, with every setting as a keyword; and
the workers of a collection, processes here or actors on a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from robospa.harness.datasets import jobs
from robospa.harness.datasets.collect import CollectionResult, OpenPool, Order
from robospa.harness.datasets.collect import collect as make
from robospa.harness.datasets.settings import Collection, command_of, versions
from robospa.harness.pool import JobProcess, JobWorker, Pool, WorkerDied
from robospa.harness.running.ray_executor import NoCluster, error_line, fitting, join_cluster
from robospa.harness.running.status import cores
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.settings import Compute, SettingsError, changed
from robospa.registry import did_you_mean

StartWorker = Callable[[], JobWorker[jobs.EpisodeJob, Attempt]]
EPISODE_SECONDS = 3600.0
"""A worker that is still at an episode after this hangs."""
EPISODES_PER_WORKER = 200
"""A worker is replaced after so many: whatever a simulator and a driver of graphics keep of each
scene, memory stays bounded. Starting one costs what one short episode does."""


def collect(
    out: str | Path,
    *,
    tasks: str | Sequence[str] = "all",
    levels: str | int | Sequence[int] = "1-5",
    episodes: int = 50,
    workers: int = 0,
    format: str = "lerobot-v3",
    resume: bool = False,
    **settings: object,
) -> CollectionResult | None:
    """Collect demonstrations of the expert into `out`, and return what was made.

        made = robospa.collect("data/mine", tasks="GAC", levels=1, episodes=10)

    Args:
        out: Folder of the data set.
        tasks: Names of tasks, categories or dimensions.
        levels: From 1 to 5.
        episodes: Per variant.
        workers: Worker processes; 0 for one a core.
        format: "lerobot-v3", "lerobot-v2.1" or "robotwin-hdf5".
        resume: Go on with the data set in `out`.
        settings: Any other setting of `robospa collect`, such as cameras="head" or noise=0.2.

    Returns:
        The folders, the number of episodes and what is missing; None if the data set was finished.

    Raises:
        SettingsError: A setting is unknown or impossible; nothing was written.
        RunError: Another process is at it, or `out` holds something else.
        MakerError: An episode cannot be made on this machine; StorageError if `out` cannot be
            written. What is done is kept, and `resume` goes on.
    """
    named = {"tasks": tasks, "levels": levels, "episodes": episodes, "workers": workers}
    return _collect(out, {**named, **settings}, format, resume)


def _collect(
    out: str | Path,
    given: dict[str, object],
    layout: str,
    resume: bool = False,
    maker: str = jobs.MAKER,
) -> CollectionResult | None:
    """`collect` with all settings by name; `maker` makes the episodes."""
    kinds = (Collection, Compute)
    known = [field.name for kind in kinds for field in fields(kind)]
    if unknown := next((name for name in given if name not in known), None):
        near = did_you_mean(unknown, known)
        listed = ", ".join(known)
        raise SettingsError(f"there is no setting {unknown!r}; {near}known are {listed}")
    names = {field.name for field in fields(Compute)}
    compute = changed(Compute(), Compute, {k: v for k, v in given.items() if k in names})
    own = {name: value for name, value in given.items() if name not in names}
    collection = changed(Collection(), Collection, own)
    order = Order(collection, layout, Path(out), command_of(collection, layout), versions())
    with pool_opener(compute, maker) as open_pool:
        return make(order, open_pool, resume=resume)


@contextmanager
def pool_opener(compute: Compute, maker: str = jobs.MAKER) -> Iterator[OpenPool]:
    """What opens the workers that `compute` asks for; `maker` is `module:function`.

    Raises NoCluster. A cluster is left at the end.
    """
    if compute.executor == "local":
        start = partial(JobProcess, jobs.maker_at, maker, seconds=EPISODE_SECONDS, name="maker")
        yield lambda episodes: _pool(start, min(compute.workers or cores(), episodes))
        return
    with ray_makers(compute, maker) as on_node:
        yield lambda episodes: _pool(on_node, min(on_node.capacity(), episodes))


def _pool(start: StartWorker, workers: int) -> Pool[jobs.EpisodeJob, Attempt]:
    return Pool(start, workers, crashed=jobs.crashed, jobs_each=EPISODES_PER_WORKER)


class MakerActor:
    """What runs on a node: the maker at `path`, `module:function`, once the node has shown that it
    has the driver's `versions`."""

    def __init__(self, versions: Mapping[str, str], path: str) -> None:
        from robospa.harness.running.ray_executor import version_differences

        self._path, self._maker = path, None
        self._differences = version_differences(versions)

    def make(self, job: jobs.EpisodeJob) -> jobs.EpisodeAttempt | str:
        """What comes of `job`, or why nothing can be made here."""
        from robospa.harness.datasets.jobs import attempt_job
        from robospa.harness.factory import load_function

        if self._differences:
            return f"a Ray node cannot be used: {self._differences}; install there what is here"
        try:
            self._maker = self._maker or load_function(self._path)()
            return attempt_job(self._maker, job)  # type: ignore[arg-type]
        except Exception as error:
            return f"{error}" or type(error).__name__


class RayMaker:
    """One actor, as the driver sees it."""

    def __init__(self, ray: Any, actor: Any) -> None:
        self._ray, self._actor = ray, actor

    def run(self, job: jobs.EpisodeJob) -> jobs.EpisodeAttempt:
        """What comes of `job`; raises WorkerDied, MakerError."""
        try:
            answer = self._ray.get(self._actor.make.remote(job))
        except Exception as error:
            raise WorkerDied(error_line(error)) from error
        if isinstance(answer, jobs.EpisodeAttempt):
            return answer
        raise jobs.MakerError(str(answer))

    def kill(self) -> None:
        """End it now."""
        with suppress(Exception):  # it may be gone already
            self._ray.kill(self._actor)


class RayMakers:
    """Starts makers on a cluster."""

    def __init__(self, ray: Any, settings: Compute, path: str) -> None:
        from robospa.harness.running.ray_executor import versions

        self._ray, self._settings, self._path = ray, settings, path
        self._versions = versions()
        self._needs = {"CPU": settings.cpus_per_worker, "GPU": settings.gpus_per_worker}

    def capacity(self) -> int:
        """How many workers fit into the cluster; raises NoCluster if none does."""
        found = fitting(self._ray.cluster_resources(), self._needs)
        if not found:
            raise NoCluster("the Ray cluster has no room for a worker; lower --cpus-per-worker")
        return min(found, self._settings.workers or found)

    def __call__(self) -> RayMaker:
        """One more, where there is room."""
        needs = {"num_cpus": self._needs["CPU"], "num_gpus": self._needs["GPU"]}
        actor = self._ray.remote(MakerActor).options(**needs).remote(self._versions, self._path)
        return RayMaker(self._ray, actor)


@contextmanager
def ray_makers(settings: Compute, path: str) -> Iterator[RayMakers]:
    """The makers of the cluster of `settings`, which is left afterwards; raises NoCluster."""
    ray = join_cluster(settings.address)
    try:
        yield RayMakers(ray, settings, path)
    finally:
        ray.shutdown()
