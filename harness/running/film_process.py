"""A process that makes films, one at a time, beside the run or after it.

It is sent records and answers each with a `FilmDone`. It ends with its driver.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robospa.harness.running.worker_start import die_with_driver

if TYPE_CHECKING:
    from robospa.harness.world import World
    from robospa.results.records.trial_record import TrialRecord
    from robospa.trial import TrialKey


RESERVE = 100e6
"""Bytes that films leave free on the run's disk: records need them, and end a run that has none."""


@dataclass(frozen=True)
class FilmConfig:
    """What is needed to film the trials of the run in `folder`; picklable.

    `world` and `parts` are the run's, as in `WorkerConfig`, and so are `step_scale` and `salt`.
    `cameras` are shown side by side.
    """

    folder: Path
    world: str
    world_arguments: Mapping[str, Any]
    parts: str
    step_scale: float = 1.0
    salt: str = field(default="", repr=False)
    cameras: tuple[str, ...] = ("head",)
    parts_arguments: Mapping[str, Any] = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class FilmDone:
    """The film of `key` is on disk, or could not be made because of `trouble`, a sentence; `stop`:
    no other can be made either."""

    key: TrialKey
    trouble: str = ""
    stop: bool = False


class FilmMaker:
    """Makes one film after the other in one world, which is built anew after an error."""

    def __init__(self, config: FilmConfig) -> None:
        self.config = config
        self._world: World | None = None

    def make(self, record: TrialRecord) -> FilmDone:
        """Film the trial of `record`; whatever goes wrong is in the answer."""
        from robospa.harness.replay import ReplayError
        from robospa.harness.running.atomic_file import StorageError
        from robospa.harness.running.worker import describe
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
            self.close()
            return FilmDone(record.key, f"{record.key.slug}: {describe(error)}")
        return FilmDone(record.key)

    def _film(self, record: TrialRecord) -> None:
        from robospa.harness.factory import load_function
        from robospa.harness.pictures.video import film
        from robospa.harness.running.atomic_file import StorageError, replace_file, storage_errors
        from robospa.harness.worlds import open_world
        from robospa.results.records.films import film_name

        config = self.config
        with storage_errors(config.folder):
            disk = os.statvfs(config.folder)
        if disk.f_bavail * disk.f_frsize < RESERVE:
            raise StorageError(
                f"{config.folder} has less than {RESERVE / 1e6:.0f} MB left, which records need"
            )
        if self._world is None:
            self._world = open_world(config.world, config.world_arguments, render=True)
        arguments = {**config.parts_arguments, **({"salt": config.salt} if config.salt else {})}
        parts = partial(load_function(config.parts), **arguments)
        data = film(
            self._world,
            record,
            config.folder,
            parts=parts,
            step_scale=config.step_scale,
            cameras=config.cameras,
        )
        replace_file(config.folder / film_name(record.key), data, parents=False)

    def close(self) -> None:
        """Free the world."""
        world, self._world = self._world, None
        if world is not None:
            with contextlib.suppress(Exception):
                world.close()


def main(pipe: Connection, config: bytes, name: str) -> None:
    """Entry point of the process; `config` is a pickled FilmConfig."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    die_with_driver()
    from robospa.harness.running.atomic_file import StorageError
    from robospa.harness.running.log_file import LOGS, log_to

    found: FilmConfig = pickle.loads(config)
    with contextlib.suppress(StorageError):  # said with the first film
        log_to(found.folder / LOGS / f"{name}.log")
    serve(FilmMaker(found), pipe.recv, pipe.send)


def serve(
    maker: FilmMaker,
    receive: Callable[[], TrialRecord | None],
    send: Callable[[FilmDone], None],
) -> None:
    """Make what is asked for until None comes or the driver is gone."""
    try:
        while (record := receive()) is not None:
            send(maker.make(record))
    except (EOFError, OSError):
        return
    finally:
        maker.close()
