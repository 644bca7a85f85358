"""The key of a trial, the unit of scheduling, retry, resume, record and replay; the categories."""

import re
from dataclasses import dataclass

from robospa.schema import Count, Name, SettingName

REFERENCE = "aloha-agilex"
"""The robot that a trial has by default."""


@dataclass(frozen=True, order=True)
class TrialKey:
    """Identifies a trial: the same key and the same actions give the same record, to the bit."""

    task: Name
    """Name of the task, such as `Pick_Blocks_Size`."""
    level: Count
    """1 to 5."""
    seed: Count
    """Decides the scene and the instruction."""
    embodiment: SettingName = REFERENCE
    """Name of the robot."""
    mode: SettingName = "clean"
    """Name of the scene mode."""
    split: Name = "heldout"
    """Instruction split: `train`, `heldout` or `indirect`."""

    @property
    def variant(self) -> tuple[str, int]:
        """Task and level."""
        return (self.task, self.level)

    @property
    def slug(self) -> str:
        """A file name for this trial, without an ending."""
        robot, mode = path_part(self.embodiment), path_part(self.mode)
        return f"{self.task}-L{self.level}-{self.seed}-{robot}-{mode}-{self.split}"


def path_part(name: str) -> str:
    """The name of a robot or scene mode as part of a path."""
    return re.sub(r"[:,=+]", "-", name)


SPATIAL = ("GAC", "SDE", "CPI", "RRR", "CVR")
PROCEDURAL = ("RPF", "OFE", "OCE", "CAC", "MIP")
CATEGORIES = SPATIAL + PROCEDURAL
BASIC = ("CBG", "EPG", "SOI")
"""The appendix's references: scored by category, part of no dimension, not of the overall value."""
CATEGORY_NAMES = {
    "GAC": "Geometric Attribute Cognition",
    "SDE": "Spatial Distance Estimation",
    "CPI": "Canonical Position Indexing",
    "RRR": "Referential Relational Reasoning",
    "CVR": "Cross-View Reasoning",
    "RPF": "Repetitive Procedure Following",
    "OFE": "Order-Free Execution",
    "OCE": "Order-Constrained Execution",
    "CAC": "Composite Action Coordination",
    "MIP": "Memory-Intensive Planning",
    "CBG": "Color-Based Grounding",
    "EPG": "Egocentric Position Grounding",
    "SOI": "Simple Ordinal Indexing",
}
DIMENSIONS = {"spatial": SPATIAL, "procedural": PROCEDURAL}
METRIC_NAMES = {"sr": "SR", "sr1": "SR@1", "onta": "ONTA", "onta1": "ONTA@1", "ps": "PS"}
"""Success rate, object-normalized target accuracy, progress score; @1: by the first choice."""
METRICS = tuple(METRIC_NAMES)
METRIC_CATEGORIES = {
    "sr": CATEGORIES,
    "sr1": CATEGORIES,
    "onta": SPATIAL,
    "onta1": SPATIAL,
    "ps": PROCEDURAL,
}
"""The categories that a metric is averaged over."""
RATES = {"sr": "sr", "sr1": "sr1", "onta": "sr", "onta1": "sr1"}
"""The rate of trials that a metric is computed from."""
