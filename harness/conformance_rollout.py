"""The last part of `robospa check`: a real trial in the simulator, run twice.

The checks before it use synthetic observations: noise for images, random postures. Here the policy
sees a scene and its actions move a robot. If the server promises to honour seeds, a second run of
the trial with the same policy seed must end in the same state, to the bit. Success is not required.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing

from robospa.extras import remedy
from robospa.harness.trial import TrialParts, run_trial, task_parts
from robospa.harness.trial_identity import policy_seed, trial_id
from robospa.harness.world import World
from robospa.protocol.client import RemotePolicy
from robospa.protocol.conformance import CheckResult
from robospa.protocol.errors import WireError
from robospa.protocol.policy import PolicySpec, robot_of
from robospa.results.records.action_problems import problem_counts
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

EXECUTED_ACTIONS = "executed actions"
TASK, LEVEL = "Pick_Blocks_Size", 1


def trial_for(spec: PolicySpec) -> TrialKey:
    """A real trial that a policy with this `spec` can be asked to do."""
    return TrialKey(TASK, LEVEL, accepted(TASK, LEVEL)[0], robot_of(spec))


def rollouts(
    connect: Callable[[], RemotePolicy],
    count: int,
    *,
    make_world: Callable[[], World] | None = None,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
) -> Iterator[CheckResult]:
    """Run the same trial `count` times, each on a connection of its own; a result for each, and one
    about the actions of all.

    Raises nothing of the server's or the simulator's making, and stops at the first failure.
    """
    records: list[TrialRecord] = []
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
                spec, key = policy.spec, trial_for(policy.spec)
                record = run_trial(
                    world,
                    policy,
                    key,
                    policy_seed=policy_seed(key),
                    trial_id=trial_id(key),
                    parts=parts,
                )
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
    return CheckResult(EXECUTED_ACTIONS, None if often else True, "; ".join(map(str, found)))


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
