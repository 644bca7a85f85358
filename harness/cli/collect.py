"""`robospa collect`: a data set of the expert's demonstrations, or one recording; `--verify` checks
a data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from robospa.harness.cli.options import SEED, TRIALS, AsJson, aside, print_json, with_flags
from robospa.harness.datasets.settings import Collection
from robospa.harness.datasets.workers import MakerError, pool_opener
from robospa.harness.running.atomic_file import StorageError
from robospa.harness.running.status import cores
from robospa.harness.settings import Compute, SettingsError

if TYPE_CHECKING:
    from robospa.trial import TrialKey

T = TypeVar("T")

REPLAYS = 59
"""The fewest that find, in 95 of 100 cases, a bad episode where a twentieth are bad."""
FIRST = ("tasks", "levels", "episodes", "embodiment", "mode", "images", "cameras", "workers")
"""Settings that stand in the help."""


def _more(*flags: str, **given: Any) -> Any:
    """An option that stands under --help-all alone."""
    return typer.Option(*flags, hidden=True, rich_help_panel="More", **given)


@with_flags([Collection, Compute], first=FIRST)
def collect(
    folder: Annotated[Path | None, typer.Argument(help="the same as --out")] = None,
    out: Annotated[Path | None, typer.Option(help="folder of the data set")] = None,
    layout: Annotated[
        str,
        typer.Option(
            "--format",
            help="lerobot-v3, lerobot-v2.1 or robotwin-hdf5",
        ),
    ] = "lerobot-v3",
    resume: Annotated[
        bool, typer.Option("--resume", help="go on with the data set in --out")
    ] = False,
    keep_episodes: Annotated[
        bool, _more("--keep-episodes", help="keep the file of every episode as well")
    ] = False,
    verify: Annotated[
        Path | None, typer.Option(help="only check the data set in this folder")
    ] = None,
    replays: Annotated[
        int,
        _more(
            callback=TRIALS,
            help="with --verify: episodes to replay, of each robot; with --import: of each folder",
        ),
    ] = REPLAYS,
    imported: Annotated[
        Path | None,
        typer.Option(
            "--import",
            help="only play the recordings (HDF5) below this folder again; with --out, make a "
            "data set of the official ones",
        ),
    ] = None,
    record: Annotated[
        str | None,
        typer.Option(
            metavar="TASK",
            help="only record one demonstration, at --levels (default 1), to the file --out",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        _more(callback=SEED, help="with --record: the scene; default: first accepted one"),
    ] = None,
    questions: Annotated[
        bool,
        typer.Option(
            "--questions", help="collect pictures and sentences with the object that is asked for"
        ),
    ] = False,
    as_json: AsJson = False,
    **given: object,
) -> None:
    """Collect demonstrations of the expert to train policies with.

    An episode is a trial of a training seed, which no evaluation uses, with sentences of the split
    train. It is kept if its recorded commands, sent one by one, meet the goal within the step
    limit; otherwise the next seed takes its place. After Ctrl-C or a crash, the same command with
    --resume continues and ends with the same bytes.
    """
    if folder is not None and out is not None:
        raise SettingsError(f"{folder} and --out {out} name two folders: give one of them")
    out = folder or out
    if verify is not None:
        _verify(verify, replays, as_json)
        return
    if record is not None:
        _record(record, _group(Collection, given), seed, out, as_json)
        return
    if imported is not None:
        if out is None:
            _import(imported, replays, as_json)
        else:
            _convert(imported, out, layout, _group(Collection, given).images, as_json)
        return
    if out is None:
        raise SettingsError("name a folder for the data set with --out")
    if questions:
        _questions(_group(Collection, given), out, _group(Compute, given).workers, as_json)
        return
    from robospa.harness.cli.eval import resumable
    from robospa.harness.datasets import collect as collecting

    order = collecting.Order(_group(Collection, given), layout, out)
    again = f"the same command with --out {quote(str(out))} --resume goes on from here"
    with (
        resumable("the collection", again, (MakerError, StorageError)),
        pool_opener(_group(Compute, given)) as open_pool,
    ):
        result = collecting.make(
            order,
            open_pool,
            resume=resume,
            keep_episodes=keep_episodes,
            say=aside if as_json else print,
        )
    if as_json:
        made = {} if result is None else asdict(result)
        print_json({"out": out, "finished_before": result is None, **made})
    elif result is None:
        print(f"{out}: the data set is finished")
    if result is None:
        return
    for line in result.missing:
        aside(f"robospa: {line}")
    if not as_json:
        checked = f"robospa collect --verify {quote(str(out))} checks them"
        print(f"{out}: {result.episodes} episodes; {checked}")
    if result.missing:
        raise typer.Exit(1)


def _questions(asked: Collection, out: Path, workers: int, as_json: bool) -> None:
    from robospa.harness.datasets.questions import collect_questions

    found = collect_questions(asked, out, workers or cores(), aside if as_json else print)
    if as_json:
        print_json({"out": out, "questions": found})
    else:
        print(f"{out}: {found} questions")


def _group(kind: type[T], given: Mapping[str, object]) -> T:
    """The settings of one group among all that were given."""
    return kind(**{field.name: given[field.name] for field in fields(kind)})  # type: ignore[arg-type]


def _import(folder: Path, most: int, as_json: bool) -> None:
    """Play the recordings below `folder` again and print how often they meet their goal."""
    from robospa.harness.official.recordings import (
        chosen,
        find_recordings,
        replay_recording,
        summary,
    )
    from robospa.harness.sim.sapien_world import SapienWorld

    recordings = chosen(find_recordings(folder), most)
    world = SapienWorld(render=False)
    replays = [replay_recording(recording, world) for recording in recordings]
    if as_json:
        print_json([{**asdict(one), "recording": one.recording.path} for one in replays])
        return
    for line in summary(replays):
        print(line)


def _convert(folder: Path, out: Path, layout: str, images: str, as_json: bool) -> None:
    """Make a data set of the official recordings below `folder`, and say what is not in it."""
    from robospa.harness.datasets.imports import import_recordings
    from robospa.harness.official.recordings import find_recordings

    made = import_recordings(find_recordings(folder), folder, layout, out, images)
    left_out = Counter(row["why"] for row in made.settings["left_out"])
    for why, count in left_out.most_common():
        aside(f"robospa: {count} recordings are left out: {why}")
    lacks = list(made.settings["absent"])
    if as_json:
        counts = {"episodes": made.episodes, "frames": made.frames}
        print_json({"out": out, **counts, "absent": lacks, "left_out": dict(left_out)})
        return
    absent = ", ".join(lacks)
    print(f"{out}: {made.episodes} official recordings; they do not have {absent}")
    print(f"robospa collect --verify {quote(str(out))} checks hashes and counts")


def _verify(out: Path, replays: int, as_json: bool) -> None:
    """Check the data set in `out`, or those of several robots; ends with 1 if one is not sound."""
    from robospa.harness.datasets.manifest import MANIFEST
    from robospa.harness.datasets.verify import verify as check

    folders = [path.parent for path in sorted(out.glob(f"*/{MANIFEST}"))]
    verdicts = {}
    for folder in folders or [out]:
        verdict = verdicts[str(folder)] = check(folder, replays)
        for line in [] if as_json else verdict.checked:
            print(f"{folder}: {line}")
        for line in verdict.problems:
            aside(f"robospa: {line}")
    sound = not any(verdict.problems for verdict in verdicts.values())
    if as_json:
        print_json({"sound": sound, "folders": verdicts})
    if not sound:
        raise typer.Exit(1)


# -- one recording ------------------------------------------------------------------------------


def _record(
    task: str, settings: Collection, seed: int | None, out: Path | None, as_json: bool
) -> None:
    """Record a demonstration of the expert, in RoboTwin's HDF5 layout: frames, commanded and
    measured joints, poses.

    It goes on to the end of the expert's plan, as fast as official demonstrations; frames are as
    many physics steps apart as fits the task's step limit (15 to 50).
    """
    from robospa.harness.convention_check.episodes import require, write_episode
    from robospa.harness.demonstrations.demonstration import recorded_expert

    require()
    key = _one_trial(task, settings, seed)
    path = out or Path(f"{key.task}-L{key.level}-{key.seed}.hdf5")
    if path.exists():
        raise SettingsError(f"{path} exists already; choose another --out")
    episode, success = recorded_expert(key, path.name)
    write_episode(path, episode)
    if as_json:
        about = {"frames": len(episode), "success": success, "instruction": episode.instruction}
        print_json({"out": path, **about})
        return
    how = "success" if success else "no success"
    print(f"{path}: {len(episode)} frames, {how}; instruction {episode.instruction!r}")


def _one_trial(task: str, settings: Collection, seed: int | None) -> TrialKey:
    """The training trial of the demonstration; SettingsError unless there is just one."""
    from robospa.harness.selection import list_trials
    from robospa.harness.settings import Selection
    from robospa.tasks.modes import for_training

    level = settings.levels if settings.levels.isdecimal() else "1"
    seeds = None if seed is None else str(seed)
    mode, robot = for_training(settings.mode), settings.embodiment
    trials = list_trials(Selection(task, level, 1, seeds, "train", robot, mode))
    if len(trials) != 1:
        raise SettingsError("record one task with one robot in one scene mode at a time")
    return trials[0]
