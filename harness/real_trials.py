"""The last look of `robospa check`: a real trial in the simulator, and the same one once more.

Everything before it is made up: noise for images, postures out of nowhere. Here the policy sees a
scene, its actions move a robot, and a second run of the same trial with the same policy seed must
end in the same state to the bit, if the server promises to honour seeds. Success is not asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from robospa.harness.trial import TrialParts, policy_seed, run_trial, task_parts
from robospa.protocol.client import RemotePolicy
from robospa.protocol.errors import WireError
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

TASK, LEVEL = "Pick_Blocks_Size", 1
ROBOT = "aloha-agilex"
NO_SIMULATOR = "not run: there is no simulator here (pip install 'robospa[sim]'); robospa doctor"


@dataclass(frozen=True)
class Tried:
    """One row: `passed` is None if it could not be tried."""

    name: str
    passed: bool | None
    detail: str


def trial_for(spec: PolicySpec) -> TrialKey:
    """A real trial that a policy with this `spec` can be asked to do."""
    robot = ROBOT if not spec.embodiments or ROBOT in spec.embodiments else spec.embodiments[0]
    return TrialKey(TASK, LEVEL, accepted(TASK, LEVEL)[0], robot)


def real_trials(
    opened: Callable[[], RemotePolicy],
    count: int,
    *,
    make_world: Callable[[], Any] | None = None,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
) -> Iterator[Tried]:
    """Run the same trial `count` times, each on a connection of its own; a row for each.

    Raises nothing of the server's or the simulator's making, and stops at the first trouble.
    """
    records: list[TrialRecord] = []
    for number in range(1, count + 1):
        name = f"real trial {number}"
        try:
            world = (make_world or _world)()
        except ImportError:
            yield Tried(name, None, NO_SIMULATOR)
            return
        try:
            with closing(world), opened() as policy:
                spec, key = policy.spec, trial_for(policy.spec)
                record = run_trial(world, policy, key, policy_seed=policy_seed(key), parts=parts)
        except WireError as error:
            yield Tried(name, False, str(error))
            return
        except Exception as error:  # the machine's, not the server's
            trouble = f"{type(error).__name__}: {error}"
            yield Tried(name, None, f"could not be run here ({trouble}); see robospa doctor")
            return
        records.append(record)
        yield _told(name, records, spec)
        if record.end == "policy_error":
            return


def _world() -> Any:
    from robospa.harness.sim.sapien_world import SapienWorld

    return SapienWorld()


def _told(name: str, records: list[TrialRecord], spec: PolicySpec) -> Tried:
    first, last = records[0], records[-1]
    if last.end == "policy_error":
        return Tried(name, False, last.message)
    middle = last.latency.get("p50")
    asked = f"asked {last.policy_calls} times" + (f", {middle:.0f} ms each" if middle else "")
    text = (
        f"{last.key.task} level {last.key.level} seed {last.key.seed}: {last.end} after "
        f"{last.steps} actions, {asked}, {last.wall_time:.1f} s"
    )
    if len(records) == 1:
        return Tried(name, True, text)
    same = (last.digest, last.actions_digest) == (first.digest, first.actions_digest)
    if same:
        return Tried(name, True, f"{text}; equal to the first to the bit")
    if spec.seeded:
        return Tried(name, False, f"{text}; it differs from the first, though seeds are honoured")
    return Tried(name, True, f"{text}; it differs from the first: seeds are not honoured")
