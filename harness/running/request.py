"""From settings to what the driver runs: trials, workers and how their policies are reached."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robospa.extras import need
from robospa.harness.clock.clock import Clock, ClockError
from robospa.harness.clock.settings import FIXED_RATE, frozen_timing, real_clock, steps_of
from robospa.harness.factory import is_url
from robospa.harness.official.checkout_options import (
    FACTORY,
    checkout_selection,
    episodes_of,
    is_checkout,
    parse_checkout,
)
from robospa.harness.official.official_options import FACTORY as OFFICIAL_FACTORY
from robospa.harness.official.official_options import (
    check_robots,
    is_official,
    parse_official,
    use_archive,
)
from robospa.harness.running.autoscaling import cores, most_workers
from robospa.harness.running.evaluate import Request
from robospa.harness.running.policy_probe import read_map
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.worker import (
    CHECKOUT_PARTS,
    OFFICIAL_PARTS,
    OFFICIAL_WORLD_PARTS,
    SHUFFLED_PARTS,
    TASK_PARTS,
    Targets,
    WorkerConfig,
)
from robospa.harness.selection import list_trials, seed_sources
from robospa.harness.settings import (
    Compute,
    Connection,
    EvaluationSettings,
    SettingsError,
    flat,
)
from robospa.protocol.options import plain_options
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.running.ray_cluster import RaySettings

BUILTIN = "builtin"
"""Our own simulator and assets, as the setting `world`."""
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
    if settings.simulation.assets is not None:
        use_archive(settings.simulation)
    if settings.recording.log != "none":
        need(settings.recording.log.partition(":")[0])
    clock = _clock(settings)
    settings = replace(settings, timing=frozen_timing(settings.timing))
    selection = settings.selection
    if is_checkout(settings.simulation.world):
        selection = checkout_selection(settings)
    trials = list_trials(selection) if keys is None else keys
    servers = check_servers(settings)
    policies = _policy_map(settings.policy_map, trials)
    found = [*servers, *(t for ts in policies.values() for t in _each(ts))]
    folder = run_folder(settings, resume)
    options = connect_arguments(found, settings.connection, token)
    one_trial = one_trial_servers(found)
    most = len(set(one_trial.values())) if len(one_trial) == len(set(found)) else 0
    compute = _limited(settings.compute, most)
    if is_checkout(settings.simulation.world):
        compute = replace(compute, workers=compute.workers or 1)  # each takes a share of the GPU
    config = WorkerConfig(
        folder=folder,
        policy=servers or str(settings.policy_map),
        options=options,
        one_trial=one_trial,
        run_seed=settings.simulation.run_seed,
        policies=policies,
        step_scale=settings.simulation.step_scale,
        video=settings.recording.video,
        cameras=settings.recording.cameras,
        salt=salt,
        clock=clock,
        **_world(settings),
        **_parts(settings, trials),
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
        ray=_on_ray(compute),
    )


def check_servers(settings: EvaluationSettings) -> tuple[str, ...]:
    """The policy's servers, or its name; empty if there is a policy map.

    Raises SettingsError unless there is either one policy or a map of policies.
    """
    servers = settings.policy
    if bool(servers) == (settings.policy_map is not None):
        raise SettingsError("give either the policy or --policy-map")
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
    name = first.rpartition("/")[2] if is_url(first) else first
    safe = "".join(c if c.isalnum() else "-" for c in name)
    return RUNS / f"{safe}-{time.strftime('%Y%m%d-%H%M%S')}"


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
    """The options of the JSON `file`, checked with those of the URL; raises SettingsError."""
    from robospa.clients import check_options
    from robospa.schema import parse_json

    try:
        given = parse_json(file.read_text()) if file is not None else {}
        if not isinstance(given, dict):
            raise ValueError("it is no JSON map")
        check_options(url, given)
    except (OSError, ValueError) as error:
        where = f"--client {file}: " if file is not None else ""
        raise SettingsError(f"{where}{str(error)[:300]}") from error
    return given


def _policy_map(file: Path | None, keys: Sequence[TrialKey]) -> dict[str, Targets]:
    """The policy, or the policies, of every task of `keys`; raises RunError."""
    if file is None:
        return {}
    from robospa.tasks.catalog import tasks

    return read_map(file, list(dict.fromkeys(key.task for key in keys)), tasks())


def _each(targets: Targets) -> tuple[str, ...]:
    return (targets,) if isinstance(targets, str) else targets


def _clock(settings: EvaluationSettings) -> Clock | None:
    """The real clock, None for the paused one; raises SettingsError."""
    try:
        return real_clock(settings.timing, settings.simulation.control)
    except ClockError as error:
        raise SettingsError(str(error)) from error


def _world(settings: EvaluationSettings) -> dict[str, Any]:
    """Which world, as arguments of WorkerConfig."""
    simulation = settings.simulation
    steps = steps_of(settings.timing, simulation.control)
    control: dict[str, Any] = {"control": simulation.control}
    if settings.timing.action_rate is not None:
        control = {"control": FIXED_RATE, "action_steps": steps}
    if simulation.world in (None, BUILTIN):
        return {"world_arguments": {"render": None, **control}}
    if is_checkout(simulation.world):
        folder, options = parse_checkout(str(simulation.world))
        return {
            "world": FACTORY,
            "world_arguments": {"folder": str(folder), **plain_options(options)},
        }
    if is_official(simulation.world):
        start, _ = parse_official(str(simulation.world), simulation.assets is not None)
        arguments = {"render": None, **control, "settle": start.settle}
        if simulation.robot_assets != BUILTIN:
            arguments["robot_assets"] = simulation.robot_assets
        return {"world": OFFICIAL_FACTORY, "world_arguments": arguments}
    own = {} if settings.timing.action_rate is None else {"action_steps": steps}
    return {"world": simulation.world, "world_arguments": own}


def _parts(settings: EvaluationSettings, keys: Sequence[TrialKey]) -> dict[str, Any]:
    """What finds a trial's scene and sentence, as arguments of WorkerConfig.

    A checkout's sentences are read here, once: workers get them as data. Raises CheckoutError.
    """
    folder, parts = settings.selection.instructions, settings.simulation.parts
    if settings.simulation.shuffle_instructions:
        world = settings.simulation.world
        if folder is not None or is_checkout(world) or is_official(world):
            raise SettingsError(
                "shuffle_instructions goes with the suite's own scenes and sentences: leave out "
                "instructions and the other world"
            )
        return {"parts": SHUFFLED_PARTS}
    if is_checkout(settings.simulation.world):
        return {"parts": CHECKOUT_PARTS, "parts_arguments": {"episodes": episodes_of(keys)}}
    official = is_official(settings.simulation.world)
    if folder is None and not official:
        return {"parts": parts or TASK_PARTS}
    if parts is not None:
        raise SettingsError("parts has scenes and sentences of its own: leave it out")
    arguments: dict[str, Any] = {}
    if folder is not None:
        from robospa.harness.official.sentences import read_checkout

        arguments["sentences"] = read_checkout(folder, {key.variant for key in keys})
    if not official:
        return {"parts": OFFICIAL_PARTS, "parts_arguments": arguments}
    _, arguments["layout"] = parse_official(
        str(settings.simulation.world),
        settings.simulation.assets is not None,
        {key.task for key in keys},
    )
    if settings.simulation.robot_assets != BUILTIN:
        check_robots({key.embodiment for key in keys})
    arguments["episodes"] = episodes_of(keys)
    return {"parts": OFFICIAL_WORLD_PARTS, "parts_arguments": arguments}


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
    asked, world = settings.connection.trials_per_worker, settings.simulation.world
    reasons = (
        ("a policy without a server computes in its worker", not all(map(is_url, targets))),
        ("this server keeps one state for all connections", bool(one_trial_servers(targets))),
        ("workers on a Ray cluster hold one", compute.executor == "ray"),
        ("a checkout has one simulator a process", is_checkout(world)),
    )
    if why := next((text for text, so in reasons if so), ""):
        if asked > 1:
            raise SettingsError(f"trials_per_worker is {asked}, but {why}: leave it out")
        return 1
    ours = world in (None, BUILTIN) or is_official(world)
    return asked or (HELD if ours and compute.workers != 1 else 1)


def _run_options(settings: EvaluationSettings, workers: int, held: int) -> RunOptions:
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
        held=held,
    )


def _on_ray(compute: Compute) -> RaySettings | None:
    """How the workers are placed on a Ray cluster; None if they run on this machine."""
    if compute.executor != "ray":
        return None
    from robospa.harness.running.ray_cluster import RaySettings

    return RaySettings(
        compute.address or "auto", compute.workers, compute.cpus_per_worker, compute.gpus_per_worker
    )
