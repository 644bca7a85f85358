"""Actions that were executed otherwise than they were sent, as trial records count them.

Nothing is refused for it: an arm whose pose is out of reach holds, a joint or gripper beyond its
range stops there. A policy that does so most of the time speaks another language than the robot, so
every reader of a run is told: how many actions, how large a share, one example, what to look at.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from robospa.results.records.trial_record import TrialRecord


@dataclass(frozen=True)
class ProblemKind:
    """A kind of problem: `name` is the entry of a record's `diagnostics` with the number of such
    actions, `first` the one with the first of them in words."""

    name: str
    first: str
    words: str
    """What such actions do, after "640 of 650 actions"."""
    hint: str
    """What to look at if there are many."""


UNREACHABLE = ProblemKind(
    "unreachable_actions",
    "first_unreachable",
    "ask for a pose out of reach, so that the arm holds",
    "are poses in the world frame, in metres, with quaternions w x y z?",
)
CLIPPED_JOINTS = ProblemKind(
    "clipped_joints",
    "first_clipped_joint",
    "send a joint beyond its limits, where it stops",
    "are joints absolute, in radians, in the order of the state?",
)
CLIPPED_GRIPPERS = ProblemKind(
    "clipped_grippers",
    "first_clipped_gripper",
    "send a gripper outside 0 (closed) to 1 (open)",
    "are grippers scaled to 0..1?",
)
OFTEN = 0.05
"""Share of a run's actions from which on a problem is a warning."""
KINDS = (UNREACHABLE, CLIPPED_JOINTS, CLIPPED_GRIPPERS)


@dataclass(frozen=True)
class ProblemCount:
    """How many `actions` of `of` have a problem of a kind, in how many `trials`; `first` is one."""

    kind: ProblemKind
    actions: int
    of: int
    trials: int
    first: str

    @property
    def share(self) -> float:
        """The share of all actions, 0 to 1."""
        return self.actions / self.of if self.of else 0.0

    @property
    def often(self) -> bool:
        """Whether the share is too large to be chance."""
        return self.share >= OFTEN

    @property
    def sentence(self) -> str:
        """How many actions do what, and what to look at if they are many."""
        words = f"{self.actions} of {self.of} actions ({_percent(self.share)}) {self.kind.words}"
        return f"{words}: {self.kind.hint}" if self.often else words

    def __str__(self) -> str:
        joint = " First" if self.often else "; first"  # a hint ends in a question mark
        return f"{self.sentence}{joint}: {self.first}"


def problem_counts(records: Iterable[TrialRecord]) -> list[ProblemCount]:
    """The problems of all actions in `records`, those with most actions first; none, no entry."""
    results = sorted((r for r in records if r.end != "infrastructure"), key=lambda r: r.key)
    total = sum(record.steps for record in results)
    found = []
    for kind in KINDS:
        struck = [record for record in results if _count(record, kind)]
        if struck:
            example = str(struck[0].diagnostics.get(kind.first, ""))
            where = f"{struck[0].key.slug}, " if len(results) > 1 else ""
            actions = sum(_count(record, kind) for record in struck)
            found.append(ProblemCount(kind, actions, total, len(struck), where + example))
    return sorted(found, key=lambda one: -one.actions)


def truncated_instructions(records: Iterable[TrialRecord]) -> int:
    """In how many trials the instruction was longer than the policy reads."""
    return sum(r.end != "infrastructure" and "text_budget" in r.diagnostics for r in records)


def problem_lines(records: Collection[TrialRecord]) -> list[str]:
    """What of a run's actions and instructions did not arrive as it was sent, in sentences."""
    lines = [str(one) for one in problem_counts(records)]
    if cut := truncated_instructions(records):
        total = sum(record.end != "infrastructure" for record in records)
        lines.append(
            f"{cut} of {total} trials ({_percent(cut / total)}) have an instruction that is longer "
            "than the policy reads"
        )
    return lines


def problem_data(records: Collection[TrialRecord]) -> dict[str, int]:
    """The same as counts: all actions, those of each kind, and trials with a truncated
    instruction."""
    counts = {one.kind.name: one.actions for one in problem_counts(records)}
    return {
        "actions": sum(r.steps for r in records if r.end != "infrastructure"),
        **{kind.name: counts.get(kind.name, 0) for kind in KINDS},
        "truncated_instructions": truncated_instructions(records),
    }


def trial_problems(record: TrialRecord) -> str:
    """The problems of one trial's actions in words; empty if there are none."""
    return "; ".join(map(str, problem_counts([record])))


def _count(record: TrialRecord, kind: ProblemKind) -> int:
    """Actions of `record` with that problem; whatever else a foreign record has there is none."""
    value = record.diagnostics.get(kind.name)
    return value if isinstance(value, int) and not isinstance(value, bool) and value > 0 else 0


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.005 else "under 1 %"


def described(text: str, record: TrialRecord) -> str:
    """`text` with the names of the scene's objects replaced by what the record calls them.

    A record that was written before records described their objects leaves `text` as it is.
    """
    known = record.diagnostics.get("objects")
    return with_names(text, known) if isinstance(known, dict) else text


def with_names(text: str, names: Mapping[str, object]) -> str:
    """`text` with the names of the scene's objects replaced by what `names` calls them."""
    if "object_" not in text:
        return text
    return re.sub(r"\bobject_\d+\b", lambda found: str(names.get(found[0], found[0])), text)


NUMBER = re.compile(r"0x[0-9a-f]+|[-+]?\d[\d.]*(?:e[-+]?\d+)?", re.IGNORECASE)


def error_kind(message: str) -> str:
    """`message` without its numbers: "nan in action 1" and "nan in action 7" are one error."""
    return NUMBER.sub("#", message)


def grouped(messages: Iterable[str], most: int = 5) -> list[tuple[int, str]]:
    """How many of `messages` are of one kind and the first of them, the most frequent first; what
    is over `most` kinds becomes one last row."""
    first: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for message in messages:
        kind = error_kind(message)
        first.setdefault(kind, message or "no reason was recorded")
        counts[kind] += 1
    common = counts.most_common()
    rows = [(count, first[kind]) for kind, count in common[:most]]
    if rest := common[most:]:
        rows.append((sum(count for _, count in rest), f"for {len(rest)} other reasons"))
    return rows
