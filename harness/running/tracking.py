"""A run as seen by a tracker of experiments beside its own folder: `--log wandb`.

The folder stays what counts. A tracker that fails is left alone from then on, with one warning: it
costs no trial.
"""

import secrets
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robospa.extras import need
from robospa.harness.running.atomic_file import replace_file
from robospa.results.records.runs import Run, read_run
from robospa.results.records.trial_record import TrialRecord

PROJECT = "robospa"
ID_FILE = "wandb.txt"
"""In a run's folder: the id under which W&B knows it, so that a resumed run goes on there."""


class WandbTracker:
    """A run at Weights & Biases: its settings, the rates as they come, and its trials as a table.

    Where it goes, and with whose key, is what the variables of W&B say (WANDB_MODE, WANDB_API_KEY).
    Raises MissingPackage without wandb.
    """

    def __init__(self, folder: Path, project: str, settings: Mapping[str, Any]) -> None:
        self._wandb = need("wandb")
        self._run = self._wandb.init(
            project=project,
            name=folder.name,
            id=_identity(folder),
            resume="allow",
            dir=str(folder),
            config=dict(settings),
        )
        self._trials: dict[str, int] = {}
        self._won: dict[str, int] = {}

    def add(self, record: TrialRecord) -> None:
        """Log how many trials there are, and the success rates of all and of the trial's task."""
        if record.end == "infrastructure":
            return
        for name in ("", record.key.task):
            self._trials[name] = self._trials.get(name, 0) + 1
            self._won[name] = self._won.get(name, 0) + record.success
        rates = {
            f"success_rate/{name}" if name else "success_rate": self._won[name] / self._trials[name]
            for name in ("", record.key.task)
        }
        self._run.log({"trials": self._trials[""], **rates})

    def finish(self, run: Run) -> None:
        """Log the scores with their intervals and every trial."""
        from robospa.results.records.runs import by_setting, setting_name
        from robospa.results.run import trial_columns
        from robospa.results.scoring.scores import score_run

        for part in by_setting(run):
            place = "" if len(by_setting(run)) == 1 else f"{setting_name(part)}/"
            overall = score_run(part).overall.get(0)
            for metric, found in (overall.values if overall else {}).items():
                if found is not None:
                    ends = {"": found.value, "_low": found.low, "_high": found.high}
                    self._run.summary.update({f"{place}{metric}{k}": v for k, v in ends.items()})
        columns = trial_columns(run)
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        self._run.log({"all_trials": self._wandb.Table(columns=list(columns), data=rows)})
        self._run.summary.update({"missing": len(run.missing)})

    def close(self) -> None:
        """Let W&B send what it has."""
        self._run.finish()


class CarefulTracker:
    """The tracker that the setting `log` names, if any: left alone after its first error, which
    `say` is told. Raises MissingPackage without its package."""

    def __init__(
        self, log: str, folder: Path, settings: Mapping[str, Any], say: Callable[[str], None]
    ) -> None:
        name, _, project = log.partition(":")
        made = None if name == "none" else WandbTracker(folder, project or PROJECT, settings)
        self._tracker, self._say = made, say

    def add(self, record: TrialRecord) -> None:
        self._try(lambda tracker: tracker.add(record))

    def finish(self, folder: Path) -> None:
        self._try(lambda tracker: tracker.finish(read_run(folder)))

    def close(self) -> None:
        self._try(WandbTracker.close)

    def _try(self, call: Callable[[WandbTracker], None]) -> None:
        if self._tracker is None:
            return
        try:
            call(self._tracker)
        except Exception as error:
            self._tracker = None
            reason = f"{type(error).__name__}: {error}"
            self._say(f"warning: nothing more is logged with --log, the run goes on: {reason}")


def _identity(folder: Path) -> str:
    file = folder / ID_FILE
    try:
        return file.read_text().strip()
    except FileNotFoundError:
        made = secrets.token_hex(4)
        replace_file(file, f"{made}\n".encode())
        return made
