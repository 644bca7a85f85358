"""The films of a run, made after their trials in processes of their own, while others go on.

Nothing of a film happens in a worker, and what goes wrong with it ends no trial and no run. Beside
the run few processes work; once its trials are done, as many as there are cores. A film that is not
made, whatever the reason, can be made later: its record names it.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import time
import traceback
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from robospa.harness.pool import LOWEST_PRIORITY, JobProcess, JobWorker, Pool, WorkerDied
from robospa.harness.progress import Progress
from robospa.harness.running.atomic_file import (
    LOGS,
    StorageError,
    log_to,
    replace_file,
    storage_errors,
)
from robospa.harness.running.status import cores
from robospa.harness.running.worker import WorkerConfig, describe, load_parts
from robospa.harness.settings import FILE, Recording, SettingsError, read_settings
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS, open_world
from robospa.results.comparison.profile import flipped
from robospa.results.failures.labels import label
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, film_name, films_in, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.text import counted
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.world import World

UNSPOKEN_PARTS = "robospa.harness.official.sentences:unspoken_parts"
"""For trials whose sentence came from a checkout: a film does not show it."""
RESERVE = 100e6
"""Bytes that films leave free on the run's disk: records need them, and end a run that has none."""
CORES_EACH = 4
"""Beside a run there is one process for so many cores."""
LONGEST = 1800.0
"""A film that takes longer is given up, and its process killed [s]."""
CRASHES = 3
"""After so many processes in a row that died over their films no more are made."""
POLL_SECONDS = 0.5
MOST_ALIKE = 3
"""With video "failures" so many films are made of the failures of one type at one task."""


class FilmsInterrupted(KeyboardInterrupt):
    """Ctrl-C while only films were missing; the message says how to make them."""


@dataclass(frozen=True)
class FilmDone:
    """The film of `key` is on disk, or could not be made because of `trouble`, a sentence; `stop`:
    no other can be made either."""

    key: TrialKey
    trouble: str = ""
    stop: bool = False


class FilmMaker:
    """Makes one film after the other in one world, which is built anew after an error."""

    def __init__(self, config: WorkerConfig) -> None:
        self.config = config
        self._world: World | None = None

    def make(self, record: TrialRecord) -> FilmDone:
        """Film the trial of `record`; whatever goes wrong is in the answer."""
        from robospa.harness.replay import ReplayError
        from robospa.harness.world import RenderUnavailable

        try:
            self._film(record)
        except (StorageError, RenderUnavailable) as error:
            return FilmDone(record.key, describe(error), stop=True)
        except ReplayError as error:
            return FilmDone(record.key, str(error))
        except Exception as error:
            with contextlib.suppress(OSError):  # the log's disk may be full
                traceback.print_exc()
            world, self._world = self._world, None
            if world is not None:
                with contextlib.suppress(Exception):
                    world.close()
            return FilmDone(record.key, f"{record.key.slug}: {describe(error)}")
        return FilmDone(record.key)

    def _film(self, record: TrialRecord) -> None:
        from robospa.harness.pictures.video import film

        config = self.config
        with storage_errors(config.folder):
            disk = os.statvfs(config.folder)
        if disk.f_bavail * disk.f_frsize < RESERVE:
            raise StorageError(
                f"{config.folder} has less than {RESERVE / 1e6:.0f} MB left, which records need"
            )
        if self._world is None:
            self._world = open_world(config.world, config.world_arguments, render=True)
        data = film(
            self._world,
            record,
            config.folder,
            parts=load_parts(config),
            step_scale=config.step_scale,
            cameras=config.cameras,
        )
        replace_file(config.folder / film_name(record.key), data, parents=False)


def film_maker(argument: tuple[WorkerConfig, str]) -> Callable[[TrialRecord], FilmDone]:
    """What the process of that name makes films with."""
    config, name = argument
    with contextlib.suppress(StorageError):  # said with the first film
        log_to(config.folder / LOGS / f"{name}.log")
    return FilmMaker(config).make


def film_process(config: WorkerConfig, name: str, nice: int) -> JobWorker[TrialRecord, FilmDone]:
    return JobProcess(film_maker, (config, name), seconds=LONGEST, name=name, nice=nice)


