"""`robospa audit`: is there reason to doubt a run? What it does lies in `leaderboard.audit`."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robospa.harness.cli.ranges import between
from robospa.harness.cli.settings_flags import Token

if TYPE_CHECKING:
    from robospa.results.records.run_io import Run
    from robospa.trial import TrialKey

COUNT = between(0, 10_000)
AUDIT = "robospa.leaderboard.audit"
JOINTS = "robospa.leaderboard.traces"
EXPERT = "robospa.baselines.oracle:create"


def _load(path: str) -> Any:
    from robospa.harness.factory import load_function

    return load_function(path)


def audit(
    run: Annotated[Path, typer.Argument(help="folder of a run, or a bundle")],
    reproduction: Annotated[
        Path | None, typer.Option(help="folder of the same policy's run on hidden scenes")
    ] = None,
    expert: Annotated[
        int, typer.Option(callback=COUNT, help="successful trials to hold against the expert's")
    ] = 10,
    policy: Annotated[
        str | None, typer.Option(help="URL of the server, to be asked with exchanged sentences")
    ] = None,
    sentences: Annotated[
        int, typer.Option(callback=COUNT, help="with --policy: trials to ask it for")
    ] = 10,
    token: Token = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Look for signs that a run is not what it says: a sentence for each, with its number.

    Success far above the rate on hidden scenes, the expert's own actions, no reaction to the
    sentence, trials that were repeated. Ends with 1 if anything is suspicious.
    """
    from robospa.harness.factory import open_policy
    from robospa.harness.rehearsal import expert_actions, rehearse
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.results.records.run_io import read_run

    found, traces = _read(run, expert)
    findings = list(_load(f"{AUDIT}:faults")(found))
    if reproduction is not None:
        findings.append(_load(f"{AUDIT}:hidden_gap")(found, read_run(reproduction)))
    if expert and not found.manifest.settings.salt_sha256:
        world, oracle = SapienWorld(render=False), _load(EXPERT)()
        findings.append(
            _load(f"{AUDIT}:expert_likeness")(
                traces, lambda key: expert_actions(world, oracle, key)
            )
        )
        world.close()
    if policy is not None and sentences:
        world = SapienWorld()
        asked = open_policy(policy, {"token": token})
        keys = _spread(list(found.keys), sentences)
        play = partial(rehearse, world, asked)
        findings.append(_load(f"{AUDIT}:sentence_reaction")(play, keys))
        world.close()
    if as_json:
        print(json.dumps([asdict(one) for one in findings], indent=1))
    for one in [] if as_json else findings:
        print(f"{'SUSPICIOUS' if one.suspicious else 'ok':10} {one.check}: {one.sentence}")
    if any(one.suspicious for one in findings):
        raise typer.Exit(1)


def _read(path: Path, count: int) -> tuple[Run, dict[TrialKey, Any]]:
    """The run, and the joint actions that `count` of its successful trials executed; trials whose
    traces lack them are left out."""
    from robospa.harness.running.action_files import read_actions, read_joints
    from robospa.results.records.run_io import action_path, read_run

    bundle = None
    if path.is_file():
        reference = _load("robospa.leaderboard.rules:shipped")()
        bundle = _load("robospa.leaderboard.verify:verify")(path, reference, practice=True)
    run = bundle.run if bundle else read_run(path)
    good = [key for key in run.keys if key in run.records and run.records[key].success]
    chosen = _spread(good, count)
    if bundle:
        traces = _load("robospa.leaderboard.verify:read_traces")(bundle, chosen)
        spaces = {key: bundle.settings.spec(key.task).action for key in chosen}
    else:
        files = {key: action_path(path, key) for key in chosen}
        read = {key: read_actions(file) for key, file in files.items()}
        spaces = {key: space for key, (_, space) in read.items()}
        join = _load(f"{JOINTS}:with_joints")
        traces = {key: join(read[key][0], read_joints(file)) for key, file in files.items()}
    of = _load(f"{JOINTS}:joint_path")
    paths = {key: of(traces[key], key.embodiment, spaces[key]) for key in chosen}
    return run, {key: trace for key, trace in paths.items() if trace is not None}


def _spread(keys: list[TrialKey], count: int) -> list[TrialKey]:
    """`count` of `keys`, spread over the list."""
    return keys[:: max(1, len(keys) // count)][:count] if count else []
