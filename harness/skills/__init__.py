"""Skills: a plan's calls turned into joint actions, from exact state, without the simulator."""

from robospa.harness.skills.expert import Expert
from robospa.harness.skills.workspace import SkillFailed

__all__ = ["Expert", "SkillFailed"]
