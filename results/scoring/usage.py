"""What runs have used of what is paid for: answers, tokens and money of policies that ask a model.

A record keeps it as its policy reported it (`robospa.protocol.policy.USAGE`), attempts that did not
count included; a missing trial has no record, so what it has used is not here.
"""

from collections.abc import Iterable, Mapping, Sequence

from robospa.results.records.trial_record import USAGE, TrialRecord
from robospa.results.scoring.models import ModelResults
from robospa.results.tables import Table, TableCell, TableRow
from robospa.trial import CATEGORY_NAMES

COLUMNS = {
    "requests": "answers",
    "repairs": "unusable",
    "unanswered": "unanswered",
    "input_tokens": "input tokens",
    "output_tokens": "output tokens",
    "cost": "cost",
    "seconds": "hours",
    "exhausted": "used up",
}
"""Entries of a record, and what their column is called; seconds are shown as hours."""
NOTE = (
    "Cost is at the prices that the policy was told; a request without an answer may be paid for "
    "as well. Used up: trials that ended at a bound on answers, seconds or cost."
)


def used(record: TrialRecord) -> dict[str, float]:
    """What a trial has used, by the names of COLUMNS; empty where nothing was reported."""
    found = record.diagnostics.get(USAGE)
    known = found if isinstance(found, Mapping) else {}
    return {name: known[name] for name in COLUMNS if isinstance(known.get(name), int | float)}


def total(records: Iterable[TrialRecord]) -> dict[str, float]:
    """The sums over `records`, and `trials`: how many of them report any; empty for none."""
    rows = [found for record in records if (found := used(record))]
    sums = {n: sum(row.get(n, 0) for row in rows) for n in COLUMNS}
    return {"trials": len(rows), **sums} if rows else {}


def usage_table(models: Sequence[ModelResults]) -> Table | None:
    """What the runs have used by category and in all; None where no record says."""
    rows: list[TableRow] = []
    for model in models:
        by_category: dict[str, list[TrialRecord]] = {name: [] for name in CATEGORY_NAMES}
        for record in model.records:
            by_category.setdefault(record.category, []).append(record)
        sums = {name: total(of) for name, of in by_category.items()}
        found = [TableRow(name, _cells(of)) for name, of in sums.items() if of]
        if found:
            everything = TableRow("all", _cells(total(model.records)), "average")
            section = [TableRow(model.name, kind="section")] * (len(models) > 1)
            rows += [*section, *found, everything]
    heads = ("trials", *COLUMNS.values(), "cost a trial")
    return Table("usage", "What was used", "", heads, tuple(rows), notes=(NOTE,)) if rows else None


def _cells(sums: Mapping[str, float]) -> tuple[TableCell, ...]:
    counts = {**sums, "seconds": sums["seconds"] / 3600, "each": sums["cost"] / sums["trials"]}
    styles = {"seconds": ".2f", "cost": ".4f", "each": ".4f"}
    return tuple(TableCell(f"{n:{styles.get(name, ',.0f')}}", n) for name, n in counts.items())


def usage_line(records: Iterable[TrialRecord], trials: int = 0) -> str:
    """What `records` have used in a sentence, or what so many `trials` like these would use; empty
    where no record says."""
    sums = total(records)
    if not sums:
        return ""
    scale = trials / sums["trials"] if trials else 1.0
    n = {name: f"{value * scale:,.0f}" for name, value in sums.items()}
    what = (
        f"{n['requests']} answers of {sums['seconds'] / max(1, sums['requests']):.1f} s, "
        f"{n['input_tokens']} input and {n['output_tokens']} output tokens, "
        f"cost {scale * sums['cost']:.2f}"
    )
    return f"{trials:,} trials like these {sums['trials']:,.0f}: {what}" if trials else what
