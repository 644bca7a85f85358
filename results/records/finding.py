"""What a lint finds."""

from __future__ import annotations

from dataclasses import dataclass

SEVERITIES = ("error", "warning", "note")
"""From wrong numbers to what a reader may want to know."""


@dataclass(frozen=True)
class Finding:
    """One thing found: `rule` is its short name, `severity` is one of SEVERITIES."""

    rule: str
    severity: str
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.text} [{self.rule}]"
