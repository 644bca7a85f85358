"""`robospa record TASK`: a demonstration of the oracle, in the layout of official recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def record(
    task: Annotated[str, typer.Argument(help="base task, such as Pick_Blocks_Size")],
    level: Annotated[int, typer.Option(help="1 to 5")] = 1,
    seed: Annotated[
        int | None, typer.Option(help="scene; default: the first accepted one of the variant")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="file; default <task>-L<level>-<seed>.hdf5")
    ] = None,
    split: Annotated[str, typer.Option(help="instruction: train or heldout")] = "train",
    mode: Annotated[str, typer.Option(help="scene mode")] = "clean",
    policy: Annotated[str, typer.Option(help="policy to record")] = "oracle",
) -> None:
    """Record one trial of the oracle at 16.67 Hz: frames, commanded and measured joints, poses.

    The file is in RoboTwin's HDF5 layout and can be given to `robospa check URL --demo`.
    """
    from robospa.harness.cli.selection import (
        BadChoice,
        list_trials,
        parse_levels,
        parse_seeds,
        parse_tasks,
    )
    from robospa.harness.factory import open_policy
    from robospa.harness.replays.episodes import EpisodeRecorder, require, write_episode
    from robospa.harness.trial import policy_seed, run_trial
    from robospa.trial import TrialKey

    require()
    names, levels = parse_tasks(task), parse_levels(str(level))
    if len(names) != 1:
        raise BadChoice(f"{task!r} names {len(names)} tasks; record one at a time")
    seeds = parse_seeds(None if seed is None else str(seed))
    key: TrialKey = list_trials(
        names, levels, 1, seeds, embodiment="aloha-agilex", mode=mode, split=split
    )[0]
    path = out or Path(f"{key.task}-L{key.level}-{key.seed}.hdf5")
    if path.exists():
        raise BadChoice(f"{path} exists already; choose another --out")
    from robospa.harness.sim.sapien_world import SapienWorld

    recorder, world = EpisodeRecorder(), SapienWorld()
    try:
        done = run_trial(
            world, open_policy(policy, {}), key, policy_seed=policy_seed(key), recorder=recorder
        )
    finally:
        world.close()
    about = {"task": key.task, "level": key.level, "seed": key.seed, "embodiment": key.embodiment}
    about |= {"mode": key.mode, "split": key.split}
    episode = recorder.episode(path.name, done.instruction, about)
    write_episode(path, episode)
    how = "success" if done.success else f"no success ({done.end})"
    print(f"{path}: {len(episode)} frames, {how}; told {done.instruction!r}")
