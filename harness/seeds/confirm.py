"""Whether a list that was made with other code still holds: a few of its trials, run again.

Most changes of code change no trial. Where the first trials of a list end exactly as they did, its
attempts count as made with today's code, and the list is not made anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from robospa.harness.seeds.attempt import Attempt
from robospa.harness.seeds.evidence import Evidence
from robospa.harness.seeds.sweep import Submit
from robospa.tasks.seeds import ListKey


@dataclass(frozen=True)
class Confirmed:
    """What came of a list: `differs` names the seeds that end otherwise now; `tried` how many were
    run again, none if there is no record of them."""

    key: ListKey
    tried: int
    differs: tuple[int, ...]

    @property
    def holds(self) -> bool:
        """Whether all that was run again ended as before."""
        return self.tried > 0 and not self.differs


def confirm(
    submit: Submit, lists: Mapping[ListKey, str], evidence: Evidence, count: int
) -> Iterator[Confirmed]:
    """Run the first `count` accepted and the first refused trial of every list again.

    `lists` says with which inputs each was made.
    """
    known = {key: _sample(evidence.attempts(key, made), count) for key, made in lists.items()}
    running = {key: [submit(key, a.seed) for a in some] for key, some in known.items()}
    for key, before in known.items():
        now = [future.result() for future in running[key]]
        pairs = zip(before, now, strict=True)
        yield Confirmed(key, len(now), tuple(a.seed for a, b in pairs if _end(a) != _end(b)))


def _sample(attempts: Mapping[int, Attempt], count: int) -> Sequence[Attempt]:
    found = [attempts[seed] for seed in sorted(attempts)]
    refused = [item for item in found if not item.accepted]
    return [item for item in found if item.accepted][:count] + refused[:1]


def _end(item: Attempt) -> tuple[object, ...]:
    return item.accepted, item.digest, item.physics_steps, item.steps
