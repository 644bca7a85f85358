"""Makers of episodes on a Ray cluster, an actor each; their episodes come back over Ray."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from robospa.harness.datasets.jobs import EpisodeAttempt, EpisodeJob, MakerError
from robospa.harness.pool import WorkerDied
from robospa.harness.running.ray_cluster import NoCluster, RaySettings, error_line, join_cluster


class MakerActor:
    """What runs on a node: the maker at `path`, `module:function`, once the node has shown that it
    has the driver's `versions`."""

    def __init__(self, versions: Mapping[str, str], path: str) -> None:
        from robospa.harness.running.ray_node import version_differences

        self._path, self._maker = path, None
        self._differences = version_differences(versions)

    def make(self, job: EpisodeJob) -> EpisodeAttempt | str:
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

    def run(self, job: EpisodeJob) -> EpisodeAttempt:
        """What comes of `job`; raises WorkerDied, MakerError."""
        try:
            answer = self._ray.get(self._actor.make.remote(job))
        except Exception as error:
            raise WorkerDied(error_line(error)) from error
        if isinstance(answer, EpisodeAttempt):
            return answer
        raise MakerError(str(answer))

    def kill(self) -> None:
        """End it now."""
        with suppress(Exception):  # it may be gone already
            self._ray.kill(self._actor)


class RayMakers:
    """Starts makers on a cluster."""

    def __init__(self, ray: Any, settings: RaySettings, path: str) -> None:
        from robospa.harness.running.ray_node import versions

        self._ray, self._settings, self._path = ray, settings, path
        self._versions = versions()

    def capacity(self) -> int:
        """How many workers fit into the cluster; raises NoCluster if none does."""
        free = self._ray.cluster_resources()
        fitting = int(free.get("CPU", 0.0) / self._settings.cpus + 1e-6)
        if self._settings.gpus:
            fitting = min(fitting, int(free.get("GPU", 0.0) / self._settings.gpus + 1e-6))
        if not fitting:
            raise NoCluster("the Ray cluster has no room for a worker; lower --cpus-per-worker")
        return min(fitting, self._settings.workers or fitting)

    def __call__(self) -> RayMaker:
        """One more, where there is room."""
        needs = {"num_cpus": self._settings.cpus, "num_gpus": self._settings.gpus}
        actor = self._ray.remote(MakerActor).options(**needs).remote(self._versions, self._path)
        return RayMaker(self._ray, actor)


@contextmanager
def ray_makers(settings: RaySettings, path: str) -> Iterator[RayMakers]:
    """The makers of the cluster of `settings`, which is left afterwards; raises NoCluster."""
    ray = join_cluster(settings.address)
    try:
        yield RayMakers(ray, settings, path)
    finally:
        ray.shutdown()
