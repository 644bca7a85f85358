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
from robospa.harness.datasets.settings import Collection
from robospa.harness.pool import JobProcess, JobWorker, Pool, WorkerDied
from robospa.harness.running.ray_executor import NoCluster, error_line, fitting, join_cluster
from robospa.harness.running.ray_executor import versions as packages
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
    given = {**named, **settings}
    names = [{field.name for field in fields(kind)} for kind in (Collection, Compute)]
    if unknown := next((name for name in given if not any(name in of for of in names)), None):
        known = [field.name for kind in (Collection, Compute) for field in fields(kind)]
        near = did_you_mean(unknown, known)
        raise SettingsError(f"there is no setting {unknown!r}; {near}known are {', '.join(known)}")
    own, machine = ({n: v for n, v in given.items() if n in of} for of in names)
    compute = changed(Compute(), Compute, machine)
    order = Order(changed(Collection(), Collection, own), format, Path(out))
    return collect_order(order, compute, resume=resume)


def collect_order(
    order: Order,
    compute: Compute,
    *,
    resume: bool = False,
    keep_episodes: bool = False,
    say: Callable[[str], None] = print,
) -> CollectionResult | None:
    """Make the data set of `order` with the workers that `compute` asks for, as `collect`."""
    with pool_opener(compute) as open_pool:
        return make(order, open_pool, resume=resume, keep_episodes=keep_episodes, say=say)


@contextmanager
def pool_opener(compute: Compute, maker: str = jobs.MAKER) -> Iterator[OpenPool]:
    """What opens the workers that `compute` asks for; `maker` is `module:function`.

    Raises NoCluster. A cluster is left at the end.
    """
    if compute.executor == "local":
        start = partial(JobProcess, jobs.maker_at, maker, seconds=EPISODE_SECONDS, name="maker")
        yield lambda episodes: _pool(start, min(compute.workers or cores(), episodes))
        return
    ray = join_cluster(compute.address)
    try:
        room = {"CPU": compute.cpus_per_worker, "GPU": compute.gpus_per_worker}
        actor = ray.remote(MakerActor).options(num_cpus=room["CPU"], num_gpus=room["GPU"])

        def opened(episodes: int) -> Pool[jobs.EpisodeJob, Attempt]:
            found = fitting(ray.cluster_resources(), room)
            if not found:
                raise NoCluster("the Ray cluster has no room for a worker; lower --cpus-per-worker")
            here = packages()
            return _pool(
                lambda: RayMaker(ray, actor.remote(here, maker)),
                min(found, compute.workers or found, episodes),
            )

        yield opened
    finally:
        ray.shutdown()


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