class Films:
    """Films of the trials of one run; `most` processes after its end, 0 for one a core.

    Only `finish` waits, and nothing but it raises: errors become `troubles`.
    """

    def __init__(self, config: WorkerConfig, most: int = 0, nice: int = LOWEST_PRIORITY) -> None:
        self.config = config
        self._most = most or cores()
        names = (f"films-{number:03d}" for number in count())
        self._pool: Pool[TrialRecord, FilmDone] = Pool(
            lambda: film_process(config, next(names), nice),
            max(1, cores() // CORES_EACH),
            deaths=1,
        )
        self._jobs: dict[Future[FilmDone], TrialRecord] = {}
        self._crashes = 0
        self._alike: Counter[tuple[str, str]] = Counter()
        self.made = 0
        self.failed = 0
        self.troubles: list[str] = []
        self.stopped = ""
        """Why no more films can be made, if that is so."""

    @property
    def pending(self) -> int:
        return len(self._jobs)

    def add(self, records: Iterable[TrialRecord], there: Container[str] = ()) -> None:
        """Film `records` in their order, after those that wait, but for the films that are `there`
        and failures of which enough are filmed."""
        for record in records:
            failure = label(record) if self.config.video == "failures" else None
            if failure is not None:
                self._alike[record.key.task, failure.kind] += 1
                if self._alike[record.key.task, failure.kind] > MOST_ALIKE:
                    continue
            if film_name(record.key) not in there:
                self._jobs[self._pool.submit(record)] = record

    def poll(self) -> None:
        """Take what was made; returns at once."""
        for future in [future for future in self._jobs if future.done()]:
            if not self.stopped:
                self._take(future)

    def finish(self, show: Callable[[], None] = lambda: None) -> None:
        """Make all that wait, now with all cores; `show` is called a few times a second."""
        self._pool.grow(min(self._most, self.pending))
        while self._jobs and not self.stopped:
            wait(self._jobs, POLL_SECONDS, FIRST_COMPLETED)
            self.poll()
            show()

    def close(self) -> None:
        """End the processes; what they were making can be made later."""
        self._pool.close()

    def _take(self, future: Future[FilmDone]) -> None:
        key = self._jobs[future].key
        try:
            done = future.result()
        except WorkerDied as error:
            done = FilmDone(key, f"{key.slug}: the process that filmed it died ({error})")
            self._crashes += 1
            if self._crashes >= CRASHES:
                self._stop(f"{CRASHES} processes in a row died while they filmed")
        except OSError as error:  # no process or pipe can be made: memory, limits
            done = FilmDone(key, f"no process for films can be started: {error}", stop=True)
        else:
            self._crashes = 0
        if done.stop:
            self._stop(done.trouble)
            return
        del self._jobs[future]
        if done.trouble:
            self.failed += 1
            self.troubles.append(done.trouble)
        else:
            self.made += 1

    def _stop(self, trouble: str) -> None:
        self.stopped = trouble
        self._pool.close()


def films_of(config: WorkerConfig, known: Mapping[TrialKey, TrialRecord], workers: int) -> Films:
    """The films of a run: those that its `known` trials lack, unless it wants none now."""
    films = Films(config, workers)
    if config.video != "none":
        there = films_in(config.folder)
        wanted = [r for r in known.values() if r.video == film_name(r.key)]
        films.add(sorted(wanted, key=lambda r: r.video not in there), there)
    return films


def finish_films(films: Films, progress: Progress) -> list[str]:
    """Wait for the films of a run whose trials are done; sentences about them.

    Raises FilmsInterrupted on Ctrl-C; what is not made can be made later.
    """
    began, before = time.monotonic(), films.made
    try:
        films.finish(lambda: progress.show_films(films.made - before, films.pending))
    except KeyboardInterrupt:
        how = how_to_film(films.config.folder)
        raise FilmsInterrupted(f"{films.pending} films are still to be made: {how}") from None
    finally:
        films.close()
    return film_lines(films, time.monotonic() - began)


def film_lines(films: Films, seconds: float = 0.0) -> list[str]:
    """How many films were made, how long that was waited for, and what becomes of others."""
    lines = []
    if films.made:
        waited = f"; waited {seconds:.0f} s for them" if seconds >= 1.0 else ""
        lines.append(f"{counted(films.made, 'film')} made{waited}")
    if films.failed:
        lines.append(f"warning: {films.failed} films could not be made: {films.troubles[0]}")
    if films.pending:
        warning, why = ("warning: ", f" ({films.stopped})") if films.stopped else ("", "")
        how = how_to_film(films.config.folder)
        lines.append(f"{warning}{counted(films.pending, 'film')} still to be made{why}: {how}")
    return lines


def how_to_film(folder: Path) -> str:
    """What makes the films that a run lacks."""
    return f"`robospa report {shlex.quote(str(folder))} --film` makes them"


def unfilmed(run: Run) -> list[TrialRecord]:
    """The trials that `run` wants a film of and those that failed, of a profile the shown pairs
    instead, as far as they have none."""
    there = films_in(run.folder)
    results = [record for _, record in sorted(run.records.items()) if finished(record)]
    shown = [record for record in results if label(record) is not None]
    if run.manifest.settings.profile:
        shown = [record for _, pair in flipped(run) for record in pair]
    keys = {record.key for record in shown}
    return [
        record
        for record in results
        if film_name(record.key) not in there
        and (record.video == film_name(record.key) or record.key in keys)
    ]


def films_afterwards(run: Run) -> Films:
    """The films that a `run` lacks which nobody is running; raises RunError if it cannot be filmed
    from its folder."""
    if run.in_progress:
        raise RunError(f"the run in {run.folder} is going on and makes its films itself")
    films = Films(replay_config(run), nice=0)
    films.add(unfilmed(run))
    return films


def replay_config(run: Run) -> WorkerConfig:
    """With which world and scenes trials of `run` are played again from its folder; raises RunError
    if they cannot be."""
    settings = run.manifest.settings
    world, arguments = settings.world.name or SAPIEN_NAME, settings.world.arguments
    if settings.salt_sha256:
        raise RunError(
            f"the scenes of {run.folder} are hidden: resume it to have it filmed; nothing else can "
            "play its trials again"
        )
    known = {"render", "control", "action_steps"}  # a folder may come from a stranger
    if world != SAPIEN_NAME or arguments.keys() - known:
        raise RunError(
            f"{run.folder} was run in another world: its own run films its trials, and nothing "
            "else can play them again"
        )
    return WorkerConfig(
        run.folder,
        "",
        world=SAPIEN_NAME,
        world_arguments=arguments,
        parts=UNSPOKEN_PARTS if settings.instructions else TASK_PARTS,
        step_scale=settings.step_scale,
        cameras=_cameras(run.folder),
    )


def _cameras(folder: Path) -> tuple[str, ...]:
    try:
        return read_settings(folder / FILE).recording.cameras
    except SettingsError:
        return Recording().cameras


def film_now(run: Run) -> list[str]:
    """Make the films that `run` lacks, at full speed; sentences about them. Raises RunError, and
    FilmsInterrupted on Ctrl-C."""
    progress = Progress(len(run.keys), len(run.keys))
    return finish_films(films_afterwards(run), progress) or ["no film is missing"]
