"""Films of trials: one file each in the run's folder `videos`, made after their records.

A record names the film that its run wants of it. Until the file is there, the film is owed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

VIDEOS = "videos"
"""Folder inside a run that holds the films."""


def film_name(key: TrialKey) -> str:
    """Path of the film of `key` inside its run's folder."""
    return f"{VIDEOS}/{key.slug}.mp4"


def films_in(folder: Path) -> frozenset[str]:
    """Paths of the films that are there, inside the run's `folder`."""
    try:
        return frozenset(f"{VIDEOS}/{name}" for name in os.listdir(folder / VIDEOS))
    except OSError:
        return frozenset()


def owed_films(folder: Path, records: Iterable[TrialRecord]) -> list[TrialRecord]:
    """Those of `records` whose film the run in `folder` wants and does not have."""
    there = films_in(folder)
    return [r for r in records if r.video == film_name(r.key) and r.video not in there]
