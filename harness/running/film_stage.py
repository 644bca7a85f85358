"""What a run's driver does about films: which, from what, and what it says of them at the end."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from robospa.harness.running.film_process import FilmConfig
from robospa.harness.running.films import Films
from robospa.harness.running.progress import Progress
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.settings import Recording, SettingsError
from robospa.harness.settings_file import FILE, read_settings
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS
from robospa.results.failures.labels import label
from robospa.results.records.films import film_name, films_in, owed_films
from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

UNSPOKEN_PARTS = "robospa.harness.official.sentences:unspoken_parts"
"""For trials whose sentence came from a checkout: a film does not show it."""


class FilmsInterrupted(KeyboardInterrupt):
    """Ctrl-C while only films were missing; the message says how to make them."""


def films_of(config: WorkerConfig, known: Mapping[TrialKey, TrialRecord], workers: int) -> Films:
    """The films of a run: those that it owes of its `known` trials, unless it wants none now."""
    films = Films(
        FilmConfig(
            config.folder,
            config.world,
            config.world_arguments,
            config.parts,
            config.step_scale,
            config.salt,
            config.cameras,
            config.parts_arguments,
        ),
        workers,
    )
    if config.video != "none":
        films.add(owed_films(config.folder, known.values()))
    return films


def finish_films(films: Films, progress: Progress, folder: Path) -> list[str]:
    """Wait for the films of a run whose trials are done; sentences about them.

    Raises FilmsInterrupted on Ctrl-C; what is not made stays owed.
    """
    began, before = time.monotonic(), films.made
    try:
        films.finish(lambda: progress.show_films(films.made - before, films.owed))
    except KeyboardInterrupt:
        count, how = films.owed, how_to_film(folder)
        raise FilmsInterrupted(f"{count} films are still to be made: {how}") from None
    finally:
        films.close()
    return film_lines(films, folder, time.monotonic() - began)


def film_lines(films: Films, folder: Path, seconds: float = 0.0) -> list[str]:
    """How many films were made, how long that was waited for, and why others were not."""
    lines = []
    if films.made:
        waited = f"; waited {seconds:.0f} s for them" if seconds >= 1.0 else ""
        lines.append(f"{films.made} films made{waited}")
    if films.failed:
        lines.append(f"warning: {films.failed} films could not be made: {films.troubles[0]}")
    if films.stopped and films.owed:
        lines.append(
            f"warning: {films.owed} films are still to be made ({films.stopped}): "
            f"{how_to_film(folder)}"
        )
    return lines


def how_to_film(folder: Path) -> str:
    """What makes the films that a run lacks."""
    return f"`robospa failures {folder} --film` makes them"


def unfilmed(run: Run) -> list[TrialRecord]:
    """The trials that `run` wants a film of and those that failed, as far as they have none."""
    there = films_in(run.folder)
    results = [record for _, record in sorted(run.records.items()) if finished(record)]
    return [
        record
        for record in results
        if film_name(record.key) not in there
        and (record.video == film_name(record.key) or label(record) is not None)
    ]


def films_afterwards(run: Run) -> Films:
    """The films that a `run` lacks which nobody is running; raises RunError if it cannot be filmed
    from its folder."""
    if run.in_progress:
        raise RunError(f"the run in {run.folder} is going on and makes its films itself")
    films = Films(replay_config(run))
    films.add(unfilmed(run))
    return films


def replay_config(run: Run) -> FilmConfig:
    """With which world and scenes trials of `run` are played again from its folder; raises RunError
    if they cannot be."""
    settings = run.manifest["settings"]
    world = dict(settings.get("world") or {})
    if settings.get("salt_sha256"):
        raise RunError(
            f"the scenes of {run.folder} are hidden: resume it to have it filmed; nothing else can "
            "play its trials again"
        )
    known = {"render", "control", "action_steps"}  # a folder may come from a stranger
    if world.pop("name", SAPIEN_NAME) != SAPIEN_NAME or world.keys() - known:
        raise RunError(
            f"{run.folder} was run in another world: its own run films its trials, and nothing "
            "else can play them again"
        )
    scale = float(settings.get("step_scale", 1.0))
    parts = UNSPOKEN_PARTS if settings.get("instructions") else TASK_PARTS
    return FilmConfig(run.folder, SAPIEN_NAME, world, parts, scale, cameras=_cameras(run.folder))


def _cameras(folder: Path) -> tuple[str, ...]:
    """The cameras that the run's own settings name for its films; the usual one without them."""
    try:
        return read_settings(folder / FILE).recording.cameras
    except SettingsError:
        return Recording().cameras


def film_now(run: Run) -> list[str]:
    """Make the films that `run` lacks, at full speed; sentences about them. Raises RunError, and
    FilmsInterrupted on Ctrl-C."""
    films = films_afterwards(run)
    if not films.owed:
        return ["no film is missing"]
    return finish_films(films, Progress(len(run.keys), len(run.keys)), run.folder)
