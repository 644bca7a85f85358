"""`robospa record TASK`: a demonstration of the oracle, in the layout of official recordings."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.ranges import SEED
from robospa.trial import REFERENCE

if TYPE_CHECKING:
    from robospa.harness.convention_check.episodes import Episode
    from robospa.harness.trial import Recorder
    from robospa.harness.world import World
    from robospa.trial import TrialKey

ORACLE = "oracle"


def record(
    task: Annotated[str, typer.Argument(help="base task, such as Pick_Blocks_Size")],
    level: Annotated[int, typer.Option(help="1 to 5")] = 1,
    seed: Annotated[
        int | None,
        typer.Option(callback=SEED, help="scene; default: the first accepted one of the variant"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="file; default <task>-L<level>-<seed>.hdf5")
    ] = None,
    split: Annotated[str, typer.Option(help="instruction: train or heldout")] = "train",
    mode: Annotated[
        str, typer.Option(help="scene mode; of randomized scenes those with seen textures")
    ] = "clean",
    embodiment: Annotated[str, typer.Option(help="robot")] = REFERENCE,
    policy: Annotated[str, typer.Option(help="policy to record")] = ORACLE,
) -> None:
    """Record a demonstration: frames, commanded and measured joints, poses.

    The oracle's runs to the end of its plan, as fast as official demonstrations; frames are as many
    physics steps apart as fits the task's step limit (15 to 50). Another policy's is its trial. The
    file is in RoboTwin's HDF5 layout and can be given to `robospa check URL --demo`. One call
    records one episode, in about the time of its trial with three cameras.
    """
    from robospa.harness.convention_check.episodes import require, write_episode
    from robospa.harness.settings import SettingsError

    require()
    key = _one_trial(task, level, seed, mode, split, embodiment)
    path = out or Path(f"{key.task}-L{key.level}-{key.seed}.hdf5")
    if path.exists():
        raise SettingsError(f"{path} exists already; choose another --out")
    episode, success = _recorded(key, policy, path.name)
    write_episode(path, episode)
    how = "success" if success else "no success"
    print(f"{path}: {len(episode)} frames, {how}; instruction {episode.instruction!r}")


def _one_trial(
    task: str, level: int, seed: int | None, mode: str, split: str, robot: str
) -> TrialKey:
    from robospa.harness.selection import list_trials, parse_tasks
    from robospa.harness.settings import Selection, SettingsError
    from robospa.tasks.modes import for_training

    names = parse_tasks(task)
    if len(names) != 1:
        raise SettingsError(f"{task!r} names {len(names)} tasks; record one at a time")
    seeds = None if seed is None else str(seed)
    chosen = Selection(names[0], str(level), 1, seeds, split, robot, for_training(mode))
    trials = list_trials(chosen)
    if len(trials) != 1:
        raise SettingsError("name one robot, scene mode and split; record one trial at a time")
    return trials[0]


def _recorded(key: TrialKey, policy: str, name: str) -> tuple[Episode, bool]:
    """The trial `key` of a policy as an episode called `name`, and whether it met the goal."""
    from robospa.harness.demonstrations.recorder import FrameRecorder, frame_steps
    from robospa.harness.robots import embodiment
    from robospa.harness.sim.motion import ACTION_LIMITS, DEMONSTRATION_LIMITS
    from robospa.harness.sim.sapien_world import SapienWorld

    stride = frame_steps(key.task)
    recorder = FrameRecorder(stride)
    world = SapienWorld(True, limits=DEMONSTRATION_LIMITS if policy == ORACLE else ACTION_LIMITS)
    try:
        instruction, success = _run(world, key, policy, recorder)
        space = embodiment(key.embodiment).action_space("joint")
        about = {**asdict(key), "stride": stride}
        return recorder.episode(name, instruction, about, space), success
    finally:
        world.close()


def _run(world: World, key: TrialKey, policy: str, recorder: Recorder) -> tuple[str, bool]:
    """Instruction of the recorded trial, and whether it met the goal."""
    from robospa.harness.demonstrations.demonstration import demonstrate
    from robospa.harness.factory import open_policy
    from robospa.harness.trial import run_trial
    from robospa.harness.trial_identity import policy_seed, trial_id

    if policy == ORACLE:
        made = demonstrate(world, key, recorder)
        return made.instruction, made.success
    done = run_trial(
        world,
        open_policy(policy, {}),
        key,
        policy_seed=policy_seed(key),
        trial_id=trial_id(key),
        recorder=recorder,
    )
    return done.instruction, done.success
