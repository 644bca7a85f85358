"""`robospa eval`: evaluate the policy behind a URL, on a fixed list of trials."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def evaluate(
    policy: Annotated[
        str | None,
        typer.Argument(help="a server's URL, such as ws://host:port, or a local policy's name"),
    ] = None,
    more: Annotated[
        list[str] | None,
        typer.Option("--policy", help="another server of the same policy; may be repeated"),
    ] = None,
    tasks: Annotated[
        str,
        typer.Option(
            help="task names, categories (GAC), spatial, procedural, basic, or all (without basic)"
        ),
    ] = "all",
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1-5",
    trials: Annotated[int, typer.Option(help="trials per variant")] = 100,
    workers: Annotated[
        int, typer.Option(help="worker processes; 0 for as many as keep the cores busy")
    ] = 0,
    out: Annotated[Path | None, typer.Option(help="folder of the run")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run in --out")] = False,
    video: Annotated[
        str, typer.Option(help="which trials to film: none, failures, first (of each task), all")
    ] = "none",
    split: Annotated[str, typer.Option(help="instructions: heldout or train")] = "heldout",
    seeds: Annotated[
        str | None, typer.Option(help="JSON file or 100000-100099; default: the shipped lists")
    ] = None,
    embodiment: Annotated[str, typer.Option(help="robot")] = "aloha-agilex",
    mode: Annotated[str, typer.Option(help="scene mode")] = "clean",
    control: Annotated[str, typer.Option(help="rest_to_rest or fixed_rate")] = "rest_to_rest",
    run_seed: Annotated[int, typer.Option(help="enters the policy's seed of every trial")] = 0,
    timeout: Annotated[float, typer.Option(help="seconds for one answer")] = 120.0,
    first_timeout: Annotated[float, typer.Option(help="seconds for the first answer")] = 600.0,
    wait: Annotated[float, typer.Option(help="seconds to wait for the server to listen")] = 0.0,
    patience: Annotated[
        float, typer.Option(help="seconds that a worker waits for a server that went away")
    ] = 60.0,
    trial_timeout: Annotated[
        float, typer.Option(help="seconds for one trial before its worker is killed")
    ] = 1800.0,
    stuck_timeout: Annotated[
        float,
        typer.Option(help="seconds without getting on, though not waiting for the policy"),
    ] = 300.0,
    attempts: Annotated[int, typer.Option(help="times a trial is tried if it cannot be run")] = 3,
    backoff: Annotated[float, typer.Option(help="seconds before the first retry")] = 2.0,
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="bearer token of the server")
    ] = None,
    client: Annotated[
        Path | None,
        typer.Option(help="JSON file with options of the server's dialect; those in the URL win"),
    ] = None,
    policy_map: Annotated[
        Path | None,
        typer.Option(help="JSON file with a URL for every base task, or a list of them"),
    ] = None,
    step_scale: Annotated[
        float,
        typer.Option(help="multiplies the official step limits; 1 is the benchmark"),
    ] = 1.0,
    executor: Annotated[
        str, typer.Option(help="where the workers are: local (here) or ray (a Ray cluster)")
    ] = "local",
    address: Annotated[
        str | None,
        typer.Option(
            help="Ray cluster: auto, local (one for this run), HOST:PORT, ray://HOST:PORT"
        ),
    ] = None,
    cpus_per_worker: Annotated[
        float, typer.Option(help="with ray: CPUs of its node that a worker takes")
    ] = 1.0,
    gpus_per_worker: Annotated[
        float, typer.Option(help="with ray: GPUs, only taken by runs that render; such as 0.1")
    ] = 0.0,
    world: Annotated[str | None, typer.Option(hidden=True)] = None,
    parts: Annotated[str | None, typer.Option(hidden=True)] = None,
) -> None:
    """Evaluate a policy; its report is one command further.

    Trials are seeded and their list is fixed before the run. A trial that cannot be run is retried
    and, if need be, reported as missing: it never counts as a failure. Ctrl-C is safe; add
    --resume to go on.
    """
    from robospa.harness.cli import running, selection

    arguments = {k: v for k, v in locals().items() if k not in ("token", "running", "selection")}
    servers = running.all_servers(policy, more)
    if bool(servers) == (policy_map is not None):
        raise selection.BadChoice("give either the policy or --policy-map")
    keys = selection.list_trials(
        selection.parse_tasks(tasks),
        selection.parse_levels(levels),
        trials,
        selection.parse_seeds(seeds),
        embodiment=embodiment,
        mode=mode,
        split=split,
    )
    request = running.make_request(
        servers or str(policy_map),
        keys,
        running.run_folder(out, servers[0] if servers else (policy_map or Path()).stem, resume),
        connection={
            "timeout": timeout,
            "first_timeout": first_timeout,
            "wait": wait,
            "patience": patience,
        },
        token=token,
        client=client,
        policies=running.policy_map(policy_map, keys) if policy_map is not None else {},
        step_scale=step_scale,
        workers=workers,
        attempts=attempts,
        backoff=backoff,
        trial_seconds=trial_timeout,
        stuck_seconds=stuck_timeout,
        video=video,
        control=control,
        run_seed=run_seed,
        world=world,
        parts=parts,
        resume=resume,
        arguments=_plain(arguments),
    )
    request = running.on_executor(
        request, executor, address, workers, cpus_per_worker, gpus_per_worker
    )
    running.run_and_show(request)


def _plain(arguments: dict[str, Any]) -> dict[str, Any]:
    return {k: str(v) if isinstance(v, Path) else v for k, v in arguments.items()}
