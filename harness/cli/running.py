"""What `eval` and `demo` share: from options to a request, and from a finished run to its table."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from robospa.harness.cli.selection import BadChoice
from robospa.harness.factory import is_url
from robospa.harness.running.evaluate import Request, RunAborted, evaluate
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.staffing import cores as cores
from robospa.harness.running.staffing import most_workers
from robospa.harness.running.watchdog import BEAT_SECONDS
from robospa.harness.running.worker import VIDEO, Targets, WorkerConfig
from robospa.trial import TrialKey

CONTROLS = ("rest_to_rest", "fixed_rate")


def run_folder(out: Path | None, policy: str, resume: bool) -> Path:
    """Where the run goes; by default a new folder under `runs`."""
    if out is not None:
        return out
    if resume:
        raise BadChoice("--resume needs --out to say which run to go on with")
    name = policy.rpartition("/")[2] if is_url(policy) else policy
    safe = "".join(c if c.isalnum() else "-" for c in name)
    return Path("runs") / f"{safe}-{time.strftime('%Y%m%d-%H%M%S')}"


def all_servers(first: str | None, more: Sequence[str] | None) -> tuple[str, ...]:
    """The policy's servers, each once named; raises BadChoice."""
    servers = ([first] if first is not None else []) + list(more or ())
    if twice := next((s for s in servers if servers.count(s) > 1), None):
        raise BadChoice(f"{twice} is named twice; several workers share a server without that")
    if len(servers) > 1 and (name := next((s for s in servers if not is_url(s)), None)):
        raise BadChoice(f"{name!r} is no URL of a server: it cannot be one of several")
    return tuple(servers)


def make_request(
    policy: Targets,
    keys: Sequence[TrialKey],
    folder: Path,
    *,
    connection: Mapping[str, float],
    token: str | None = None,
    client: Path | None = None,
    policies: Mapping[str, Targets] | None = None,
    step_scale: float = 1.0,
    workers: int = 0,
    attempts: int = 3,
    backoff: float = 2.0,
    trial_seconds: float = 1800.0,
    stuck_seconds: float = 300.0,
    video: str = "none",
    control: str = "rest_to_rest",
    run_seed: int = 0,
    world: str | None = None,
    parts: str | None = None,
    resume: bool = False,
    arguments: Mapping[str, Any] | None = None,
) -> Request:
    """Check the options and put them where they belong; raises BadChoice.

    `policies`: the policy of every task, if they are not all done by `policy`.
    """
    if not 0 < step_scale <= 100:
        raise BadChoice(f"--step-scale {step_scale:g} is not between 0 and 100")
    if video not in VIDEO:
        raise BadChoice(f"--video {video!r} is none of {', '.join(VIDEO)}")
    if control not in CONTROLS:
        raise BadChoice(f"--control {control!r} is none of {', '.join(CONTROLS)}")
    if workers < 0 or attempts < 1 or trial_seconds <= 0 or backoff < 0:
        raise BadChoice("--workers, --attempts, --backoff and --trial-timeout cannot be that small")
    if stuck_seconds < 3 * BEAT_SECONDS:
        raise BadChoice(f"--stuck-timeout cannot be less than {3 * BEAT_SECONDS:g} s")
    if video != "none":
        import av  # noqa: F401  (fails now rather than after the first trial)
    connecting: dict[str, Any] = {}
    given = (policies or {"": policy}).values()
    targets = [t for g in given for t in ((g,) if isinstance(g, str) else g)]
    urls = [t for t in dict.fromkeys(targets) if is_url(t)]
    if urls:
        from robospa.protocol.transport import Timeouts

        connecting["timeouts"] = Timeouts(
            infer=connection["timeout"],
            first_infer=connection["first_timeout"],
            reset=connection["first_timeout"],
            wait=connection["patience"],
        )
        connecting["token"] = token
        for url in urls:
            connecting["options"] = client_options(url, client)
    config = WorkerConfig(
        folder=folder,
        policy=policy,
        options=connecting,
        run_seed=run_seed,
        policies=dict(policies or {}),
        step_scale=step_scale,
        video=video,
        world_arguments={"render": None, "control": control},
    )
    if world is not None:
        config = _replace(config, world=world, world_arguments={})
    if parts is not None:
        config = _replace(config, parts=parts)
    options = RunOptions(
        workers or cores(),
        attempts,
        backoff,
        trial_seconds,
        stuck_seconds=stuck_seconds,
        most=workers or most_workers(),
        patience=connection["patience"],
    )
    return Request(
        config, keys, options, _settings(keys), dict(arguments or {}), resume, connection["wait"]
    )


