"""The trials of a run as columns: for pandas, Parquet, and whatever reads those."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.extras import need
from robospa.results.failures.labels import NAMES, label
from robospa.results.records.action_problems import KINDS
from robospa.results.records.object_names import described
from robospa.results.records.run_io import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from pandas import DataFrame

Cell = str | int | float | bool | None
NOT_RUN = "not run"
"""The `end` of a listed trial without a record."""

KEY_COLUMNS = ("task", "level", "seed", "embodiment", "mode", "split")
COUNTS = (
    "done", "best", "total", "candidates", "steps", "physics_steps", "policy_calls", "policy_seed",
    "attempts",
)  # fmt: skip
"""Fields of a record that are whole numbers; `TrialRecord` says what they mean."""


def _problem(name: str) -> Callable[[TrialRecord], Cell]:
    return lambda record: int(record.diagnostics.get(name, 0))


def _failure(record: TrialRecord) -> str:
    found = label(record)
    return "" if found is None else NAMES[found.kind]


def _evidence(record: TrialRecord) -> str:
    found = label(record)
    return "" if found is None else described(found.evidence, record)


TEXTS: Mapping[str, Callable[[TrialRecord], Cell]] = {
    "category": lambda record: record.category,
    "instruction": lambda record: record.instruction,
    "failure": _failure,
    "evidence": _evidence,
    "message": lambda record: record.message,
    "video": lambda record: record.video,
    "digest": lambda record: record.digest,
    "actions_digest": lambda record: record.actions_digest,
}
NUMBERS: Mapping[str, Callable[[TrialRecord], Cell]] = {
    "progress": lambda record: record.done / record.total if record.total else None,
    "wall_time": lambda record: float(record.wall_time),
    "latency_p50": lambda record: _latency(record, "p50"),
    "latency_p95": lambda record: _latency(record, "p95"),
}
"""`progress`: the share of subtasks that hold at the end; `wall_time` [s]; latencies [ms]."""
PROBLEMS = {kind.name: _problem(kind.name) for kind in KINDS}
"""How many actions were executed otherwise than they were sent, by kind."""


def _latency(record: TrialRecord, name: str) -> float | None:
    found = record.latency.get(name)
    return None if found is None else float(found)


def trial_columns(run: Run) -> dict[str, list[Cell]]:
    """The listed trials of `run` by column, in their order.

    Columns: the fields of the key, `end`, `success`, COUNTS, PROBLEMS, NUMBERS, TEXTS. A trial
    without a result (`end` is "infrastructure" or "not run") has None in all but its key.
    """
    records = [_result(run, key) for key in run.keys]
    columns: dict[str, list[Cell]] = {
        name: [getattr(key, name) for key in run.keys] for name in KEY_COLUMNS
    }
    columns["end"] = [_end(run, key) for key in run.keys]
    fields: dict[str, Callable[[TrialRecord], Cell]] = {
        "success": lambda record: record.success,
        **{name: _count(name) for name in COUNTS},
        **PROBLEMS,
        **NUMBERS,
        **TEXTS,
    }
    for name, value in fields.items():
        columns[name] = [None if record is None else value(record) for record in records]
    return columns


def _count(name: str) -> Callable[[TrialRecord], Cell]:
    return lambda record: int(getattr(record, name))


def _result(run: Run, key: TrialKey) -> TrialRecord | None:
    record = run.records.get(key)
    return record if finished(record) else None


def _end(run: Run, key: TrialKey) -> str:
    record = run.records.get(key)
    return NOT_RUN if record is None else record.end


def to_pandas(run: Run) -> DataFrame:
    """`trial_columns` as a data frame; counts and `success` have types that know missing values.

    Raises MissingPackage without pandas.
    """
    frame = need("pandas").DataFrame(trial_columns(run))
    kinds = {"success": "boolean", **dict.fromkeys((*COUNTS, *PROBLEMS), "Int64")}
    kinds |= dict.fromkeys(NUMBERS, "float64")
    return frame.astype(kinds)


def to_parquet(run: Run, path: Path) -> None:
    """Write `trial_columns` to `path`; raises MissingPackage without pyarrow."""
    arrow, parquet = need("pyarrow"), need("pyarrow.parquet")
    texts = dict.fromkeys((*KEY_COLUMNS, "end", *TEXTS), arrow.string())
    numbers = dict.fromkeys(NUMBERS, arrow.float64())
    counts = dict.fromkeys(("level", "seed", *COUNTS, *PROBLEMS), arrow.int64())
    kinds = {**texts, **numbers, **counts, "success": arrow.bool_()}
    columns = trial_columns(run)
    schema = arrow.schema([(name, kinds[name]) for name in columns])
    parquet.write_table(arrow.table(columns, schema=schema), path)
