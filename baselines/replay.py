"""Replay: sends the actions that an earlier run recorded.

In a repeatable world this gives the same records without the model. Refuses trials that the run
does not have.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec, TrialInfo

CHUNK = 100


class ReplayPolicy:
    """Plays the traces in `RUN/actions`. Needs no observation but the step."""

    def __init__(self, run: Path) -> None:
        """Raises ValueError if `run` has no traces."""
        self._folder = run / "actions"
        first = next(self._folder.glob("*.npz"), None)
        if first is None:
            raise ValueError(f"{run} holds no action traces; give the folder of a finished run")
        space = _read(first)[1]
        self.spec = PolicySpec(
            name="replay",
            cameras=(),
            state="none",
            action=space,
            horizon=CHUNK,
            seeded=True,
            checkpoint=f"actions of {run.resolve().name}"[:200],
            needs_trial_key=True,
        )
        self._actions = np.zeros((0, 0), np.float32)

    def reset(self, trial: TrialInfo) -> None:
        """Load the trace of `trial`; ValueError if the run has none."""
        if trial.key is None:
            raise ValueError("a replay needs the trial's key to find its trace")
        path = self._folder / f"{trial.key.slug}.npz"
        if not path.is_file():
            raise ValueError(f"the replayed run has no trace of {trial.key.slug}")
        self._actions, _ = _read(path)

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The recorded actions from this step on, float32 (T, D); at the end, the last for ever."""
        step = int(observation["step"])
        if not len(self._actions):
            raise ValueError("the recorded trial has no actions")
        return self._actions[min(step, len(self._actions) - 1) :][:CHUNK]


def _read(path: Path) -> tuple[NDArray[np.float32], str]:
    with np.load(path, allow_pickle=False) as data:
        return np.asarray(data["actions"], dtype=np.float32), str(data["space"])


def create(run: str = "") -> ReplayPolicy:
    """A new policy, one per connection, that replays the run in the folder `run`."""
    if not run:
        raise ValueError("say which run to replay: robospa serve replay --arg run=runs/x")
    return ReplayPolicy(Path(run))