def on_executor(
    request: Request, executor: str, address: str | None, workers: int, cpus: float, gpus: float
) -> Request:
    """`request` with its workers on a Ray cluster if `executor` says so; raises BadChoice."""
    from dataclasses import replace

    if executor not in ("local", "ray"):
        raise BadChoice(f"--executor {executor!r} is neither local nor ray")
    if executor == "local":
        if address is not None:
            raise BadChoice("--address goes with --executor ray")
        return request
    if cpus <= 0 or gpus < 0:
        raise BadChoice("a worker takes more than 0 CPUs and no less than 0 GPUs")
    from robospa.harness.running.ray_bridge import RaySettings

    return replace(request, ray=RaySettings(address or "auto", workers, cpus, gpus))


def policy_map(file: Path, keys: Sequence[TrialKey]) -> dict[str, Targets]:
    """The policy, or the policies, of every task of `keys`; raises RunError."""
    from robospa.harness.running.policies import read_map
    from robospa.tasks.catalog import tasks

    return read_map(file, list(dict.fromkeys(key.task for key in keys)), tasks())


def client_options(url: str, file: Path | None) -> dict[str, Any]:
    """The options of the JSON `file`, checked together with those of the URL; raises BadChoice."""
    from robospa.clients import check_options
    from robospa.results.records.schema import parse

    try:
        given = parse(file.read_text()) if file is not None else {}
        if not isinstance(given, dict):
            raise ValueError("it is no JSON map")
        check_options(url, given)
    except (OSError, ValueError) as error:
        where = f"--client {file}: " if file is not None else ""
        raise BadChoice(f"{where}{str(error)[:300]}") from error
    return given


def _replace(config: WorkerConfig, **changes: Any) -> WorkerConfig:
    from dataclasses import replace

    return replace(config, **changes)


def _settings(keys: Sequence[TrialKey]) -> dict[str, Any]:
    """What all trials share; the trials themselves are compared one by one."""
    return {
        "embodiment": sorted({k.embodiment for k in keys}),
        "mode": sorted({k.mode for k in keys}),
        "split": sorted({k.split for k in keys}),
    }


def run_and_show(request: Request) -> None:
    """Evaluate, print the table, and end with 1 if trials are missing, 130 on Ctrl-C."""
    from robospa.results.records.run_io import read_run
    from robospa.results.report.score_table import terminal

    folder = request.config.folder
    again = f"the same command with --out {folder} --resume goes on from here"
    try:
        with _terminable():
            evaluate(request)
    except KeyboardInterrupt:
        print(f"robospa: interrupted; {again}", file=sys.stderr)
        raise typer.Exit(130) from None
    except RunAborted as error:
        raise RunAborted(f"the run stopped: {error}; {again}") from error
    run = read_run(folder)
    terminal(run)
    if run.missing:
        print(
            f"robospa: {len(run.missing)} of {len(run.keys)} trials could not be run and are "
            f"missing from these numbers; {again}",
            file=sys.stderr,
        )
        raise typer.Exit(1)
    print(f"Run: {folder}   Report: robospa report {folder}")


class _terminable:
    """Treat SIGTERM like Ctrl-C while a run is going on."""

    def __enter__(self) -> None:
        import signal

        def interrupt(number: int, frame: object) -> None:
            raise KeyboardInterrupt

        self._before = signal.signal(signal.SIGTERM, interrupt)

    def __exit__(self, *_: object) -> None:
        import signal

        signal.signal(signal.SIGTERM, self._before)
