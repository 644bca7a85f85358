"""Finished trials of the fake world to be filmed, and processes for films that need no process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from run_fakes import FakePolicy, FakeWorld, parts, trial_keys

from robospa.harness.pool import WorkerDied
from robospa.harness.running.films import FilmDone
from robospa.harness.running.record_store import ActionRecorder, write_actions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.trial import run_trial
from robospa.results.records.runs import film_name
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEYS = trial_keys(6)


def recorded(
    folder: Path, key: TrialKey, policy: FakePolicy | None = None, scale: float = 1.0
) -> TrialRecord:
    """The record of a trial whose actions are on disk, and whose film is wanted."""
    folder.mkdir(exist_ok=True)
    recorder = ActionRecorder()
    record = run_trial(
        FakeWorld(),
        policy or FakePolicy(),
        key,
        policy_seed=0,
        recorder=recorder,
        parts=parts,
        step_scale=scale,
    )
    write_actions(folder, key, recorder.actions, "joint", recorder.joints)
    return replace(record, video=film_name(key))


@dataclass
class Filmers:
    """Put in place of `film_process`: threads of this process, which make what `film` makes."""

    film: Callable[[WorkerConfig, TrialRecord], FilmDone] = lambda _, record: FilmDone(record.key)
    asked: list[TrialKey] = field(default_factory=list)
    started: list[int] = field(default_factory=list)
    """The priority of each."""
    alive: int = 0

    def __call__(self, config: WorkerConfig, name: str, nice: int) -> Filmer:
        self.started.append(nice)
        self.alive += 1
        return Filmer(self, config)


@dataclass(eq=False)
class Filmer:
    """One of them."""

    all: Filmers
    config: WorkerConfig
    killed: bool = False

    def run(self, record: TrialRecord) -> FilmDone:
        self.all.asked.append(record.key)
        done = self.all.film(self.config, record)
        if self.killed:
            raise WorkerDied("signal 9")
        return done

    def kill(self) -> None:
        self.all.alive -= not self.killed
        self.killed = True
