"""The trained policy at work: plans in keyframes, and begins again when a plan has not helped.

A plan ends where the network answers to rest twice, as the expert does at its end. If the trial is
not over by then, the plan has failed: the grippers open, the arms go back to where they were at the
trial's start, and the next plan is made from what is seen then. After `PLANS` of them the arms
rest: a policy that took up one object after the other would come upon the right one by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from robospa.baselines.learned.act.examples import Batch, WordTable
from robospa.baselines.learned.act.poses import WIDTH, from_poses, resting, to_poses
from robospa.baselines.learned.act.settings import About
from robospa.clients.model_policy import Chunk, ModelPolicy, Query
from robospa.observation import FEATURES, SLOTS
from robospa.protocol.policy import PolicySpec

PLANS = 3
"""Plans of a trial."""
BATCH = 32
Predict = Callable[[Batch], NDArray[np.float32]]
"""Keyframes (B, K, 20) for B frames."""


class ActPolicy(ModelPolicy):
    """One network for all connections."""

    def __init__(self, about: About, predict: Predict, checkpoint: str) -> None:
        super().__init__()
        self._table, self._predict = WordTable(about.words), predict
        self.spec = PolicySpec(
            name="learned:act",
            cameras=(),
            state="none",
            action="ee",
            horizon=max(about.options.chunk, 2),
            batch=BATCH,
            seeded=True,
            environment_state=True,
            embodiments=(about.robot,),
            checkpoint=checkpoint,
        )

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        """For each the next actions (T, 16): of a plan, of the way back, or rest."""
        over = [bool(query.memory.get("over")) for query in queries]
        asked = [query for query, ended in zip(queries, over, strict=True) if not ended]
        plans = iter(self._plans(asked))
        return [
            self._between_plans(query) if ended else next(plans)
            for query, ended in zip(queries, over, strict=True)
        ]

    def _plans(self, queries: Sequence[Query]) -> list[Chunk]:
        if not queries:
            return []
        seen = [query.observation for query in queries]
        rows = np.stack([one["environment_state"] for one in seen])
        batch = Batch(
            arms=from_poses(np.stack([one["ee"] for one in seen])),
            objects=rows.reshape(len(seen), SLOTS, len(FEATURES)),
            words=np.stack([self._table.row(one["instruction"]) for one in seen]),
            target=np.zeros((len(seen), 1, WIDTH), np.float32),
            beyond=np.zeros((len(seen), 1), bool),
        )
        found = []
        for query, plan in zip(queries, to_poses(self._predict(batch)), strict=True):
            here = np.asarray(query.observation["ee"], np.float32)
            query.memory.setdefault("home", here)
            rows, over = until_rest(here, plan)
            query.memory["over"] = over
            found.append(_actions(rows))
        return found

    def _between_plans(self, query: Query) -> Chunk:
        """The way back after a plan; rest after the last one."""
        memory, here = query.memory, np.asarray(query.observation["ee"], np.float32)
        memory["plans"] = memory.get("plans", 0) + 1
        if memory["plans"] >= PLANS:
            return _actions(np.repeat(here[None], self.spec.horizon or 1, axis=0))
        memory["over"] = False
        opened = here.copy()
        opened[:, 7] = 1.0
        return _actions(np.stack([opened, memory["home"]]))


def until_rest(
    here: NDArray[np.float32], plan: NDArray[np.float32]
) -> tuple[NDArray[np.float32], bool]:
    """The poses of `plan` (K, 2, 8), made at `here` (2, 8), up to and with the first two in which
    the arms rest, and whether there are such; all of them if not."""
    still = resting(np.concatenate([here[None], plan]))
    twice = np.flatnonzero(still[:-1] & still[1:])
    if not len(twice):
        return plan, False
    return plan[: int(twice[0]) + 2], True


def _actions(poses: NDArray[np.float32]) -> Chunk:
    return np.ascontiguousarray(poses.reshape(len(poses), -1), np.float32)
