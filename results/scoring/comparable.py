"""Scores over the trials that compare best with the official benchmark or with other policies.

Officially the object that a Multi View task asks for leads the others by more than 6 cm; here all
four extremes do, and mixed objects at levels 4 and 5, where there is no room, by less. A gap of the
same size makes the levels of the Distance tasks comparable with each other. And a policy that
executes long chunks may do a whole memory trial from what it saw before the cue was hidden.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate, chain

from robospa.results.failures.attribution import MEMORY
from robospa.results.records.trial_record import CHUNKS, LAST_QUERY, LEAD, TrialRecord
from robospa.results.scoring.models import ModelResults, restricted, results_of_records
from robospa.results.scoring.scores import level_name
from robospa.results.tables import Table, TableCell, TableRow, estimate_cell
from robospa.trial import CATEGORY_NAMES

LEVELS = (1, 2, 3, 4, 5, 0)
"""All levels, and their mean."""
CLEAR = 0.06
"""The official lead [m] of the Multi View tasks."""


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


CONDITIONS: Mapping[str, tuple[str, Callable[[TrialRecord], bool | None]]] = {
    "SDE": ("asked distance off any other by more than 6 cm", _leads),
    "CVR": ("asked object leads by more than 6 cm, as officially", _leads),
    MEMORY: ("asked again after the cue was hidden", asked_again),
}
"""Which trials of a category compare, in words and as a rule."""


def comparable(results: ModelResults) -> ModelResults:
    """`results` over the trials of CONDITIONS that compare; variants without any are left out."""
    records = {
        record.key: record
        for record in results.records
        if record.category in CONDITIONS and CONDITIONS[record.category][1](record)
    }
    ci = results.scores.ci
    return results_of_records(results.name, list(records), records, results.manifest, ci)


RATES = ("SR of all", "SR@1 of all", "SR of these", "SR@1 of these")
CHUNK = "actions a query"
NOTE = "In percent with 95 % intervals, over the variants that have such trials."
CHUNK_NOTE = (
    f"{CHUNK}: how many of an answer were executed, median [least, most] over all trials, without "
    "a trial's last answer where it had several."
)


def comparable_table(models: Sequence[ModelResults]) -> Table | None:
    """The categories of CONDITIONS over all trials and over those that compare, by level; None if
    no model has any of these. Published models, whose trials nobody knows, have no column."""
    sides = [(model, comparable(model)) for model in models if not model.published]
    known = {
        (r.category, level)
        for model, _ in sides
        for r in _records(model)
        for level in (r.key.level, 0)
    }
    heads = (*RATES, "these", *[CHUNK] * ((MEMORY, 0) in known))
    rows: list[TableRow] = []
    for category, (words, _) in CONDITIONS.items():
        if (category, 0) in known:
            name = f"{category} {CATEGORY_NAMES[category]}: {words}"
            rows.append(TableRow(name, kind="section"))
        for level in (level for level in LEVELS if (category, level) in known):
            cells = [_cells(*side, category, level)[: len(heads)] for side in sides]
            kind = "row" if level else "average"
            rows.append(TableRow(level_name(level), tuple(chain(*cells)), kind))
    if not rows:
        return None
    groups = tuple((model.name, len(heads)) for model, _ in sides)
    title = "Success rate (SR) where trials compare"
    notes = (NOTE, *[CHUNK_NOTE] * (CHUNK in heads))
    return Table("comparable", title, "", heads * len(sides), tuple(rows), groups, notes)


def _records(model: ModelResults) -> list[TrialRecord]:
    """The results of CONDITIONS' categories that say whether they compare."""
    return [
        record
        for record in model.records
        if record.category in CONDITIONS and {LEAD, CHUNKS} & record.diagnostics.keys()
    ]


def _cells(model: ModelResults, few: ModelResults, category: str, level: int) -> list[TableCell]:
    records, these = (
        [r for r in _records(x) if r.category == category and level in (0, r.key.level)]
        for x in (model, few)
    )
    parts = [x.scores.part(category, level) for x in (restricted(model, few.trials), few)]
    rates = [
        estimate_cell(part.values[metric] if part else None)
        for part in parts
        for metric in ("sr", "sr1")
    ]
    count = TableCell(f"{len(these)} of {len(records)}", len(these))
    return [*rates, count, TableCell(chunks_text(records) if category == MEMORY else "")]


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
