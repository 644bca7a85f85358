"""The expert's trial of one seed: the `run_trial` of every policy, without wire or pictures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

from robospa.harness.world import SceneUnstable, World
from robospa.protocol.policy import Policy
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.seeds import ListKey
from robospa.trial import TrialKey

ORACLE = "robospa.baselines.oracle:create"
"""By path, not by entry point: the harness does not import baselines, and a list of seeds must come
from this very policy."""
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


_WORKER: list[tuple[World, Policy]] = []


def _in_worker(key: ListKey, seeds: Sequence[int], salt: str) -> list[Attempt]:
    if not _WORKER:  # a pool has one salt
        from robospa.harness.factory import policy_factory
        from robospa.harness.sim.sapien_world import SapienWorld

        _WORKER.append((SapienWorld(render=False), policy_factory(ORACLE)(salt)))
    world, policy = _WORKER[0]
    return [attempt(world, policy, key, seed, salt) for seed in seeds]


class ExpertPool:
    """Processes that run the expert, on hidden scenes if there is a `salt`; a context manager."""

    def __init__(self, workers: int, salt: str = "") -> None:
        self.workers = max(1, workers)
        self._salt = salt
        self._pool = self._start()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, mp_context=get_context("spawn"))

    def __enter__(self) -> ExpertPool:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def submit(self, key: ListKey, seeds: Sequence[int]) -> Future[list[Attempt]]:
        """Attempts for `seeds`, in their order, in one process."""
        return self._pool.submit(_in_worker, key, list(seeds), self._salt)

    def restart(self) -> None:
        """New processes in place of a pool of which one died."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._start()
