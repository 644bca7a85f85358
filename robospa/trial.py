"""The key of a trial: the unit of scheduling, retry, resume, record and replay."""

from __future__ import annotations

from dataclasses import dataclass

REFERENCE = "aloha-agilex"
"""The suite's own robot: scenes are drawn for its workcell, and a trial has it by default."""


@dataclass(frozen=True, order=True)
class TrialKey:
    """What a trial is. The same key and the same actions give the same record."""

    task: str
    level: int
    seed: int
    embodiment: str = REFERENCE
    mode: str = "clean"
    split: str = "heldout"

    @property
    def variant(self) -> tuple[str, int]:
        """(task, level)."""
        return (self.task, self.level)

    @property
    def slug(self) -> str:
        """A file name for what belongs to this trial."""
        return f"{self.task}-L{self.level}-{self.seed}-{self.embodiment}-{self.mode}-{self.split}"
