"""A run as its user sees it: one that shows its scores and failures and becomes a data frame."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import fields
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.extras import need
from robospa.results.comparison.profile import Profile, profile_of
from robospa.results.failures.labels import NAMES, FailedTrials, failed_trials, label
from robospa.results.records.action_problems import KINDS, described
from robospa.results.records.runs import Run, finished, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.run_card import NOT_RUN, run_html, run_table
from robospa.results.scoring.comparable import (
    asked_again,
    comparable,
    executed_chunks,
    lead,
    median,
)
from robospa.results.scoring.first_choice import first_choice, held_at_start
from robospa.results.scoring.grounding import Grounding, Place, groundings, tally_of
from robospa.results.scoring.models import check_same, results_of_run, setting_of
from robospa.results.scoring.safety import RunSafety, read_safety
from robospa.results.scoring.scores import Scores, score_run
from robospa.results.tables import Table

if TYPE_CHECKING:
    from pandas import DataFrame


class LoadedRun(Run):
    """A run that was read: its manifest, its list of trials, and one record per finished trial.

        run = robospa.load_run("runs/mine")
        print(run.table())
        frame = run.to_pandas()
        by_level = frame.groupby("level").success.mean()

    In a notebook it shows its scores and its failures.
    """

    def table(self) -> Table:
        """The success rates with their intervals, by task and level: `print` shows it as text, a
        notebook as HTML."""
        return run_table(self)

    def scores(self, ci: str = "wilson") -> Scores:
        """All scores with their intervals, by variant, task, category, dimension and over all:
        `run.scores().overall[0].values["sr1"]` is the mean over levels of SR@1. IncomparableError
        of several robots, scene modes or splits, over which no mean is taken."""
        return score_run(self._of_one_setting(), ci)

    def comparable(self, ci: str = "wilson") -> Scores:
        """The same over the trials of SDE, CVR and MIP that compare (`docs/statistics.md`); columns
        `lead` [m] and `asked_again` of the frame say why."""
        return comparable(results_of_run(self._of_one_setting(), ci=ci)).scores

    def grounding(self) -> dict[Place, Grounding]:
        """What was chosen and what came of it, by task, category or dimension, and level (0:
        all): `run.grounding()["GAC", 0].execution` (`docs/statistics.md`)."""
        records = self._of_one_setting().records.values()
        return groundings(record for record in records if finished(record))

    def _of_one_setting(self) -> LoadedRun:
        name = f"{self.folder.name} (robospa.results.records.runs.by_setting takes it apart)"
        check_same([(name, setting_of(self.keys, self.manifest))], ())
        return self

    def profile(self, metric: str = "sr1", by: str = "all") -> Profile:
        """What each axis of a profile costs, paired with the clean trials; `by` "category", "level"
        or "task": `print(run.profile())` (`docs/profile.md`). RunError without axes."""
        return profile_of(self, metric, by)

    def safety(self) -> RunSafety:
        """Safe successes and what was measured, as `robospa report RUN --safety` found it by a
        replay: `print(run.safety())`. RunError if nothing was measured."""
        return read_safety(self)

    def failures(self) -> FailedTrials:
        """A list of every failed trial with the type of its failure and the evidence for it;
        `print` and a notebook show a line of each."""
        return failed_trials(self.records.values())

    def to_pandas(self) -> DataFrame:
        """One row a listed trial, as `trial_columns` has them; of a trial without a result
        everything but its key and `end` is missing.

        Counts and `success` have types that know missing values. Raises MissingPackage without
        pandas, which the extra `notebook` brings.
        """
        frame = need("pandas").DataFrame(trial_columns(self))
        kinds = dict.fromkeys(FLAGS, "boolean") | dict.fromkeys(NUMBERS, "float64")
        return frame.astype(kinds | dict.fromkeys((*COUNTS, *PROBLEMS, *CHOICES), "Int64"))

    def to_csv(self, path: str | Path) -> None:
        """Write the rows of `to_pandas` as CSV to the file `path`."""
        columns = trial_columns(self)
        with open(path, "w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(columns)
            rows.writerows(zip(*columns.values(), strict=True))

    def _repr_html_(self) -> str:
        return run_html(self)


def load_run(folder: str | Path) -> LoadedRun:
    """The run in `folder`, finished or not.

        run = robospa.load_run("runs/mine")
        ends = {key: record.end for key, record in run.records.items()}

    Raises:
        RunError: There is no run, or a file of it is damaged or contradicts itself.
        RepeatabilityError: Two records of one trial differ in more than times.
    """
    run = read_run(folder)
    return LoadedRun(**{field.name: getattr(run, field.name) for field in fields(run)})


Cell = str | int | float | bool | None

KEY_COLUMNS = ("task", "level", "seed", "embodiment", "mode", "split")
COUNTS = (
    "done", "best", "total", "candidates", "steps", "physics_steps", "policy_calls", "policy_seed",
    "attempts",
)  # fmt: skip
"""Fields of a record that are whole numbers; `TrialRecord` says what they mean."""


def _problem(name: str) -> Callable[[TrialRecord], Cell]:
    return lambda record: int(record.diagnostics.get(name, 0))


def _failure(record: TrialRecord) -> str:
    return NAMES[found.kind] if (found := label(record)) else ""


def _evidence(record: TrialRecord) -> str:
    return described(found.evidence, record) if (found := label(record)) else ""


FLAGS: Mapping[str, Callable[[TrialRecord], Cell]] = {
    "success": lambda record: record.success,
    "first_choice": first_choice,
    "asked_again": asked_again,
}
TEXTS: Mapping[str, Callable[[TrialRecord], Cell]] = {
    **{name: attrgetter(name) for name in ("category", "instruction")},
    "failure": _failure,
    "evidence": _evidence,
    **{name: attrgetter(name) for name in ("message", "video", "digest", "actions_digest")},
}
NUMBERS: Mapping[str, Callable[[TrialRecord], Cell]] = {
    "progress": lambda record: record.done / record.total if record.total else None,
    "idle_progress": lambda record: held_at_start(record) / record.total if record.total else None,
    "lead": lead,
    "chunk": lambda record: median(executed_chunks(record)),
    "wall_time": lambda record: float(record.wall_time),
    "latency_p50": lambda record: _latency(record, "p50"),
    "latency_p95": lambda record: _latency(record, "p95"),
}
"""`progress`: the share of subtasks that hold at the end, `idle_progress`: before the first action;
`lead` [m]: of what is asked for; `chunk`: actions executed of an answer, the median;
`wall_time` [s]; latencies [ms]."""
CHOICES: Mapping[str, Callable[[TrialRecord], Cell]] = {
    "choices": lambda record: tally_of(record).chosen,
    "right_choices": lambda record: tally_of(record).right,
    "carried_out": lambda record: tally_of(record).done,
}
PROBLEMS = {kind.name: _problem(kind.name) for kind in KINDS}
"""How many actions were executed otherwise than they were sent, by kind."""


def _latency(record: TrialRecord, name: str) -> float | None:
    found = record.latency.get(name)
    return None if found is None else float(found)


def trial_columns(run: Run) -> dict[str, list[Cell]]:
    """The listed trials of `run` by column, in their order.

    Columns: the fields of the key, `end`, FLAGS, COUNTS, PROBLEMS, CHOICES, NUMBERS, TEXTS. A trial
    without a result (`end` is "infrastructure" or "not run") has None in all but its key.
    """
    known = [run.records.get(key) for key in run.keys]
    records = [record if finished(record) else None for record in known]
    columns: dict[str, list[Cell]] = {
        name: [getattr(key, name) for key in run.keys] for name in KEY_COLUMNS
    }
    columns["end"] = [NOT_RUN if record is None else record.end for record in known]
    counts: dict[str, Callable[[TrialRecord], Cell]] = {n: attrgetter(n) for n in COUNTS}
    fields = {**FLAGS, **counts, **PROBLEMS, **CHOICES, **NUMBERS, **TEXTS}
    for name, value in fields.items():
        columns[name] = [None if record is None else value(record) for record in records]
    return columns
