"""The workers of a collection, processes here or actors on a Ray cluster: what they are asked for
and what they answer."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from robospa.harness.datasets.pictures import CodecMissing
from robospa.harness.factory import load_function
from robospa.harness.pool import JobProcess, JobWorker, Pool, WorkerDied
from robospa.harness.running import ray_executor
from robospa.harness.running.status import cores
from robospa.harness.seeds.attempt import CRASHED, Attempt, one_line
from robospa.harness.settings import Compute
from robospa.harness.world import RenderUnavailable, SceneUnstable
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

MAKER = "robospa.harness.datasets.maker:EpisodeMaker"
PURPOSES = ("expert", "replay", "pictures", "rest")
"""What the processor time of an episode goes to."""


@dataclass(frozen=True)
class EpisodeJob:
    """An episode to make: its trial, its pictures, and the shares of all episodes that are with
    noise, with a mistake, or from the midst of the task; whether only keyframes are kept, and
    whether the objects are told as numbers."""

    key: TrialKey
    cameras: tuple[CameraSpec, ...]
    images: str
    shares: tuple[float, float, float] = (0.0, 0.0, 0.0)
    keyframes: bool = False
    environment_state: bool = False


@dataclass(frozen=True)
class EpisodeAttempt(Attempt):
    """What came of a job, with the content of the episode's file if it was accepted, its number of
    frames, and processor time by purpose [s]."""

    data: bytes = field(default=b"", repr=False)
    frames: int = 0
    times: Mapping[str, float] = field(default_factory=dict)


class MakerError(Exception):
    """No episode can be made on this machine; the message says why and what to do."""


class RejectedSeed(Exception):
    """A seed gives no episode; the message says why."""


def attempt_job(maker: Callable[[EpisodeJob], EpisodeAttempt], job: EpisodeJob) -> EpisodeAttempt:
    """What comes of `job`; an error is a reason like another, so that hours of work outlive it.

    Raises MakerError where no other seed would fare better.
    """
    try:
        return maker(job)
    except (MakerError, CodecMissing, RenderUnavailable, ModuleNotFoundError) as error:
        raise MakerError(str(error)) from error
    except SceneUnstable as error:
        return refused(job.key.seed, f"does not settle: {error}")
    except RejectedSeed as error:
        return refused(job.key.seed, str(error))
    except Exception as error:
        return refused(job.key.seed, f"{type(error).__name__}: {error}")


def maker_at(path: str) -> Callable[[EpisodeJob], Attempt]:
    """What a worker makes episodes with: the maker at `path`, `module:function`."""
    try:
        maker = load_function(path)()
    except Exception as error:
        raise MakerError(f"{error}" or type(error).__name__) from error
    return partial(attempt_job, maker)


def refused(seed: int, reason: str) -> EpisodeAttempt:
    """A seed without an episode."""
    return EpisodeAttempt(seed, False, one_line(reason))


EPISODE_SECONDS = 3600.0
"""A worker that is still at an episode after this hangs."""
EPISODES_PER_WORKER = 200
"""A worker is replaced after so many: whatever a simulator and a driver of graphics keep of each
scene, memory stays bounded. Starting one costs what one short episode does."""


OpenPool = Callable[[int], AbstractContextManager[Pool[EpisodeJob, Attempt]]]
"""Opens the workers, at most as many as there are episodes left."""


@contextmanager
def pool_opener(compute: Compute, maker: str = MAKER) -> Iterator[OpenPool]:
    """What opens the workers that `compute` asks for; `maker` is `module:function`.

    Raises NoCluster. A cluster is left at the end.
    """
    if compute.executor == "local":
        start = partial(JobProcess, maker_at, maker, seconds=EPISODE_SECONDS, name="maker")
        yield lambda episodes: _pool(start, min(compute.workers or cores(), episodes))
        return
    ray = ray_executor.join_cluster(compute.address)
    try:
        room = {"CPU": compute.cpus_per_worker, "GPU": compute.gpus_per_worker}
        actor = ray.remote(MakerActor).options(num_cpus=room["CPU"], num_gpus=room["GPU"])

        def opened(episodes: int) -> Pool[EpisodeJob, Attempt]:
            found = ray_executor.fitting(ray.cluster_resources(), room)
            if not found:
                raise ray_executor.NoCluster(
                    "the Ray cluster has no room for a worker; lower --cpus-per-worker"
                )
            here = ray_executor.versions()
            return _pool(
                lambda: RayMaker(ray, actor.remote(here, maker)),
                min(found, compute.workers or found, episodes),
            )

        yield opened
    finally:
        ray.shutdown()


def _pool(
    start: Callable[[], JobWorker[EpisodeJob, Attempt]], workers: int
) -> Pool[EpisodeJob, Attempt]:
    return Pool(
        start,
        workers,
        crashed=lambda job: refused(job.key.seed, CRASHED),
        jobs_each=EPISODES_PER_WORKER,
    )


class MakerActor:
    """What runs on a node: the maker at `path`, `module:function`, once the node has shown that it
    has the driver's `versions`."""

    def __init__(self, versions: Mapping[str, str], path: str) -> None:
        self._differences = ray_executor.version_differences(versions)
        self._path = path
        self._maker: Callable[[EpisodeJob], Attempt] | None = None

    def make(self, job: EpisodeJob) -> Attempt | str:
        """What comes of `job`, or why nothing can be made here."""
        if self._differences:
            return f"a Ray node cannot be used: {self._differences}; install there what is here"
        try:
            self._maker = self._maker or maker_at(self._path)
            return self._maker(job)
        except Exception as error:
            return f"{error}" or type(error).__name__


class RayMaker:
    """One actor, as the driver sees it."""

    def __init__(self, ray: Any, actor: Any) -> None:
        self._ray, self._actor = ray, actor

    def run(self, job: EpisodeJob) -> Attempt:
        """What comes of `job`; raises WorkerDied, MakerError."""
        try:
            answer = self._ray.get(self._actor.make.remote(job))
        except Exception as error:
            raise WorkerDied(ray_executor.error_line(error)) from error
        if isinstance(answer, Attempt):
            return answer
        raise MakerError(str(answer))

    def kill(self) -> None:
        """End it now."""
        with suppress(Exception):  # it may be gone already
            self._ray.kill(self._actor)
