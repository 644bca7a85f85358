"""Why trials ended as they did: messages of records, grouped."""

from __future__ import annotations

import re
from collections.abc import Iterable

NUMBER = re.compile(r"0x[0-9a-f]+|[-+]?\d[\d.]*(?:e[-+]?\d+)?", re.IGNORECASE)


def error_kind(message: str) -> str:
    """`message` without its numbers: "nan in action 1" and "nan in action 7" are one error."""
    return NUMBER.sub("#", message)


def grouped(messages: Iterable[str], most: int = 5) -> list[tuple[int, str]]:
    """How many of `messages` are of one kind and the first of them, the most frequent first; what
    is over `most` kinds becomes one last row."""
    first: dict[str, str] = {}
    counts: dict[str, int] = {}
    for message in messages:
        kind = error_kind(message)
        first.setdefault(kind, message or "no reason was recorded")
        counts[kind] = counts.get(kind, 0) + 1
    common = sorted(counts.items(), key=lambda item: -item[1])
    rows = [(count, first[kind]) for kind, count in common[:most]]
    if rest := common[most:]:
        rows.append((sum(count for _, count in rest), f"for {len(rest)} other reasons"))
    return rows
