"""What a worker is asked for and what it answers: an episode to make, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from robospa.harness.datasets.pictures import CodecMissing
from robospa.harness.factory import load_function
from robospa.harness.seeds.attempt import CRASHED, Attempt
from robospa.harness.world import RenderUnavailable, SceneUnstable
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

MAKER = "robospa.harness.datasets.maker:EpisodeMaker"
MOST_TEXT = 300
"""Characters of a reason that are kept."""
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


Maker = Callable[[EpisodeJob], EpisodeAttempt]
"""Makes one episode, or raises what says why there is none."""


def attempt_job(maker: Maker, job: EpisodeJob) -> EpisodeAttempt:
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


def crashed(job: EpisodeJob) -> Attempt:
    """What comes of a seed at which several workers died."""
    return refused(job.key.seed, CRASHED)


def refused(seed: int, reason: str) -> EpisodeAttempt:
    """A seed without an episode."""
    return EpisodeAttempt(seed, False, " ".join(reason.split())[:MOST_TEXT])
