"""The expert's trial of one seed: the `run_trial` of every policy, without wire or pictures."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from robospa.harness.pool import JobProcess, Pool
from robospa.harness.world import SceneUnstable, World
from robospa.protocol.policy import Policy
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.seeds import ListKey
from robospa.trial import TrialKey

ORACLE = "robospa.baselines.oracle:create"
"""By path, not by entry point: the harness does not import baselines, and a list of seeds must come
from this very policy."""
CRASHED = "the simulator crashed"
MOST_TEXT = 300
"""Characters of a reason that are kept."""


@dataclass(frozen=True)
class Attempt:
    """The expert's trial of one seed.

    `reason` says why it was not accepted, or is empty; `seconds` is processor time.
    """

    seed: int
    accepted: bool
    reason: str = ""
    digest: str = ""
    physics_steps: int = 0
    steps: int = 0
    seconds: float = 0.0


def attempt(world: World, policy: Policy, key: ListKey, seed: int, salt: str = "") -> Attempt:
    """Run the expert on one seed; it has to know the `salt` of hidden scenes, too.

    An error is a reason like another: a sweep of hours outlives it, and its table shows it.
    """
    from robospa.harness.trial import run_trial, task_parts

    trial = TrialKey(key.task, key.level, seed, key.embodiment, key.mode)
    parts = partial(task_parts, salt=salt)
    began = time.process_time()
    try:
        record = run_trial(world, policy, trial, policy_seed=0, parts=parts)
    except SceneUnstable as error:
        return _refused(seed, f"does not settle: {error}")
    except LayoutError as error:
        return _refused(seed, f"no layout: {error}")
    except Exception as error:
        return _refused(seed, f"{type(error).__name__}: {error}")
    failures = "; ".join(getattr(policy, "failures", ()))
    reason = "" if record.success else f"{record.end} {record.message} {failures}"
    return Attempt(
        seed,
        record.success,
        _line(reason),
        record.digest,
        record.physics_steps,
        record.steps,
        round(time.process_time() - began, 4),
    )


def _refused(seed: int, reason: str) -> Attempt:
    return Attempt(seed, False, _line(reason))


def _line(text: str) -> str:
    return " ".join(text.split())[:MOST_TEXT]


SeedJob = tuple[ListKey, int]
"""A seed of a list, to be tried."""


def expert(salt: str) -> Callable[[SeedJob], Attempt]:
    """What tries seeds in one process, on hidden scenes if there is a `salt`."""
    from robospa.harness.factory import policy_factory
    from robospa.harness.sim.sapien_world import SapienWorld

    world, policy = SapienWorld(render=False), policy_factory(ORACLE)(salt)
    return lambda job: attempt(world, policy, *job, salt)


def expert_pool(workers: int, salt: str = "") -> Pool[SeedJob, Attempt]:
    """Processes that run the expert; a seed at which several of them die is refused."""

    def crashed(job: SeedJob) -> Attempt:
        return Attempt(job[1], False, CRASHED)

    start = partial(JobProcess, expert, salt, name="expert")
    return Pool(start, max(1, workers), crashed=crashed)
