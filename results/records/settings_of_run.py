"""A run of several robots, scene modes or splits, taken apart: scores are of one of each."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from msgspec import structs

from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import Run, read_run
from robospa.results.scoring.setting import OFFICIAL
from robospa.trial import TrialKey

MARK = "@"
"""Between a run's folder and a robot, scene mode or split of it: `runs/mine@piper`."""
PARTS = ("embodiment", "mode", "split")


def by_setting(run: Run) -> list[Run]:
    """`run` itself, or a run for each robot, scene mode and split that it holds, in its order."""
    settings = dict.fromkeys(map(_setting, run.keys))
    if len(settings) < 2:
        return [run]
    return [_part(run, setting) for setting in settings]


def _setting(key: TrialKey) -> tuple[str, str, str]:
    return key.embodiment, key.mode, key.split


def _part(run: Run, setting: tuple[str, str, str]) -> Run:
    keys = tuple(key for key in run.keys if _setting(key) == setting)
    chosen = set(keys)
    parts = {name: (value,) for name, value in zip(PARTS, setting, strict=True)}
    settings = structs.replace(run.manifest.settings, **parts)
    return replace(
        run,
        manifest=structs.replace(run.manifest, settings=settings),
        keys=keys,
        records={key: record for key, record in run.records.items() if key in chosen},
        repeated=tuple(key for key in run.repeated if key in chosen),
    )


def setting_name(run: Run) -> str:
    """Robots, scene modes and splits of `run` in a few words, with its suite and clock where they
    are not the benchmark's; the usual mode and split go without saying."""
    robots = dict.fromkeys(key.embodiment for key in run.keys)
    modes = dict.fromkeys(key.mode for key in run.keys if key.mode != "clean")
    splits = dict.fromkeys(key.split for key in run.keys if key.split != "heldout")
    official = [run.manifest.suite] if run.manifest.suite.startswith(OFFICIAL) else []
    clock = [run.manifest.clock] if run.manifest.clock else []
    return ", ".join((*official, *robots, *modes, *splits, *clock))


def read_part(name: str) -> Run:
    """The run in a folder, or the part that `FOLDER@ROBOT`, `FOLDER@MODE` or `FOLDER@SPLIT` names.

    Raises RunError if the folder holds several of these and `name` does not choose one.
    """
    folder, mark, chosen = name.rpartition(MARK)
    if Path(name).exists() or not mark:
        folder, chosen = name, ""
    parts = by_setting(read_run(Path(folder).resolve()))
    found = [
        part
        for part in parts
        if not chosen or chosen in (*_setting(part.keys[0]), setting_name(part))
    ]
    if len(found) == 1:
        return found[0]
    names = ", ".join(setting_name(part) for part in parts)
    raise RunError(
        f"{folder} holds trials of {names}: choose one, such as {folder}{MARK}"
        f"{parts[0].keys[0].embodiment}"
    )
