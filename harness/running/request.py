"""From settings to what the driver runs: trials, workers and how their policies are reached."""

import secrets
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from robospa.extras import need
from robospa.harness.clock.policy_clock import ClockError, PolicyClock, frozen_timing, real_clock
from robospa.harness.factory import is_url
from robospa.harness.running.evaluate import Request
from robospa.harness.running.policy_probe import read_map
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.status import cores, most_workers
from robospa.harness.running.worker import Targets, WorkerConfig, each
from robospa.harness.selection import list_trials, seed_sources
from robospa.harness.settings import (
    FILE,
    Compute,
    Connection,
    EvaluationSettings,
    SettingsError,
    flat,
    to_toml,
)
from robospa.harness.worlds import SAPIEN_NAME, WorldKind, world_kind
from robospa.protocol.errors import printable
from robospa.registry import UnknownName
from robospa.results.records.manifest import MANIFEST
from robospa.results.records.runs import read_run
from robospa.tasks.catalog import tasks
from robospa.trial import TrialKey

HELD = 3
"""Trials that a worker holds at once: with two, where model and cores are equally slow, either
still waits for the other now and then (`benchmarks/throughput.py`)."""
RUNS = Path("runs")
"""Where runs go by default."""


def make_request(
    settings: EvaluationSettings,
    *,
    token: str | None = None,
    resume: bool = False,
    keys: Sequence[TrialKey] | None = None,
    arguments: Mapping[str, Any] | None = None,
    salt: str = "",
) -> Request:
    """What the driver runs for `settings`.

    `token` is the bearer token of the policy's servers. `keys` are other trials than those that
    the settings select; `arguments` then say in the manifest where they come from. `salt` is the
    secret that hides their scenes; like the token it is written nowhere.
    Raises SettingsError, and RunError for a policy map that does not fit.
    """
    if settings.recording.video != "none":
        import av  # noqa: F401  (fails now rather than after the first trial)
    if settings.recording.log != "none":
        need(settings.recording.log.partition(":")[0])
    clock = _clock(settings)
    settings = replace(settings, timing=frozen_timing(settings.timing))
    kind = _kind(settings)
    kind.check(settings)
    trials = list_trials(settings.selection) if keys is None else keys
    servers = check_servers(settings)
    policies: dict[str, Targets] = {}
    if settings.policy_map is not None:
        asked = list(dict.fromkeys(key.task for key in trials))
        policies = read_map(settings.policy_map, asked, tasks())
    found = [*servers, *(t for ts in policies.values() for t in each(ts))]
    folder = run_folder(settings, resume)
    options = connect_arguments(found, settings.connection, token)
    one_trial = one_trial_servers(found)
    most = len(set(one_trial.values())) if len(one_trial) == len(set(found)) else 0
    compute = _limited(settings.compute, most)
    parts, parts_arguments = kind.parts(settings, trials)
    config = WorkerConfig(
        folder=folder,
        policy=servers or str(settings.policy_map),
        options=options,
        one_trial=one_trial,
        run_seed=settings.simulation.run_seed or "",
        policies=policies,
        step_scale=settings.simulation.step_scale,
        video=settings.recording.video,
        cameras=settings.recording.cameras,
        salt=salt,
        clock=clock,
        world=kind.name,
        world_arguments=kind.arguments(settings),
        parts=parts,
        parts_arguments=parts_arguments,
    )
    return Request(
        config,
        trials,
        _run_options(settings, compute.workers, trials_per_worker(settings, compute, found)),
        replace(settings, out=folder) if keys is None else None,
        arguments=flat(settings) if arguments is None else arguments,
        seeds=seed_sources(settings.selection, trials) if keys is None else (),
        resume=resume,
        wait=settings.connection.wait,
        compute=compute,
        look=kind.name == SAPIEN_NAME,  # another world may have conventions of its own
    )


def goes_on(resume: bool | str, out: Path | None) -> bool:
    """Whether the run in `out` is continued: with "auto" if there is one."""
    if resume not in (True, False, "auto"):
        raise SettingsError(f'resume is {resume!r}: give True, False or "auto"')
    return out is not None and (out / MANIFEST).exists() if resume == "auto" else bool(resume)


def interrupted(settings: EvaluationSettings) -> bool:
    """Whether `out` holds an unfinished run of exactly these `settings` and of a policy that says
    which weights it has: others are refused then, so that going on is safe."""
    file = (settings.out or Path()) / FILE
    asked = to_toml(replace(settings, timing=frozen_timing(settings.timing)))
    if settings.out is None or not file.exists() or file.read_text("utf-8") != asked:
        return False
    run = read_run(settings.out)
    kept = run.manifest.settings
    return not kept.policies and bool(kept.policy.spec.get("checkpoint")) and bool(run.missing)


def check_servers(settings: EvaluationSettings) -> tuple[str, ...]:
    """The policy's servers, or its name; empty if there is a policy map.

    Raises SettingsError unless there is either one policy or a map of policies.
    """
    servers = settings.policy
    if servers and settings.policy_map is not None:
        raise SettingsError("give the policy or --policy-map FILE, not both")
    if not servers and settings.policy_map is None:
        raise SettingsError(
            "give the policy, a URL or a name, or else --policy-map FILE (see --help-all)"
        )
    if twice := next((s for s in servers if servers.count(s) > 1), None):
        raise SettingsError(f"{twice} is named twice; several workers share a server without that")
    if len(servers) > 1 and (name := next((s for s in servers if not is_url(s)), None)):
        raise SettingsError(f"{name!r} is no URL of a server: it cannot be one of several")
    return servers


