"""Our simulator with the official start of a trial, if that is asked for."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from robospa.geometry import angle_between
from robospa.harness.sim.motion import RATE
from robospa.harness.sim.physics import Physics, packed_poses
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.world import SceneUnstable
from robospa.observation import Observation
from robospa.protocol.policy import PolicySpec
from robospa.tasks.scene import Scene

STEPS = 2750
"""Physics steps that pass officially before the first observation: 11 s."""
LOOKED_AT = 200
"""The last of them in which nothing may have turned by MOST_TURN."""
MOST_TURN = math.radians(3.0)


class OfficialWorld(SapienWorld):
    """A world that settles scenes as ours, or, with `settle` "official", for 11 s. Then a scene is
    unstable if anything turned by more than 3 degrees in the last 0.8 s, officially the only thing
    that is looked at."""

    def __init__(self, settle: str = "usual", **arguments: Any) -> None:
        super().__init__(**arguments)
        self._settle = settle

    def load(self, scene: Scene, contacts: bool = False) -> None:
        super().load(scene, contacts)
        if self._settle == "official":
            _wait(self.loaded(), f"{scene.task} level {scene.level} seed {scene.seed}")

    def observe(self, spec: PolicySpec) -> Observation:
        """As in `SapienWorld`; what is privileged has the `scene` too, because no key tells it."""
        seen = super().observe(spec)
        if spec.privileged:
            seen["privileged"] = {**seen["privileged"], "scene": self._scene.to_json()}
        return seen

    def info(self) -> Mapping[str, object]:
        return {**super().info(), "settle": self._settle}


def _wait(physics: Physics, where: str) -> None:
    """Let 11 s pass; SceneUnstable if something still turns at their end."""
    names = list(physics.moving)
    for _ in range(STEPS - LOOKED_AT):
        physics.step()
    turns = [packed_poses(physics, names)[:, :4]]
    for _ in range(LOOKED_AT):
        physics.step()
        turns.append(packed_poses(physics, names)[:, :4])
    if not names:
        return
    last = np.tile(turns[-1], (len(turns), 1))
    change = angle_between(np.concatenate(turns), last).reshape(len(turns), -1).max(axis=0)
    worst = int(change.argmax())
    if change[worst] > MOST_TURN:
        raise SceneUnstable(
            f"object {names[worst]!r} of {where} still turns after {STEPS / RATE:g} s; this seed "
            "is not valid"
        )
