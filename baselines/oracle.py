"""The oracle: solves every task from exact state, and says so in its spec.

It proves that a trial can be solved and shows what the harness looks like when it is. Its
numbers are an upper bound of the setup, never a policy's result.

`FailingOracle` has another plan (`robospa.harness.demonstrations.changed_plans`): it fails on
purpose, in one known way, which the failure analysis is measured on; or in many, as a model may.

    robospa serve mistakes --arg kind=neighbour
    robospa serve mistakes --arg kind=all
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robospa.harness.demonstrations.changed_plans import KINDS, ChangedExpert, occasions, wrong_plan
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.skills import Expert
from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot, snapshot_from_json

HORIZON = 200


class Oracle:
    """A privileged policy: builds the trial's scene itself and plans on the exact state."""

    spec = PolicySpec(
        name="oracle",
        cameras=(),
        state="commanded",
        action="joint",
        horizon=HORIZON,
        seeded=True,
        privileged=True,
        needs_trial_key=True,
        checkpoint="no weights",
    )

    def __init__(self, salt: str = "") -> None:
        """`salt` is the secret of hidden scenes."""
        self._salt = salt
        self._scene: Scene | None = None
        self._expert: Expert | None = None

    def reset(self, trial: TrialInfo) -> None:
        """Build the scene of `trial`; ValueError without its key."""
        key = trial.key
        if key is None:
            raise ValueError("the oracle needs the trial's key to rebuild its scene")
        self._scene = build_scene(
            key.task, key.level, key.seed, key.embodiment, key.mode, self._salt
        )
        self._expert = None

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The next skill's actions, float32 (T, D)."""
        expert, snapshot, _ = self._acting(observation)
        return expert.next(snapshot)

    def _acting(self, observation: Observation) -> tuple[Expert, Snapshot, Embodiment]:
        """Who acts in this trial, made at its first observation; what it sees now; the robot."""
        if self._scene is None:
            raise RuntimeError("the policy was asked for actions before a reset")
        robot = embodiment(self._scene.embodiment)
        snapshot = snapshot_from_json(observation["privileged"], robot.grippers)
        if self._expert is None:
            told = observation["privileged"].get("scene")  # by a world whose scenes have no key
            scene = self._scene if told is None else Scene.from_json(told)
            self._expert = self._planned(scene, snapshot)
        return self._expert, snapshot, robot

    def _planned(self, scene: Scene, snapshot: Snapshot) -> Expert:
        """Who acts in this trial."""
        return Expert(scene, snapshot)

    @property
    def failures(self) -> tuple[str, ...]:
        """Skills that failed in this trial, one sentence each."""
        return tuple(self._expert.failures) if self._expert is not None else ()


def create(salt: str = "") -> Oracle:
    """A new oracle, one per connection; `salt` is the secret of hidden scenes."""
    return Oracle(salt)


ALL = "all"
"""The mistake of a policy that makes now this one, now that, and sometimes none."""
TYPICAL = ("neighbour", "", "drops", "swaps", "stops", "beside", "forgets", "repeats")
"""Its mistakes, "" for none; those of the paper's analysis (section 5): wrong target, handling,
lost track, memory."""


class FailingOracle(Oracle):
    """Makes one mistake, the same one in every trial; where a task has no occasion, it holds.

    ALL takes another in every trial, by its policy seed, of those that the scene has occasion for.
    """

    def __init__(self, kind: str = "neighbour") -> None:
        super().__init__()
        if kind not in (*KINDS, ALL):
            raise ValueError(f"no mistake {kind!r}; there are {', '.join(KINDS)}, {ALL}")
        self.kind = kind
        self.spec = replace(Oracle.spec, name=f"mistakes:{kind}")
        self.applies = True
        self._seed = 0

    def reset(self, trial: TrialInfo) -> None:
        """Build the scene of `trial`; ValueError without its key."""
        super().reset(trial)
        self._seed = trial.policy_seed

    def _planned(self, scene: Scene, snapshot: Snapshot) -> Expert:
        kind = self.kind
        if kind == ALL:
            some = [one for one in TYPICAL if one in ("", *occasions(scene))]
            kind = some[self._seed % len(some)]
        if not kind:
            return Expert(scene, snapshot)
        try:
            plan, self.applies = wrong_plan(kind, scene), True
        except ValueError:
            plan, self.applies = (), False
        return ChangedExpert(scene, snapshot, plan)