def run_folder(settings: EvaluationSettings, resume: bool = False) -> Path:
    """Where the run goes; by default a new folder under RUNS, named after the policy."""
    if settings.out is not None:
        return settings.out
    if resume:
        raise SettingsError("to resume a run, say with out which one")
    first = settings.policy[0] if settings.policy else (settings.policy_map or Path()).stem
    name = first.partition("?")[0].rstrip("/").rpartition("/")[2] if is_url(first) else first
    safe = "".join(c if c.isalnum() else "-" for c in name)[:80]
    return new_folder(safe)


def new_folder(name: str) -> Path:
    """A folder under RUNS that nobody has: runs of one policy may start in the same second, the
    cells of a sweep, the jobs of an array."""
    return RUNS / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(2)}"


def connect_arguments(
    targets: Sequence[str], connection: Connection, token: str | None
) -> dict[str, Any]:
    """Keyword arguments of `robospa.clients.connect` for `targets`; empty without a server.

    Raises SettingsError if a server's dialect does not have the options that it is given.
    """
    urls = [target for target in dict.fromkeys(targets) if is_url(target)]
    if not urls:
        return {}
    from robospa.protocol.transport import Timeouts

    timeouts = Timeouts(
        infer=connection.timeout,
        first_infer=connection.first_timeout,
        reset=connection.first_timeout,
        wait=connection.patience,
    )
    options = [client_options(url, connection.client) for url in urls]
    return {"timeouts": timeouts, "token": token, "options": options[0]}


def client_options(url: str, file: Path | None) -> dict[str, Any]:
    """The options of the TOML or JSON `file`, checked with those of the URL; raises
    SettingsError."""
    from robospa.clients import check_options
    from robospa.schema import parse_json

    try:
        read = tomllib.loads if file is not None and file.suffix == ".toml" else parse_json
        given = read(file.read_text()) if file is not None else {}
        if not isinstance(given, dict):
            raise ValueError("it is no JSON map")
        check_options(url, given)
    except (OSError, ValueError) as error:
        where = f"--client {file}: " if file is not None else ""
        text = printable(str(getattr(error, "strerror", None) or error), 600)
        raise SettingsError(f"{where}{text}") from error
    return given


def _clock(settings: EvaluationSettings) -> PolicyClock | None:
    try:
        return real_clock(settings.timing, settings.simulation.control)
    except ClockError as error:
        raise SettingsError(str(error)) from error


def _kind(settings: EvaluationSettings) -> WorldKind:
    world = settings.simulation.world
    try:
        return world_kind(world)
    except UnknownName as error:
        raise SettingsError(f"--world {world}: {error}") from error


def one_trial_servers(targets: Sequence[str]) -> dict[str, str]:
    """host:port of every server in `targets` whose model has one state for all connections, so that
    two trials at once would mix."""
    urls = [target for target in dict.fromkeys(targets) if is_url(target)]
    if not urls:
        return {}
    from robospa.clients import find_endpoint

    endpoints = {url: find_endpoint(url) for url in urls}
    return {url: e.authority for url, e in endpoints.items() if e.dialect.shared_state}


def _limited(compute: Compute, most: int) -> Compute:
    """`compute` with at most `most` workers, if that is not 0; SettingsError if more are asked
    for."""
    if not most:
        return compute
    if compute.workers > most:
        servers = "this server keeps" if most == 1 else f"these {most} servers keep"
        raise SettingsError(
            f"workers is {compute.workers}, but {servers} one state for all connections, and "
            f"trials would mix: leave workers out for {most}, or start more servers and name them "
            "with --policy"
        )
    return replace(compute, workers=compute.workers or most)


def trials_per_worker(
    settings: EvaluationSettings, compute: Compute, targets: Sequence[str]
) -> int:
    """How many trials a worker may hold at once; SettingsError for more than can be.

    By itself more than one only in simulators of ours: others may keep something for all worlds of
    a process. One worker asked for means one connection, which is all that some servers take.
    """
    asked, kind = settings.connection.trials_per_worker, _kind(settings)
    reasons = (
        ("a policy without a server computes in its worker", not all(map(is_url, targets))),
        ("this server keeps one state for all connections", bool(one_trial_servers(targets))),
        ("workers on a Ray cluster hold one", compute.executor == "ray"),
    )
    if why := next((text for text, so in reasons if so), ""):
        if asked > 1:
            raise SettingsError(f"trials_per_worker is {asked}, but {why}: leave it out")
        return 1
    return asked or (HELD if kind.shared and compute.workers != 1 else 1)


def _run_options(settings: EvaluationSettings, workers: int, concurrent_trials: int) -> RunOptions:
    retries = settings.retries
    return RunOptions(
        workers or cores(),
        retries.attempts,
        retries.backoff,
        retries.trial_timeout,
        stuck_seconds=retries.stuck_timeout,
        most=workers or most_workers(),
        patience=settings.connection.patience,
        policy_errors=retries.policy_errors,
        concurrent_trials=concurrent_trials,
    )
