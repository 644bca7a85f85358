"""What `robospa check` tests beyond the wire: a real trial in the simulator, run twice, and load.

The checks of the protocol use synthetic observations: noise for images, random postures. In the
trial the policy sees a scene and its actions move a robot. If the server promises to honour seeds,
a second run with the same policy seed must end in the same state, to the bit. Success is not
required.

Load is what a client sees when one, four or eight ask at once: from the request to the answer's
arrival, with transport and queue. Every client is a connection of its own, with made-up
observations of the form that the policy asks for.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import chain

from robospa.extras import remedy
from robospa.harness.clock.policy_clock import Latency, of_samples
from robospa.harness.replay import rehearse
from robospa.harness.trial import TrialSetup, new_run_seed, task_parts
from robospa.harness.world import World
from robospa.protocol.client import RemotePolicy
from robospa.protocol.conformance import CheckResult, synthetic_observation, trial_for
from robospa.protocol.errors import WireError
from robospa.protocol.policy import PolicySpec, robot_of
from robospa.results.records.action_problems import problem_counts
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

EXECUTED_ACTIONS = "executed actions"
TASK, LEVEL = "Pick_Blocks_Size", 1


def rollouts(
    connect: Callable[[], RemotePolicy],
    count: int,
    *,
    make_world: Callable[[], World] | None = None,
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
) -> Iterator[CheckResult]:
    """Run the same trial `count` times, each on a connection of its own; a result for each, and one
    about the actions of all.

    Raises nothing of the server's or the simulator's making, and stops at the first failure.
    """
    records: list[TrialRecord] = []
    seed = new_run_seed()
    for number in range(1, count + 1):
        name = f"real trial {number}"
        try:
            world = (make_world or _sapien_world)()
        except ImportError:
            missing = f"not run: there is no simulator here; {remedy('sapien')}"
            yield CheckResult(name, None, missing)
            return
        try:
            with closing(world), connect() as policy:
                spec = policy.spec
                key = TrialKey(TASK, LEVEL, accepted(TASK, LEVEL)[0], robot_of(spec))
                record = rehearse(world, policy, seed, key, parts(key))
        except WireError as error:
            yield CheckResult(name, False, str(error))
            return
        except Exception as error:  # the machine's, not the server's
            reason = f"{type(error).__name__}: {error}"
            yield CheckResult(name, None, f"could not be run here ({reason}); see robospa check")
            return
        records.append(record)
        yield _result(name, records, spec)
        if record.end == "policy_error":
            return
    if records:
        yield executed_actions(records)


def executed_actions(records: Sequence[TrialRecord]) -> CheckResult:
    """The check that the robot could execute what was sent; None, with a hint, if often not."""
    found = problem_counts(records)
    if not found:
        count = sum(record.steps for record in records)
        return CheckResult(EXECUTED_ACTIONS, True, f"all {count} actions were executed as sent")
    often = any(one.often for one in found)
    text = "; ".join(map(str, found))
    return CheckResult(EXECUTED_ACTIONS, None if often else True, text, hint=often)


def _sapien_world() -> World:
    from robospa.harness.sim.sapien_world import SapienWorld

    return SapienWorld()


def _result(name: str, records: list[TrialRecord], spec: PolicySpec) -> CheckResult:
    """The check of the last record: that it ended, and as the first one did."""
    first, last = records[0], records[-1]
    if last.end == "policy_error":
        return CheckResult(name, False, last.message)
    median = last.latency.get("p50")
    calls = f"{last.policy_calls} policy calls" + (f" of {median:.0f} ms" if median else "")
    text = (
        f"{last.key.task} level {last.key.level} seed {last.key.seed}: {last.end} after "
        f"{last.steps} actions, {calls}, {last.wall_time:.1f} s"
    )
    if len(records) == 1:
        return CheckResult(name, True, text)
    if (last.digest, last.actions_digest) == (first.digest, first.actions_digest):
        return CheckResult(name, True, f"{text}; equal to the first to the bit")
    if spec.seeded:
        return CheckResult(
            name, False, f"{text}; it differs from the first, though seeds are honoured"
        )
    return CheckResult(name, True, f"{text}; it differs from the first: seeds are not honoured")


CLIENTS = (1, 4, 8)
"""How many at once; one is a robot with a server for itself."""
QUERIES = 40
"""Of each client, where the time allows them."""
LEAST = 3
"""Queries of each client, however long they take."""
SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""What of a distribution its `--clock` line has."""


@dataclass(frozen=True)
class Load:
    """The answers to `clients` at once: their times [ms], and how many came a second."""

    clients: int
    latencies: tuple[float, ...]
    per_second: float

    @property
    def latency(self) -> Latency:
        """The distribution, to a tenth of a millisecond."""
        whole = of_samples(self.latencies)
        return Latency(tuple((100.0 * s, round(whole.at(s), 1)) for s in SHARES))

    @property
    def clock(self) -> str:
        """The setting that stands for it."""
        return f"real:{self.latency}"


def measure(
    connect: Callable[[], RemotePolicy], seconds: float, clients: Sequence[int] = CLIENTS
) -> list[Load]:
    """The load of each number of `clients`, in `seconds` each, or less if the server is fast.

    The first answer of a client does not count: it may compile. Raises what the connections do.
    """
    return [_load(connect, count, seconds) for count in clients]


def _load(connect: Callable[[], RemotePolicy], count: int, seconds: float) -> Load:
    ready = threading.Barrier(count)

    def ask(_: int) -> tuple[float, list[float], float]:
        try:
            with connect() as policy:
                policy.reset(trial_for(policy.spec))
                policy.infer(synthetic_observation(policy.spec))
                ready.wait()
                began = time.perf_counter()
                return began, _times(policy, began + seconds), time.perf_counter()
        except BaseException:
            ready.abort()
            raise

    with ThreadPoolExecutor(count) as pool:
        asking = [pool.submit(ask, number) for number in range(count)]
    errors = [error for one in asking if (error := one.exception()) is not None]
    if errors:  # that of a client, rather than that others then wait for it in vain
        raise min(errors, key=lambda error: isinstance(error, threading.BrokenBarrierError))
    starts, times, ends = zip(*(one.result() for one in asking), strict=True)
    every = sorted(chain(*times))
    return Load(count, tuple(every), len(every) / (max(ends) - min(starts)))


def _times(policy: RemotePolicy, until: float) -> list[float]:
    """Latencies [ms] of one client's queries."""
    found: list[float] = []
    while len(found) < QUERIES and (len(found) < LEAST or time.perf_counter() < until):
        seen = synthetic_observation(policy.spec, step=len(found) + 1, seed=len(found) + 1)
        start = time.perf_counter()
        policy.infer(seen)
        found.append(1000.0 * (time.perf_counter() - start))
    return found
