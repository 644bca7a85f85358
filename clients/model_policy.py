"""What all servers of learned models share: one copy of the weights, and trials kept apart.

A model server is one object for all connections (`infer_batch`), so that weights are loaded once
and requests that arrive together can be one call. What belongs to a trial is kept by session.

A model's own code is imported lazily, from its own environment: from `PYTHONPATH`, or from the
folder given as option `code`. `ModelMissing` says what could not be found.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec, TrialInfo

Chunk = NDArray[np.float32]


class ModelMissing(Exception):
    """The model's code, weights or one of its files is not there; the message says which."""

    retriable = False


@dataclass
class Query:
    """One query: the observation, its trial, the `seed` of its noise, and the trial's `memory`,
    which is empty at the first query."""

    observation: Observation
    trial: TrialInfo
    seed: int
    memory: dict[str, Any] = field(default_factory=dict)


class ModelPolicy:
    """One model for all connections. A subclass has `spec` and `predict`."""

    spec: PolicySpec

    def __init__(self) -> None:
        self._trials: dict[int, tuple[TrialInfo, dict[str, Any]]] = {}

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        """One chunk per query, float32 (T, D)."""
        raise NotImplementedError

    def begin(self, trial: TrialInfo) -> None:
        """Prepare what the trial needs before its first observation, such as its text."""

    def reset(self, trial: TrialInfo) -> None:
        """A trial of a lone caller, without sessions."""
        self.reset_session(0, trial)

    def infer(self, observation: Observation) -> Chunk:
        """The chunk for a lone caller."""
        return self.infer_batch([observation], [0])[0]

    def reset_session(self, session: int, trial: TrialInfo) -> None:
        """A new trial on the connection `session`."""
        self.begin(trial)
        self._trials[session] = trial, {}

    def end_session(self, session: int) -> None:
        """The connection is gone."""
        self._trials.pop(session, None)

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[Chunk]:
        """One chunk per observation. The noise of each follows from its trial's policy seed and
        its step alone, so neither neighbours in the batch nor a repeated call change it."""
        queries = []
        for observation, session in zip(observations, sessions, strict=True):
            trial, memory = self._trials[session]
            seed = seed_of(trial.policy_seed, int(observation["step"]))
            queries.append(Query(observation, trial, seed, memory))
        return self.predict(queries)


def seed_of(policy_seed: int, step: int) -> int:
    """The seed, 0 to 2^63 - 1, of one prediction."""
    word = np.random.SeedSequence([policy_seed, step]).generate_state(1, np.uint64)[0]
    return int(word) >> 1


def import_code(module: str, code: str | None, whose: str) -> Any:
    """The `module` of a model's own code, found on PYTHONPATH or in the folder `code`.

    Raises ModelMissing.
    """
    if code is not None:
        folder = Path(code).expanduser().resolve()
        if not folder.is_dir():
            raise ModelMissing(f"there is no folder {folder}: option code must be {whose}")
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModelMissing(
            f"cannot import {module} ({error}): run this in the environment of the model, with "
            f"{whose} on PYTHONPATH or as option code"
        ) from error


def import_installed(module: str) -> Any:
    """A `module` that the model's environment has installed; raises ModelMissing."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModelMissing(
            f"cannot import {module} ({error}): run this in the environment of the model"
        ) from error


def import_torch() -> Any:
    """PyTorch; raises ModelMissing."""
    return import_installed("torch")


def existing(path: str, what: str) -> str:
    """`path` with ~ expanded; ModelMissing if nothing is there."""
    found = Path(path).expanduser()
    if not found.exists():
        raise ModelMissing(f"there is no {found}: option {what} must name a file or a folder")
    return str(found)
