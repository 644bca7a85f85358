"""Scores over the trials that compare best with the official benchmark or with other policies.

Officially the object that a Multi View task asks for leads the others by more than 6 cm; here all
four extremes lead by less, so that the scene does not tell which one is asked for. A gap of the
same size makes the levels of the Distance tasks comparable with each other. And a policy that
executes long chunks may do a whole memory trial from what it saw before the cue was hidden.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.models import ModelResults, restricted, results_of_records
from robospa.results.scoring.scores import level_name
from robospa.results.tables import Table, TableCell, TableRow, estimate_cell
from robospa.trial import CATEGORY_NAMES

LEAD = "lead"
"""The diagnostic that says by how much [m] what is asked for is ahead of what comes closest."""
CHUNKS, LAST_QUERY = "chunks", "last_query"
"""The diagnostics of a trial's queries: how many were followed by so many actions until the next,
by that number, and how many actions had been begun at the last one."""
CLEAR = 0.06
"""The official lead [m] of the Multi View tasks."""


def query_entries(asked: Sequence[int], steps: int) -> dict[str, object]:
    """What a record of `steps` actions keeps of its queries: `asked` says how many actions had been
    begun at each."""
    if not asked:
        return {}
    lengths = Counter(after - before for before, after in pairwise((*asked, steps)))
    return {CHUNKS: {str(n): lengths[n] for n in sorted(lengths)}, LAST_QUERY: asked[-1]}


def executed_chunks(record: TrialRecord) -> Counter[int]:
    """How many queries were followed by how many actions until the next one; of a trial's last
    query, whose actions its end cut off, only where it had no other."""
    found, last = record.diagnostics.get(CHUNKS), record.diagnostics.get(LAST_QUERY)
    if not isinstance(found, Mapping) or not isinstance(last, int):
        return Counter()
    known = {n: k for n, k in found.items() if n.isdigit() and isinstance(k, int)}
    lengths = Counter({int(n): k for n, k in known.items()})
    if lengths.total() > 1:
        lengths[record.steps - last] -= 1
    return +lengths


def lead(record: TrialRecord) -> float | None:
    """By how much [m] what was asked for is ahead of what comes closest; None where it is not
    known or nothing is."""
    found = record.diagnostics.get(LEAD)
    return float(found) if isinstance(found, (int, float)) else None


def asked_again(record: TrialRecord) -> bool | None:
    """Whether the policy was asked again after the cue was hidden; None where none was, or where
    the queries are not known."""
    hidden = [event.get("step") for event in record.events if event["kind"] == "cue_hidden"]
    last = record.diagnostics.get(LAST_QUERY)
    if not hidden or hidden[0] is None or not isinstance(last, int):
        return None
    return last >= hidden[0]


def _leads(record: TrialRecord) -> bool:
    found = lead(record)
    return found is not None and found > CLEAR


@dataclass(frozen=True)
class Condition:
    """Which trials of a category compare, in `words` and as a rule."""

    words: str
    holds: Callable[[TrialRecord], bool]


CONDITIONS = {
    "SDE": Condition("the asked distance differs from any other by more than 6 cm", _leads),
    "CVR": Condition("the asked object leads by more than 6 cm, as officially", _leads),
    "MIP": Condition("asked again after the cue was hidden", lambda r: bool(asked_again(r))),
}


def comparable(results: ModelResults) -> ModelResults:
    """`results` over the trials of CONDITIONS that compare; variants without any are left out."""
    records = {
        record.key: record
        for trials in results.trials.values()
        for record in trials.values()
        if record.category in CONDITIONS and CONDITIONS[record.category].holds(record)
    }
    ci = results.scores.ci
    return results_of_records(results.name, list(records), records, results.manifest, ci)


HEADS = ("SR of all", "SR of these", "SR@1 of these", "these", "actions a query")
NOTE = (
    "SR in percent with 95 % intervals, over variants with such trials. Actions a query: median "
    "[least, most] of an answer that were executed in all trials, but for a trial's last answer."
)


def comparable_table(models: Sequence[ModelResults]) -> Table | None:
    """The categories of CONDITIONS over all trials and over those that compare, by level; None if
    no model has any of these. Published models, whose trials nobody knows, have no column."""
    pairs = [(model, comparable(model)) for model in models if not model.published]
    sides = [(restricted(model, few.trials), few) for model, few in pairs]
    rows: list[TableRow] = []
    for category, condition in CONDITIONS.items():
        known = {n for _, few in sides for c, n in few.scores.categories if c == category}
        if known:
            name = f"{category} {CATEGORY_NAMES[category]}: {condition.words}"
            rows.append(TableRow(name, kind="section"))
        for level in sorted(known, key=lambda n: n or 9):
            cells = [cell for side in sides for cell in _cells(*side, category, level)]
            rows.append(TableRow(level_name(level), tuple(cells), "row" if level else "average"))
    if not rows:
        return None
    groups = tuple((model.name, len(HEADS)) for model, _ in sides)
    heads = HEADS * len(sides)
    title = "Success rate (SR) where trials compare"
    return Table("comparable", title, "", heads, tuple(rows), groups, (NOTE,))


def _cells(whole: ModelResults, few: ModelResults, category: str, level: int) -> list[TableCell]:
    records, these = _records(whole, category, level), _records(few, category, level)
    if not these:
        return [TableCell("–")] * len(HEADS)
    rates = [
        estimate_cell(found)
        for model, metric in ((whole, "sr"), (few, "sr"), (few, "sr1"))
        if (found := model.scores.categories[category, level].values[metric]) is not None
    ]
    count = TableCell(f"{len(these)} of {len(records)}", len(these))
    return [*rates, count, TableCell(chunks_text(records) if category == "MIP" else "")]


def _records(model: ModelResults, category: str, level: int) -> list[TrialRecord]:
    """The results of a category at a level; 0: at all."""
    return [
        record
        for (_, n), trials in model.trials.items()
        for record in trials.values()
        if record.category == category and level in (0, n)
    ]


def chunks_text(records: Iterable[TrialRecord]) -> str:
    """`50 [41, 50]`: median, least and most actions that were executed of an answer; "" where that
    is not known."""
    lengths: Counter[int] = sum(map(executed_chunks, records), Counter())
    return f"{median(lengths)} [{min(lengths)}, {max(lengths)}]" if lengths else ""


def median(lengths: Counter[int]) -> int | None:
    """The (lower) median; None of nothing."""
    order = sorted(lengths)
    below = accumulate(lengths[n] for n in order)
    return next((n for n, k in zip(order, below, strict=True) if 2 * k >= lengths.total()), None)
